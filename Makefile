# Each target sets up what it needs: a virtual environment in .venv with the project installed in it.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
# Compilation allocates in small pieces: with this library, where it is installed, it takes a fifth less time.
MALLOC := $(firstword $(wildcard /usr/lib/*/libtcmalloc_minimal.so.4))

.PHONY: demo test coverage bench check docs clean

$(VENV)/.base: pyproject.toml
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "Python >= 3.11 is needed; set PYTHON=...")'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --editable '.[tuning]'
	touch $@

$(VENV)/.dev: $(VENV)/.base
	$(BIN)/python -m pip install --quiet --editable '.[dev]'
	touch $@

$(VENV)/.bench: $(VENV)/.base
	$(BIN)/python -m pip install --quiet --editable '.[bench]'
	touch $@

$(VENV)/.docs: $(VENV)/.base
	$(BIN)/python -m pip install --quiet --editable '.[docs]'
	touch $@

demo: $(VENV)/.base
	$(BIN)/python -m tuning demo --out demo --force

test: $(VENV)/.dev
	LD_PRELOAD=$(MALLOC) $(BIN)/python -m pytest

coverage: $(VENV)/.dev
	$(BIN)/python -m pytest --cov=absjax --cov=tuning --cov-report=term-missing:skip-covered

bench: $(VENV)/.bench
	$(BIN)/python -m tests.benchmarks

check: $(VENV)/.dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/pyright --pythonpath $(BIN)/python

docs: $(VENV)/.docs
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict

clean:
	rm -rf $(VENV) demo site
