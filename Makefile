# Everything runs in .venv, and what lasts stays in this folder: compiled code and the list of fonts
# go to .cache. Only pip keeps its downloads where it always does, for the next clone.
#   make demo    install, the page of the published records, then training for 3 to 10 minutes
#   make test    install with the test extras, run the whole suite
#   make lint    ruff and mypy
#   make docs    the site and the man pages, in build/; a warning is an error
#   make faults  everything that must survive kills, full disks, damage and other people's files, an
#                hour on two cores (a tenth of it: make faults FAULTS=0.1)
#   make fuzz    every reader of other people's files, a minute each (fewer: make fuzz SECONDS=10)
#   make audit   known vulnerabilities and suspicious code, as far as that works without a network
#   make bench   env steps per second, ours and the straightforward implementation's; the floor
#   make readme  the numbers in README.md, PAPER.md, results and docs again, from the records
#   make clean   remove caches and builds      make distclean   remove .venv, too
# A Python of your choice:  make demo PYTHON=/path/to/python3.12

SHELL := /bin/sh
PYTHON ?=
FAULTS ?= 1
SECONDS ?= 60
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check
SETUP := pyproject.toml constraints.txt
INSIDE := XDG_CACHE_HOME="$(CURDIR)/.cache" MPLCONFIGDIR="$(CURDIR)/.cache/matplotlib"

.PHONY: demo test lint docs faults fuzz audit bench readme clean distclean
.NOTPARALLEL:
.DELETE_ON_ERROR:

demo: $(VENV)/demo.stamp
	$(INSIDE) $(BIN)/msgdrop reproduce
	$(INSIDE) $(BIN)/msgdrop ablate ablations/demo.toml

test: $(VENV)/test.stamp
	$(INSIDE) $(BIN)/python -m pytest -n 2 --dist loadfile

lint: $(VENV)/lint.stamp
	$(BIN)/ruff format --check
	$(BIN)/ruff check
	$(BIN)/mypy

# mkdocs is not told to be --quiet: it counts no warnings then.
docs: $(VENV)/docs.stamp
	$(INSIDE) $(BIN)/python -m docs.build
	$(INSIDE) $(BIN)/mkdocs build --strict --clean --config-file build/mkdocs.yml
	$(INSIDE) $(BIN)/python -m docs.manual build/man
	@echo "build/site/docs/index.html; man -l build/man/msgdrop.1"

faults: $(VENV)/test.stamp
	$(INSIDE) OMP_NUM_THREADS=1 FAULTS=$(FAULTS) $(BIN)/python -m tests.faults
	$(INSIDE) MSGDROP_MACHINES=1 $(BIN)/python -m pytest --quiet tests/test_cluster_machines.py

fuzz: $(VENV)/fuzz.stamp
	$(INSIDE) OMP_NUM_THREADS=1 $(BIN)/python -m tests.fuzz --seconds $(SECONDS)

# pip-audit asks a service on the network; what it says there, or that nobody answers, is shown and
# is no failure of the target (the dash).
audit: $(VENV)/audit.stamp
	$(BIN)/bandit --configfile pyproject.toml --quiet --recursive msgdrop_cli envs ablations
	-$(BIN)/pip-audit --skip-editable --progress-spinner off

bench: $(VENV)/demo.stamp
	$(INSIDE) OMP_NUM_THREADS=1 $(BIN)/python -m benchmarks.throughput
	$(INSIDE) OMP_NUM_THREADS=1 $(BIN)/python -m benchmarks.roofline
	$(INSIDE) OMP_NUM_THREADS=1 $(BIN)/python -m benchmarks.workers

readme: $(VENV)/demo.stamp
	$(INSIDE) $(BIN)/python -m benchmarks.readme

clean:
	rm -rf build dist .cache .mypy_cache .pytest_cache .ruff_cache
	find msgdrop_cli envs ablations benchmarks tests docs -name __pycache__ -prune -exec rm -rf {} +

distclean: clean
	rm -rf $(VENV)

# One stamp a use, so that the demo installs no test tools. A changed pyproject or constraints
# installs again; anything else does not.
$(VENV)/demo.stamp: $(VENV)/torch.stamp $(SETUP)
	$(PIP) install --quiet -c constraints.txt -e .
	@touch $@

$(VENV)/test.stamp: $(VENV)/torch.stamp $(SETUP)
	$(PIP) install --quiet -c constraints.txt -e '.[test]'
	@touch $@

$(VENV)/lint.stamp: $(VENV)/torch.stamp $(SETUP)
	$(PIP) install --quiet -c constraints.txt -e '.[test,lint]'
	@touch $@

# Where there is no wheel of atheris (other machines, newer Pythons), bytes are changed blindly.
$(VENV)/fuzz.stamp: $(VENV)/test.stamp
	-$(PIP) install --quiet -c constraints.txt -e '.[fuzz]'
	@touch $@

$(VENV)/docs.stamp: $(VENV)/torch.stamp $(SETUP)
	$(PIP) install --quiet -c constraints.txt -e '.[docs]'
	@touch $@

$(VENV)/audit.stamp: $(VENV)/torch.stamp $(SETUP)
	$(PIP) install --quiet -c constraints.txt -e '.[audit]'
	@touch $@

# torch alone and first, pinned: if the resolver may look around for it, it fetches several builds
# of many hundred megabytes. Not --quiet: the progress of a long download should be seen.
$(VENV)/torch.stamp: $(VENV)/venv.stamp constraints.txt
	$(PIP) install -c constraints.txt torch
	@touch $@

# A command may exist and still not run (a version manager's shim), so each candidate is tried.
$(VENV)/venv.stamp:
	@for python in $(or $(PYTHON),python3.11 python3.12 python3.13 python3); do \
	    "$$python" -c 'import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 14))' \
	        2>/dev/null || continue; \
	    "$$python" -c 'import ensurepip, venv' 2>/dev/null || { missing=$$python; continue; }; \
	    echo "$$python -m venv $(VENV)"; \
	    "$$python" -m venv $(VENV) && touch $@; exit; \
	done; \
	if [ -n "$$missing" ]; then \
	    echo "make: $$missing has no venv module: install it (Debian, Ubuntu: python3-venv)"; \
	else \
	    echo "make: needs Python 3.11, 3.12 or 3.13: install one, or make PYTHON=/path/to/python"; \
	fi >&2; exit 1
