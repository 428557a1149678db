# Targets: setup demo test slow fuzz bench lint docs wheels core revalidate revalidate-changed clean.
# Variables: PYTHON (3.11 or newer), VENV (folder of the installation), OUT (folder of the demo),
# CORE (folder of `make core`). OUT and CORE may contain any character except a line break.
# `make fuzz` has FUZZ_SECONDS (how long it runs), FUZZ_SEED (random seed) and PROPERTY_SECONDS (how
# long the property tests are repeated with new examples).

PYTHON ?= python3
VENV ?= .venv
OUT ?= demo-out
CORE ?= campaigns/core
SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -c
.DELETE_ON_ERROR:
.PHONY: setup engine browser demo test slow fuzz bench lint docs wheels core clean
.PHONY: revalidate revalidate-changed

# The shell reads OUT and CORE from its environment; make does not expand them, so $ and spaces are kept.
override OUT := $(value OUT)
override CORE := $(value CORE)
export OUT CORE

BIN := $(VENV)/bin
INSTALLED := $(VENV)/.installed
RUFF_FOLDERS := granbench generators baselines leaderboard tests benchmarks docs
# The networks are small: one thread is faster than two that wait for each other.
export OMP_NUM_THREADS ?= 1
# Scripts that draw must not use the backend set in the shell, as in a notebook.
export MPLBACKEND := agg

setup: engine $(INSTALLED)

$(INSTALLED): pyproject.toml requirements/constraints.txt
	@.ci/system-packages python
	@$(PYTHON) -c 'import sys; sys.version_info >= (3, 11) or sys.exit( \
	    "GranBench needs Python 3.11 or newer: run `make setup PYTHON=python3.11`")'
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	@echo "installing GranBench into $(VENV); the first time takes some minutes"
	@$(BIN)/python -m pip install --quiet --quiet --disable-pip-version-check \
	    --constraint requirements/constraints.txt --editable '.[generate,dev]'
	@touch $@

engine:
	@.ci/system-packages engine

browser:
	@.ci/system-packages browser

demo: setup
	@PATH="$(abspath $(BIN)):$$PATH" bash docs/examples/demo.sh "$$OUT"

# Two processes, each with whole test files, so that module fixtures are set up once.
test: setup browser
	$(BIN)/python -m pytest --numprocesses 2 --dist loadfile

slow: setup browser
	$(BIN)/python -m pytest -m slow

# Tests input files of every kind, changed at random (`make test` does this for a minute), then runs
# the property tests with new examples instead of the fixed ones, until PROPERTY_SECONDS have passed.
FUZZ_SECONDS ?= 3600
FUZZ_SEED ?= 0
PROPERTY_SECONDS ?= 600
fuzz: setup
	$(BIN)/python tests/fuzz/run.py --seconds $(FUZZ_SECONDS) --seed $(FUZZ_SEED)
	@end=$$((SECONDS + $(PROPERTY_SECONDS))); while :; do \
	    $(BIN)/python -m pytest --numprocesses 2 -m 'hypothesis and not slow' \
	        --hypothesis-profile fresh; \
	    [ "$$SECONDS" -lt "$$end" ] || break; done

bench: setup
	@for script in benchmarks/*.py; do $(BIN)/python $$script; done

# mypy cannot follow the folder mapping of an editable install: it reads the unpacked wheel. The
# egg-info of the build would hide entry points that are added later.
lint: setup
	$(BIN)/ruff check $(RUFF_FOLDERS)
	$(BIN)/ruff format --check $(RUFF_FOLDERS)
	@rm -rf build && $(BIN)/python -m build --wheel --no-isolation --outdir build/wheel . >/dev/null
	@rm -rf granbench.egg-info
	@$(BIN)/python -m zipfile --extract build/wheel/*.whl build/unpacked
	MYPYPATH=build/unpacked $(BIN)/mypy -p granbench

# Scores or runs every row of the leaderboard again, which takes hours; run it again to continue.
revalidate: setup
	$(BIN)/granbench leaderboard revalidate --state campaigns/revalidated.json

# Checks only the rows that the branch has changed since main or, on main, the last commit has changed.
revalidate-changed: setup
	$(BIN)/granbench leaderboard revalidate --changed

docs: setup
	@for file in datasets/*.nc; do $(BIN)/python -m granbench.data.card "$$file" --out docs/datasets; done
	@$(BIN)/python docs/scores_page.py
	@$(BIN)/python docs/random_paths_page.py
	@$(BIN)/python docs/model_pages.py
	@$(BIN)/python docs/scoring_page.py
	@$(BIN)/python docs/fem_page.py
	@$(BIN)/python docs/first_page_picture.py
	@$(BIN)/python docs/docs_index.py

# Builds both wheels into dist: the package, and its reference datasets as `granbench-data`. Each is
# built from a copy, so that it contains no old build folder and leaves none in datasets/.
wheels: setup
	@rm -rf build/source dist
	@mkdir -p build/source/data
	@cp -RL granbench generators baselines leaderboard pyproject.toml README.md LICENSE LICENSE-DATA \
	    build/source
	@cp -RL datasets/. build/source/data
	@for source in build/source build/source/data; do \
	    $(BIN)/python -m build --wheel --no-isolation --outdir dist $$source \
	        >build/wheels.log 2>&1 || { tail -n 20 build/wheels.log; exit 1; }; done
	@ls -lh dist

# Generates the core dataset again: about two hours on two cores. Run it again after an
# interruption to continue.
core: setup
	$(BIN)/granbench generate dem-triaxial --preset core --workers 2 --out "$$CORE"

clean:
	rm -rf build dist $(VENV) "$$OUT"
