# Two commands for a newcomer: `make demo` and `make test`. Both do all the set-up.
PYTHON ?= python3
VENV := .venv
SOURCES := $(shell find src -name '*.pyx' -o -name '*.pxd' -o -name '*.pxi' -o -name '*.h') CMakeLists.txt pyproject.toml

.PHONY: demo test lint build clean

$(VENV)/bin/python:
	$(PYTHON) -m venv --copies $(VENV)

$(VENV)/.requirements: $(VENV)/bin/python pyproject.toml
	$(VENV)/bin/pip install -q "scikit-build-core>=0.11" "cython>=3.1" "cython-cmake>=0.2" ninja cmake
	touch $@

$(VENV)/.built: $(VENV)/.requirements $(SOURCES)
	$(VENV)/bin/pip install -q --no-build-isolation -e '.[test]'
	touch $@

$(VENV)/.lint: $(VENV)/.built
	$(VENV)/bin/pip install -q -e '.[lint]' --no-build-isolation
	touch $@

build: $(VENV)/.built

test: build
	$(VENV)/bin/python -m pytest

demo: build
	$(VENV)/bin/catenary demo

lint: $(VENV)/.lint
	$(VENV)/bin/ruff check src tests
	$(VENV)/bin/ruff format --check src tests
	$(VENV)/bin/mypy
	$(VENV)/bin/lint-imports

clean:
	rm -rf $(VENV) build
