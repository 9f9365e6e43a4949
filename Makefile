# Everything a newcomer types. Python 3.11 or later and make are all that must be there.
#
#   make tables    the thesis's tables and figures for three scenes: results/tables/index.html
#   make test      the whole test suite; the viewer's part wants browsers (CONTRIBUTING.md)
#   make test DEVICE=pocl      on one of several OpenCL drivers; SUPPORT=yes: keep a row of the table in docs/robustness.md
#   make quick     the tests for daily work, in under a minute: no Snakemake, no browser, few kernels
#   make fuzz SECONDS=600    hostile inputs for ten minutes: a table of what came of them
#   make faults KILLS=100      kills, full disks, missing folders: the same results afterwards
#   make cluster   the smoke pipeline on a throw-away SLURM, once with jobs cancelled
#   make cluster FAULTS=all    nodes that die or are full: docs/robustness.md
#   make s3        the pipeline with its results in object storage, killed in between
#   make bare      the smoke pipeline in a bare Debian: python3, python3-venv and make
#   make bare SUITE=trixie STEPS="wheel quick"    other targets, in another Debian (.ci/bare.sh)
#   make smoke     the same pipeline, tiny: what continuous integration runs
#   make lint      formatting, layers and types
#   make count     how much there is to read in the tracer's kernels
#   make docs      the manual as a site, read from disk: build/docs/html/index.html
#   make wheel     the wheel, installed and tried in an empty environment
#   make release   wheel and source package of the tag at HEAD, tried on each Python: build/release/dist
#   make digests   the table of bits that every processor is held to: after a change that means to change bits
#   make micro     every rule, script and caption, as small as they go, and Snakemake's report: build/micro
#   make run ARGS="--configfile my.yaml -- results/tables/" DIRECTORY=there    any other run of Snakemake
#   make sweep SWEEP=config/sweeps/crf.tsv    a light field for each row: one table, one figure
#   make settings  what is made from the configuration's keys: schema, defaults, table
#   make clean     forget results; make distclean forgets the environment, too

SHELL := /bin/sh
PYTHON ?= $(shell for p in python3.11 python3.12 python3.13 python3; do \
	$$p -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && echo $$p && break; done)
VENV := .venv
BIN := $(VENV)/bin
CORES ?= 2
SECONDS ?= 60
KILLS ?= 20
DIRECTORY ?= .
# One process runs a whole file; tests/conftest.py puts the costly files first.
XDIST := -n $(CORES) --dist loadfile --no-loadscope-reorder
MICRO := --configfile config/micro.yaml -- results/tables/ results/assignment/
PIP := $(BIN)/python -m pip --disable-pip-version-check --quiet

# A run of ours must not see packages of the user's home, nor of another checkout.
export PYTHONNOUSERSITE := 1
unexport PYTHONPATH PYTHONHOME
ifdef DEVICE
export LFCORE_DEVICE := $(DEVICE)
endif

.PHONY: tables run test quick fuzz faults smoke cluster s3 bare micro sweep settings count lint docs \
	wheel release format digests clean distclean pins
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
	$(call run,.,results/tables/)

smoke: $(VENV)/installed
	$(call run,.,--configfile config/smoke.yaml -- results/tables/)

micro: $(VENV)/installed
	$(call run,build/micro,$(MICRO))
	$(BIN)/snakemake --report report.zip --directory build/micro $(MICRO)

run: $(VENV)/installed
	$(call run,$(DIRECTORY),$(ARGS))

sweep: $(VENV)/installed
	$(call run,.,--config sweep=$(SWEEP) -- sweep)

test: $(VENV)/installed-dev
	$(BIN)/python -m pytest $(XDIST)

quick: $(VENV)/installed-dev
	$(BIN)/python -m pytest $(XDIST) -m "not kernels and not workflow and not browser and not slow"

fuzz: $(VENV)/installed-dev
	$(BIN)/python -m robustness.fuzz --seconds $(SECONDS) --keep

faults: $(VENV)/installed-dev
	$(BIN)/python -m robustness.faults --kills $(KILLS)

cluster: $(VENV)/installed-dev
	$(BIN)/python -m robustness.cluster $(if $(FAULTS),--faults $(FAULTS)) $(if $(PUBLISH),--publish)

s3: $(VENV)/installed-dev
	$(BIN)/python -m robustness.object_storage

bare:
	sh .ci/bare.sh

count: $(VENV)/installed-dev
	$(BIN)/python benchmarks/count_kernels.py

lint: $(VENV)/installed-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/snakefmt --check Snakefile workflow
	$(BIN)/lint-imports
	$(BIN)/python -m benchmarks.publish --check
	$(BIN)/mypy
	$(BIN)/snakemake --lint
	$(BIN)/python -m lfcore.workflow.settings --check
	$(BIN)/python -m workflow.pins --check

# Pages are run at full size the first time, and where they or the library changed.
docs: $(VENV)/installed-docs
	$(BIN)/python -m sphinx -W --keep-going --quiet -b html docs build/docs/html
	@echo "build/docs/html/index.html"

# The wheel, in an empty environment of its own, without what the workflow needs.
wheel: | $(VENV)/bin/python
	rm -rf build/wheel && mkdir -p build/wheel
	$(PIP) wheel --no-deps --wheel-dir build/wheel .
	$(PYTHON) -m venv build/wheel/venv
	PIP_CONSTRAINT= build/wheel/venv/bin/python -m pip --quiet --disable-pip-version-check install build/wheel/*.whl
	cd build/wheel && venv/bin/python $(CURDIR)/.ci/try_wheel.py

release:
	sh .ci/release.sh "$(PYTHON)"

format: $(VENV)/installed-dev
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .
	$(BIN)/snakefmt Snakefile workflow

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

digests: $(VENV)/installed-dev
	PYTHONPATH=tests $(BIN)/python tests/tracing/digests.py --write

# Files that are made from the configuration's keys: run it after an edit of lfcore/workflow/keys.py or studies.py.
settings: $(VENV)/installed
	$(BIN)/python -m lfcore.workflow.settings

# Pins of what is installed now: run it after a package was added to pyproject.toml.
pins: $(VENV)/installed-dev
	$(BIN)/python -m workflow.pins

clean:
	rm -rf results logs build .snakemake .pytest_cache .hypothesis .ruff_cache

distclean: clean
	rm -rf $(VENV)
