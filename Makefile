# make demo   set everything up and run the main job on motion that the project generates
# make test   set everything up and pass all checks and tests
# make torture   attack every reader and every store with damaged and hostile files, and every writing
#   command with faults, for hours; TORTURE=short make torture   as many as make test does,
#   TORTURE=1000 make torture   1000 of each
# make fuzz   let libFuzzer look for files that break a reader, for an hour each;
#   FUZZ='bvh amc' FUZZ_SECONDS=60 make fuzz   these readers only, for a minute each
# make sanitize   test the C kernels and the readers with sanitizers of memory and behaviour
# The rest:   dev kernels tests lint types check bench bench-quick fixtures three pictures docs clean

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
WORK := build
SANITIZED := $(WORK)/sanitized
FUZZED := $(WORK)/fuzzed
FUZZ_SECONDS ?= 3600
CLANG ?= clang
TORTURED := tests/fuzz tests/faults
QUICK := test_a_megabyte_of_nonsense_takes_neither_time_nor_memory
BUILT_FROM := pyproject.toml setup.py $(wildcard mocapidx/kernels/*.[ch])

.PHONY: demo test tests torture fuzz sanitize dev kernels lint types check bench bench-quick fixtures three pictures clean docs

demo: $(VENV)/.demo $(WORK)/fixtures/.done
	$(BIN)/python fixtures/demo.py --fixtures $(WORK)/fixtures --output $(WORK)/demo

test: lint types tests

tests: $(VENV)/.test
	$(BIN)/python -m pytest -n auto -q

# What was tried, what was wrong and how long it took stands in a table afterwards.
torture: $(VENV)/.test
	mkdir -p $(WORK)
	rm -f $(WORK)/torture.tsv
	TORTURE=$${TORTURE:-full} TORTURE_REPORT="$(CURDIR)/$(WORK)/torture.tsv" \
	  $(BIN)/python -m pytest -q -p no:cacheprovider -n auto --maxschedchunk=1 $(TORTURED); \
	  code=$$?; $(BIN)/python -m tests.tried $(WORK)/torture.tsv; exit $$code

# libFuzzer counts the branches of the kernels too, and sanitizers watch them; for that they are built
# by clang. What was done and found stands in a table afterwards, what was found below build/fuzz.
fuzz: $(VENV)/.fuzz
	@command -v $(CLANG) > /dev/null || \
	  { echo "make fuzz needs clang (apt-get install clang); CLANG=NAME names another" >&2; exit 1; }
	rm -rf $(FUZZED)
	mkdir -p $(FUZZED)
	cp -r mocapidx $(FUZZED)
	rm -f $(FUZZED)/mocapidx/kernels/*.so $(WORK)/fuzz.tsv
	CC=$(CLANG) KERNEL_FLAGS="-g -fsanitize=address,undefined,fuzzer-no-link -fno-sanitize-recover=all" \
	  $(BIN)/python setup.py --quiet build_ext --force \
	  --build-lib $(FUZZED) --build-temp $(FUZZED)/objects
	$(BIN)/python -m tests.fuzz.guided $(FUZZ) --seconds $(FUZZ_SECONDS) --kernels $(FUZZED) \
	  --report $(WORK)/fuzz.tsv

# The program that the tests start finds the same package by PYTHONPATH. Without the library of C++
# an exception of it ends a process that has the sanitizer; and some peers free what is not theirs.
sanitize: $(VENV)/.test
	rm -rf $(SANITIZED)
	mkdir -p $(SANITIZED)
	cp -r mocapidx $(SANITIZED)
	rm -f $(SANITIZED)/mocapidx/kernels/*.so
	KERNEL_FLAGS="-g -fsanitize=address,undefined -fno-sanitize-recover=all -Wall -Wextra -Werror" \
	  $(BIN)/python setup.py --quiet build_ext --force \
	  --build-lib $(SANITIZED) --build-temp $(SANITIZED)/objects
	LD_PRELOAD="$$($(CC) -print-file-name=libasan.so) $$($(CC) -print-file-name=libstdc++.so)" \
	  ASAN_OPTIONS=detect_leaks=0:alloc_dealloc_mismatch=0 PYTHONMALLOC=malloc \
	  PYTHONPATH="$(CURDIR)/$(SANITIZED)" MOCAPIDX_KERNELS=c \
	  $(BIN)/python -m pytest -q -o pythonpath="$(SANITIZED) ." --capture=sys \
	  --deselect tests/formats/test_hostile.py::$(QUICK) tests/kernels tests/alignment tests/formats

dev: $(VENV)/.test

kernels: $(VENV)/.test
	$(BIN)/python setup.py --quiet build_ext --inplace --force

lint: $(VENV)/.test
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .

types: $(VENV)/.test
	$(BIN)/mypy

check: test demo

bench: $(VENV)/.bench $(WORK)/fixtures/.done
	$(BIN)/python -m bench.run --output bench

bench-quick: $(VENV)/.bench $(WORK)/fixtures/.done
	$(BIN)/python -m bench.run --quick

# Every page, and the reference from the code, as a site; a page that leads nowhere is an error.
docs: $(VENV)/.docs
	rm -rf docs/reference/generated
	$(BIN)/python -m sphinx -W --keep-going -q -b html docs $(WORK)/site

fixtures: $(WORK)/fixtures/.done

# The library that draws in reports, from packages of exact versions; needs npm and the network.
three:
	sh three/bundle.sh mocapidx/reports/page/static/three.min.js

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
$(VENV)/.demo: $(BUILT_FROM) | $(BIN)/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e .
	$(BIN)/python -m compileall -q mocapidx cli
	touch $@

$(VENV)/.test: $(BUILT_FROM) | $(BIN)/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[test,examples,cluster]'
	$(BIN)/python -m compileall -q mocapidx cli
	touch $@ $(VENV)/.demo

$(VENV)/.fuzz: $(BUILT_FROM) | $(BIN)/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[test,fuzz]'
	$(BIN)/python -m compileall -q mocapidx cli
	touch $@ $(VENV)/.demo

$(VENV)/.bench: $(BUILT_FROM) | $(BIN)/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[bench]'
	$(BIN)/python -m compileall -q mocapidx cli
	touch $@ $(VENV)/.demo

$(VENV)/.docs: $(BUILT_FROM) | $(BIN)/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[docs]'
	touch $@ $(VENV)/.demo

clean:
	rm -rf $(WORK) $(VENV) .mypy_cache .ruff_cache .pytest_cache .hypothesis
