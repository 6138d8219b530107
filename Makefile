# `make run` and `make test` set up all that they need in .venv, from the lock files.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check
RUNS := $(VENV)/.runs
TESTS := $(VENV)/.tests

# What Python compiles is kept for its next start, also where a container sets this.
export PYTHONDONTWRITEBYTECODE :=

# What `make fuzz` tries; SEED=n tries the same again.
SEED ?= $(shell date +%s)
INPUTS ?= 2400
FAULTS ?= 510
KILLS ?= 36

# `make test-pythons`: a part of the tests on the oldest and the newest other Python that is here.
.PHONY: run test test-golden test-all test-pythons fuzz check docs tutorials lock clean

$(RUNS): requirements.lock pyproject.toml
	@$(PYTHON) -c 'import sys; v = sys.version_info[:2]; \
	  sys.exit(0 if v >= (3, 11) else "phyblock needs Python 3.11 or newer, found %d.%d: make PYTHON=python3.13" % v)'
	$(PYTHON) -m venv $(VENV)
	$(PIP) --require-hashes --requirement requirements.lock
	$(PIP) --no-deps --editable .
	@touch $@

$(TESTS): $(RUNS) requirements-dev.lock
	$(PIP) --require-hashes --requirement requirements-dev.lock
	@touch $@

run: $(RUNS)
	$(BIN)/phyblock run benchmarks/quick.yaml

test: $(TESTS)
	$(BIN)/python -m pytest -n 2 --dist worksteal

# The whole of the golden runs of which `make test` makes a part.
test-golden: $(TESTS)
	$(BIN)/python -m pytest -n 2 -m slow tests/test_golden.py

test-all: $(TESTS)
	PHYBLOCK_EXAMPLES=200 PHYBLOCK_FUZZ_KILLS=$(KILLS) $(BIN)/python -m pytest -n 2 --dist worksteal -m ''

test-pythons: $(RUNS)
	.ci/pythons

fuzz: $(TESTS)
	PHYBLOCK_FUZZ_SEED=$(SEED) PHYBLOCK_FUZZ_INPUTS=$(INPUTS) PHYBLOCK_FUZZ_FAULTS=$(FAULTS) \
	  PHYBLOCK_FUZZ_KILLS=$(KILLS) $(BIN)/python -m pytest -m fuzz tests/fuzz

check: $(TESTS)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

# The documentation site, in build/docs-site; a broken link is an error.
docs: $(TESTS)
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build

# Follows the tutorials of the documentation.
tutorials: $(TESTS)
	$(BIN)/python -m pytest -n 2 -q -m '' tests/docs

LOCK := $(BIN)/uv pip compile pyproject.toml --universal --python-version 3.11 \
	  --generate-hashes --no-emit-index-url --no-emit-find-links --no-annotate --no-header --quiet

lock: $(TESTS)
	$(PIP) uv
	$(LOCK) --extra dev --output-file requirements-dev.lock
	$(LOCK) --constraint requirements-dev.lock --output-file requirements.lock

clean:
	rm -rf $(VENV) .venv-* build dist *.egg-info
