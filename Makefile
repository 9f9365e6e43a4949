# Everything a newcomer types. It needs Python 3.11 or later, and make.
#
#   make tables    the thesis's tables and figures for three scenes: results/tables/index.html
#   make tables ARGS="--configfile my.yaml -- results/tables/" DIRECTORY=there    any run of Snakemake
#   make smoke     the same pipeline, tiny
#   make test      the whole test suite; make test DEVICE=pocl for one of several OpenCL drivers
#   make quick     the tests for daily work, in about a minute
#   make lint      formatting, layers, types and generated files
#   make format    formats the code
#   make fuzz SECONDS=600    hostile inputs for ten minutes: a table of what came of them
#   make docs      the manual as a site, read from disk: build/docs/html/index.html
#   make release   wheel and source package of the tag at HEAD, tried on each Python: build/release/dist
#   make clean     forgets results and build files; `rm -rf .venv` forgets the environment

SHELL := /bin/sh
PYTHON ?= $(shell for p in python3.11 python3.12 python3.13 python3; do \
	$$p -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && echo $$p && break; done)
VENV := .venv
BIN := $(VENV)/bin
CORES ?= 2
SECONDS ?= 60
DIRECTORY ?= .
ARGS ?= results/tables/
# One process runs a whole file; tests/conftest.py puts the costly files first.
XDIST := -n $(CORES) --dist loadfile --no-loadscope-reorder
PIP := $(BIN)/python -m pip --disable-pip-version-check --quiet

# A run of ours must not see packages of the user's home, nor of another checkout. Compiled modules are
# kept: without them, each process of the tests compiles all tests anew.
export PYTHONNOUSERSITE := 1
unexport PYTHONPATH PYTHONHOME PYTHONDONTWRITEBYTECODE
ifdef DEVICE
export LFCORE_DEVICE := $(DEVICE)
endif

.PHONY: tables smoke test quick lint format fuzz docs release clean
.DELETE_ON_ERROR:

# Snakemake in the folder $(1). Runs of a folder wait for one another. A killed one leaves Snakemake's lock, which is
# freed unless a process has a log of Snakemake open there. Without flock (macOS): `snakemake --unlock`, by hand.
define run
@mkdir -p $(1)/.snakemake && if command -v flock >/dev/null; then \
	flock -n $(1)/.snakemake/make.lock true || echo "Waiting for the run in $(1) to end."; \
	exec flock -F $(1)/.snakemake/make.lock sh -c 'if ls $(1)/.snakemake/locks/*.lock && \
	! ls -l /proc/[0-9]*/fd | grep -F "$$(cd $(1) && pwd -P)/.snakemake/log/"; then "$$0" --unlock "$$@"; fi \
	>/dev/null 2>&1; exec "$$0" "$$@"' $(SNAKEMAKE) --directory $(1) $(2); else exec $(SNAKEMAKE) --directory $(1) $(2); fi
endef
SNAKEMAKE = $(BIN)/snakemake --cores $(CORES) $(if $(wildcard $(VENV)/lib/*/*/snakemake_logger_plugin_rich),--logger rich)

tables: $(VENV)/installed
	$(call run,$(DIRECTORY),$(ARGS))

smoke: $(VENV)/installed
	$(call run,.,--configfile config/smoke.yaml -- results/tables/)

test: $(VENV)/installed-dev
	$(BIN)/python -m pytest $(XDIST)

quick: $(VENV)/installed-dev
	$(BIN)/python -m pytest $(XDIST) -m "not kernels and not workflow and not browser and not slow"

fuzz: $(VENV)/installed-dev
	$(BIN)/python -m robustness.fuzz --seconds $(SECONDS) --keep

lint: $(VENV)/installed-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/snakefmt --check Snakefile workflow
	$(BIN)/lint-imports
	$(BIN)/mypy
	$(BIN)/snakemake --lint
	$(BIN)/python -m lfcore.workflow.settings --check

# Pages are run at full size the first time, and where they changed; all after `make clean`.
docs: $(VENV)/installed-docs
	$(BIN)/python -m sphinx -W --keep-going --quiet -b html docs build/docs/html
	@echo "build/docs/html/index.html"

release:
	sh .ci/release.sh "$(PYTHON)"

format: $(VENV)/installed-dev
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .
	$(BIN)/snakefmt Snakefile workflow
	$(BIN)/python -m docs.site.reference

$(VENV)/bin/python:
	@test -n "$(PYTHON)" || { echo "Python 3.11 or later was not found. Install it, or run: make PYTHON=/path/to/python3.11"; exit 1; }
	$(PYTHON) -m venv $(VENV)

$(VENV)/installed: pyproject.toml constraints.txt | $(VENV)/bin/python
	@echo "Installing the pinned packages into $(VENV) ..."
	PIP_CONSTRAINT=constraints.txt $(PIP) install --editable '.[workflow]'
	@touch $@

$(VENV)/installed-dev: $(VENV)/installed
	@echo "Installing the test tools into $(VENV) ..."
	PIP_CONSTRAINT=constraints.txt $(PIP) install --editable '.[workflow,dev]'
	@touch $@

$(VENV)/installed-docs: $(VENV)/installed
	@echo "Installing what makes the manual into $(VENV) ..."
	PIP_CONSTRAINT=constraints.txt $(PIP) install --editable '.[workflow,docs]'
	@touch $@

clean:
	rm -rf results logs build .snakemake .pytest_cache .hypothesis .ruff_cache
