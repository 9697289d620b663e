# `make demo` and `make test` do everything on a fresh machine; a second call goes straight to work.
#
#   PYTHON     interpreter for the virtual environment, 3.11 or newer
#   PIP_ARGS   for pip install, e.g. --extra-index-url https://download.pytorch.org/whl/cpu (see README)
#   ARGS       for what the target runs, e.g. make demo ARGS="--scene market --no-open"

PYTHON ?= python3
PIP_ARGS ?=
ARGS ?=
VENV := .venv
BIN := $(VENV)/bin

.PHONY: demo test lint format benchmark speed clean help

demo: $(VENV)/installed
	$(BIN)/oasisview demo $(ARGS)

test: $(VENV)/installed $(VENV)/chromium
	$(BIN)/python -m pytest -n 2 -ra $(ARGS)

lint: $(VENV)/installed
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

format: $(VENV)/installed
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

# How good: every method on every kind of scene, on the seeds that are kept for reporting. Takes about an hour;
# it goes on where it stopped. A part of it: make benchmark ARGS="--scenes office --seeds 1 --methods oasis"
benchmark: $(VENV)/installed
	$(BIN)/python benchmarks/evaluate_methods.py --seeds 101 102 103 --keep .oasisview/benchmark \
		--json .oasisview/benchmark/measured.json --plot .oasisview/benchmark $(ARGS)

# How fast, and how much memory.
speed: $(VENV)/installed
	$(BIN)/python benchmarks/speed.py $(ARGS)

clean:
	rm -rf $(VENV)

help:
	@echo "make demo | test | lint | format | benchmark | speed | clean"

$(VENV)/bin/python:
	.ci/system-packages libraries venv
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "Python 3.11 or newer is needed: make PYTHON=python3.12 ...")'
	$(PYTHON) -m venv $(VENV)

$(VENV)/installed: pyproject.toml | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet $(PIP_ARGS) --editable '.[dev]'
	@touch $@

$(VENV)/chromium: | $(VENV)/bin/python
	.ci/system-packages chromium
	@touch $@
