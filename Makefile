# faultbond: every target works in a fresh clone; the first one sets up .venv.
SHELL := /bin/bash
PYTHON ?= python3
BIN := .venv/bin
RUNTIME := .venv/.runtime-installed
DEV := .venv/.dev-installed
SITE := .venv/.site-installed
# Tests wait for a tenth to a fifth of their time, so one more than there are processors keeps all of these at work.
WORKERS ?= $(shell echo $$(($$(nproc 2>/dev/null || echo 1) + 1)))
SEEDS ?= 100
HOURS ?= 16
MINUTES ?= 10
SEED ?= $(shell date +%s)
PYTHONS ?= $(BIN)/python
export PIP_DISABLE_PIP_VERSION_CHECK := 1

.DEFAULT_GOAL := help
.PHONY: help demo install compiler test quick lint golden docs site dist fuzz coverage thesis trust bench

help:
	@echo "make demo     find a fault in the built-in water tank and write report.html"
	@echo "make install  put faultbond into .venv; then: $(BIN)/faultbond --help"
	@echo "make test     run all tests"
	@echo "make quick    run the tests of files that took little the last time that all ran"
	@echo "make lint     check style, format and types"
	@echo "make golden   rewrite the files of expected results; read the difference before you commit it"
	@echo "make docs     renew the outputs shown in the pages and check the pages against the program"
	@echo "make site     build the pages and the reference of the Python names as a site, into build/site"
	@echo "make dist     build the packages into dist and try them in empty environments (minutes, and the network);"
	@echo "              PYTHONS='python3.12 python3.13' for other versions"
	@echo "make fuzz     samples, saved states and calls of the core drawn at random, under sanitizers (ten minutes for each of"
	@echo "              five plants, two at once; MINUTES=1 SEED=7 for others)"
	@echo "make coverage tell which lines and branches of the core whole runs and cases at random reach (gcc; minutes)"
	@echo "make thesis   compute the tables and figures of the thesis anew, into docs/thesis.md"
	@echo "make trust    measure anew how good it is, into docs/trust.md and docs/figures.md (some four hours;"
	@echo "              SEEDS=2 HOURS=1 for a try)"
	@echo "make bench    measure the speed anew, into docs/speed.md, and run the other benchmarks (two and a half hours)"

demo: compiler
	@$(BIN)/faultbond demo

install: compiler
	@echo "faultbond: installed. Try: $(BIN)/faultbond --help"

test: $(DEV) compiler
	@echo "faultbond: tests"
	@PYTHONDONTWRITEBYTECODE= $(BIN)/python -m pytest -n $(WORKERS)  # hundreds of programs would compile it all anew

quick: $(DEV) compiler
	@echo "faultbond: quick tests"
	@PYTHONDONTWRITEBYTECODE= $(BIN)/python -m pytest -n $(WORKERS) --quick

lint: $(DEV)
	@echo "faultbond: ruff check, ruff format, mypy"
	@$(BIN)/ruff check
	@$(BIN)/ruff format --check
	@$(BIN)/mypy

golden: $(DEV) compiler
	@echo "faultbond: rewriting tests/golden"
	@FAULTBOND_GOLDEN=rewrite $(BIN)/python -m pytest -q tests/golden tests/unit/core/test_save.py
	@git --no-pager diff --stat -- tests/golden src/faultbond/synthesis/templates/misra.txt

docs: $(DEV) compiler
	@echo "faultbond: renewing what commands print in the pages, then checking the pages"
	@$(BIN)/python tests/docs/insert.py
	@$(BIN)/python tests/docs/rooms.py
	@git --no-pager diff --stat -- README.md CONTRIBUTING.md docs
	@$(BIN)/python -m pytest -q tests/docs tests/test_docstrings.py

site: $(SITE)
	@echo "faultbond: the site, strictly: a broken link is an error"
	@$(BIN)/python -m sphinx -q -W --keep-going -E -b html -c docs/site . build/site
	@echo "faultbond: open build/site/index.html"

dist: $(DEV)
	@echo "faultbond: packages"
	@$(BIN)/python tests/packages/environments.py --python $(PYTHONS)

fuzz: $(DEV) compiler
	@echo "faultbond: cases at random, $(MINUTES) minutes for each plant, from seed $(SEED)"
	@FAULTBOND_FUZZ="$$((60 * $(MINUTES))) $(SEED)" $(BIN)/python -m pytest -q -n 2 tests/fuzz -k drawn_at_random

coverage: $(DEV) compiler
	@PYTHONPATH=.:tests/shared:tests/fuzz $(BIN)/python tests/fuzz/coverage.py

thesis: $(DEV) compiler
	@echo "faultbond: the thesis' tables and figures"
	@$(BIN)/python -m benchmarks.thesis
	@git --no-pager diff --stat -- docs/thesis.md docs/images/thesis

trust: $(DEV) compiler
	@$(BIN)/python -m pip install --quiet --group bench
	@set -e; page=docs/trust.md; measure() { echo "faultbond: $$1"; $(BIN)/python -m "benchmarks.$$@"; }; \
	  measure trust --seeds $(SEEDS) --first-seed 40000 --markdown $$page; \
	  measure trust.evidence --seeds $(SEEDS) --first-seed 700 --markdown $$page; \
	  measure trust.promise --hours $(HOURS) --first-seed 9000 --markdown $$page; \
	  if [[ -z "$${FAULTBOND_DATA:-}" ]]; then echo "faultbond: no recordings of real rigs: FAULTBOND_DATA is not set"; \
	  else for name in dts200 skab watersafe; do measure peers.$$name --markdown $$page; done; fi; \
	  page=docs/figures.md; \
	  measure trust.figures --seeds $(SEEDS) --first-seed 23000 --markdown $$page; \
	  measure trust.consistency --markdown $$page; \
	  measure peers.three_tank --seeds $(SEEDS) --first-seed 3000 --markdown $$page; \
	  measure peers.rivals --seeds $(SEEDS) --first-seed 1000 --markdown $$page
	@git --no-pager diff --stat -- docs

bench: $(DEV) compiler
	@echo "faultbond: benchmarks, two and a half hours in all"
	@$(BIN)/python -m pip install --quiet --group bench
	@echo "faultbond: speed (ten minutes)"
	@$(BIN)/python -m benchmarks.speed --markdown docs/speed.md
	@git --no-pager diff --stat -- docs/speed.md
	@$(BIN)/python -m benchmarks.speed.monitor
	@$(BIN)/python -m benchmarks.speed.large_bank
	@echo "faultbond: programs on all targets (a quarter of an hour)"
	@$(BIN)/python -m benchmarks.targets --markdown docs/embedding.md
	@git --no-pager diff --stat -- docs/embedding.md
	@echo "faultbond: the service (an hour and a half)"
	@$(BIN)/python -m benchmarks.service --markdown docs/service.md
	@$(BIN)/python -m benchmarks.service.store
	@echo "faultbond: figures (a quarter of an hour)"
	@$(BIN)/python -m benchmarks.trust.figures
	@echo "faultbond: equations, and the whole analysis"; $(BIN)/python -m benchmarks.speed.equations
	@echo "faultbond: structural diagnosis"; $(BIN)/python -m benchmarks.speed.structure
	@echo "faultbond: routes"; $(BIN)/python -m benchmarks.speed.routes
	@echo "faultbond: closed forms"; $(BIN)/python -m benchmarks.speed.closed_forms
	@echo "faultbond: smallest faults (a quarter of an hour)"; $(BIN)/python -m benchmarks.trust.smallest
	@if [[ -z "$${FAULTBOND_DATA:-}" ]]; then echo "faultbond: no recordings of real rigs: FAULTBOND_DATA is not set"; \
	  else set -e; for name in recordings dts200 skab watersafe; do \
	    echo "faultbond: $$name"; $(BIN)/python -m benchmarks.peers.$$name; done; fi

$(RUNTIME): pyproject.toml
	@echo "faultbond: setting up .venv (once) ..."
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
	  || { echo "faultbond: Python 3.11 or newer is needed; try: make PYTHON=python3.12" >&2; exit 1; }
	@$(PYTHON) -m venv .venv \
	  || { echo "faultbond: no virtual environment; on Debian or Ubuntu: apt install python3-venv" >&2; exit 1; }
	@$(BIN)/python -m pip install --quiet --editable .
	@touch $@

compiler: $(RUNTIME)
	@$(BIN)/python -c 'import sys; from faultbond.synthesis.compile import find_compiler; sys.exit(not find_compiler())' \
	  || { echo "faultbond: no C compiler found: installing ziglang as one ..."; \
	       $(BIN)/python -m pip install --quiet --editable '.[compiler]'; }

$(DEV): pyproject.toml $(RUNTIME)
	@echo "faultbond: adding the development tools (once) ..."
	@$(BIN)/python -m pip install --quiet --upgrade "pip>=25.1"
	@$(BIN)/python -m pip install --quiet --group dev
	@touch $@

$(SITE): pyproject.toml $(DEV)
	@echo "faultbond: adding what builds the site (once) ..."
	@$(BIN)/python -m pip install --quiet --group docs
	@touch $@
