# make demo   set everything up and run the main job on motion that the project generates
# make test   set everything up and pass all checks and tests
# The rest:   dev lint types check bench fixtures pictures clean

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
WORK := build

.PHONY: demo test dev lint types check bench fixtures pictures clean

demo: $(VENV)/.demo $(WORK)/fixtures/.done
	$(BIN)/python fixtures/demo.py --fixtures $(WORK)/fixtures --output $(WORK)/demo

test: lint types
	$(BIN)/python -m pytest -n auto -q

dev: $(VENV)/.test

lint: $(VENV)/.test
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .

types: $(VENV)/.test
	$(BIN)/mypy

check: test demo

bench: $(VENV)/.bench $(WORK)/fixtures/.done
	$(BIN)/python -m bench.run

fixtures: $(WORK)/fixtures/.done

pictures: demo
	$(BIN)/python -m fixtures.pictures $(WORK)/demo

$(WORK)/fixtures/.done: $(VENV)/.demo $(wildcard fixtures/*.py)
	rm -rf $(WORK)/fixtures
	$(BIN)/python -m fixtures.generate $(WORK)/fixtures
	touch $@

$(BIN)/python:
	$(PYTHON) -m venv $(VENV)

# One stamp a set of dependencies; the project itself is always installed in place, and pip
# compiles nothing that it installs so.
$(VENV)/.demo: pyproject.toml | $(BIN)/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e .
	$(BIN)/python -m compileall -q mocapidx cli
	touch $@

$(VENV)/.test: pyproject.toml | $(BIN)/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[test]'
	$(BIN)/python -m compileall -q mocapidx cli
	touch $@ $(VENV)/.demo

$(VENV)/.bench: pyproject.toml | $(BIN)/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[bench]'
	$(BIN)/python -m compileall -q mocapidx cli
	touch $@ $(VENV)/.demo

clean:
	rm -rf $(WORK) $(VENV) .mypy_cache .ruff_cache .pytest_cache .hypothesis
