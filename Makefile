# cuspline: `make` sets up and builds every design, `make test` runs the whole suite, `make help` lists the rest.
#
# Set-up needs python3 (3.11 or later, with venv) and GNU make 3.81 or later, nothing else.
# One target a design: outputs/<design>/manifest.json, the last file that `cuspline build` puts in place.
# With PARAMS the outputs go to a folder of their own, outputs/<design>-<name>=<value>..., so the
# defaults are never overwritten; a value with spaces is quoted once more: PARAMS='table="my cells.csv"'.
# docs/decisions/make.md gives the reasons.

SHELL := /bin/sh
MAKEFLAGS += --no-builtin-rules
.SUFFIXES:
.DEFAULT_GOAL := all

PYTHON ?= python3
PARAMS ?=
ARGS ?=
BIN := .venv/bin
UV := $(BIN)/uv

DESIGNS := $(filter-out _%,$(patsubst designs/%.py,%,$(wildcard designs/*.py)))
SHARED := $(shell find $(wildcard designs/*/) designs/_*.py -type f ! -path '*/__pycache__/*' 2>/dev/null)
STAGES := $(shell find pipeline posts -type f \( -name '*.py' -o -name '*.toml' -o -name '*.json' \
            -o -name '*.js' -o -name '*.html' -o -name '*.css' \))
KERNELS := $(shell grep -rlE 'njit|numba' pipeline --include='*.py')

nothing :=
space := $(nothing) $(nothing)
# the text of PARAMS as it was given, and as one word of a shell's; a folder cannot be called by all of what may stand
# in it: other characters become _, and a checksum keeps two of them apart
export CUSPLINE_PARAMS := $(value PARAMS)
WORD := '$(subst ','\'',$(CUSPLINE_PARAMS))'
ODD := $(shell printf %s $(WORD) | LC_ALL=C tr -d 'A-Za-z0-9_.=+, -')
ODD_NAME = $(shell printf %s $(WORD) | LC_ALL=C tr -cs 'A-Za-z0-9_.=+,-' _ | cut -c1-60)
NAME = $(subst $(space),-,$(sort $(CUSPLINE_PARAMS)))
VARIANT := $(if $(strip $(CUSPLINE_PARAMS)),-$(if $(ODD),$(ODD_NAME)-$(firstword $(shell printf %s $(WORD) | cksum)),$(NAME)))
PUBLISHED := $(DESIGNS:%=outputs/%$(VARIANT)/manifest.json)
STEPS := $(DESIGNS:%=outputs/%$(VARIANT)-step/manifest.json)

ifneq ($(strip $(CUSPLINE_PARAMS)),)
ifeq ($(filter $(DESIGNS),$(MAKECMDGOALS)),)
$(error PARAMS belong to one design: make $(firstword $(DESIGNS)) PARAMS='name=value name="a value"')
endif
endif

.PHONY: all test lint help step diff doctor bench corpus site lock wheel clean distclean FORCE $(DESIGNS)
.PRECIOUS: $(PUBLISHED) $(STEPS)

all: $(PUBLISHED) ## set-up, then every design with default parameters into outputs/<design>/

$(DESIGNS): %: outputs/%$(VARIANT)/manifest.json

step: $(STEPS) ## only the STEP files, into outputs/<design>-step/

test: export PYTHONDONTWRITEBYTECODE =       # as set-up does: collecting the tests takes half as long
test: .venv/.kernels ## set-up, then the whole test suite; FAST=1 leaves out what takes long, ARGS="-k arcs" narrows it
	$(BIN)/python -m pytest -n auto --maxprocesses 4 --dist loadscope --no-loadscope-reorder $(if $(FAST),--fast) $(ARGS)

lint: .venv/.project ## ruff over everything, mypy over what users write: parts
	$(BIN)/ruff check .
	$(BIN)/mypy

diff: .venv/.project ## what differs from the outputs of another checkout, in Markdown: make diff BASE=../base
	@for p in $(DESIGNS); do $(BIN)/cuspline diff "$(BASE)/outputs/$$p" "outputs/$$p" --markdown || [ $$? = 1 ] || exit 2; done

doctor: .venv/.project ## check the environment for what breaks silently
	$(BIN)/cuspline doctor

bench: .venv/.kernels ## the measurements of bench/run.py
	@if [ -f bench/run.py ]; then $(BIN)/python bench/run.py $(ARGS); \
	 else echo "there is nothing to measure yet: bench/run.py is missing" >&2; exit 1; fi

corpus: .venv/.kernels ## parts that nothing was tuned for, each built once: bench/corpus.py; ARGS=failures those not verified again
	$(BIN)/python bench/corpus.py $(ARGS)

site: .venv/.project ## the documentation as pages for a browser into outputs/site/, with a gallery of what is built
	$(BIN)/python docs/site.py outputs/site

lock: .venv/.environment ## requirements.lock anew from pyproject.toml, known pins kept; ARGS=--upgrade takes newer ones
	cp requirements.lock requirements.lock.new
	$(UV) pip compile --quiet --universal --generate-hashes --no-emit-index-url --no-annotate --no-header \
	    --python-version 3.11 --group dev --extra build123d --extra mesh-quality $(ARGS) pyproject.toml -o requirements.lock.new
	@if grep -nE '://|^ *--[a-z-]*(index|links)' requirements.lock.new; then \
	    echo "requirements.lock.new names a host: not taken" >&2; exit 1; fi
	@if cmp -s requirements.lock.new requirements.lock; then rm requirements.lock.new; echo "requirements.lock stays as it is"; \
	 else mv requirements.lock.new requirements.lock; fi

wheel: .venv/.environment ## the package as dist/cuspline-<version>-py3-none-any.whl, for other environments
	@rm -rf build
	$(BIN)/python -c "from setuptools import build_meta; print('dist/' + build_meta.build_wheel('dist'))"

clean: ## remove outputs/ and the wheel
	rm -rf outputs build dist

distclean: clean ## remove the environment and the compiled kernels too
	rm -rf .venv .pytest_cache .hypothesis *.egg-info
	find pipeline posts designs tests -type d -name __pycache__ -prune -exec rm -rf {} +

help: ## this list
	@awk -F ':.*## ' '/^[a-z]+:.*## /{printf "  make %-22s %s\n", $$1, $$2}' Makefile
	@for d in $(DESIGNS); do printf '  make %-22s %s\n' $$d \
	    'one design; with PARAMS="name=value name=value" into a folder of its own'; done

# set-up ----------------------------------------------------------------------------------------
# .venv/.environment is written last and holds the folder it was made in: an environment that was
# interrupted, copied, moved or has lost its Python is made anew.

ifneq ($(shell [ -x $(BIN)/python ] && [ "$$(cat .venv/.environment 2>/dev/null)" = "$$(pwd -P)" ] && echo well),well)
.venv/.environment: FORCE
endif

.venv/.environment: requirements.lock
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
	    || { echo "cuspline needs Python 3.11 or later: make PYTHON=python3.12" >&2; exit 1; }
	@echo "set-up 1/4: a new environment in .venv"
	@rm -rf .venv
	@$(PYTHON) -m venv .venv \
	    || { rm -rf .venv; echo "$(PYTHON) lacks venv (Debian, Ubuntu: apt install python3-venv)" >&2; exit 1; }
	@awk '/^[^ #]/ {wanted = /^uv==/} wanted' requirements.lock > .venv/uv.txt
	@echo "set-up 2/4: packages of requirements.lock, every one checked against its hash"
	@if $(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --require-hashes -r .venv/uv.txt \
	    && $(UV) --version >/dev/null; then \
	    $(UV) pip sync --python $(BIN)/python --require-hashes requirements.lock; \
	 else \
	    echo "uv does not run here: installing with pip, which takes some minutes"; \
	    $(BIN)/python -m pip install --disable-pip-version-check --no-deps --require-hashes -r requirements.lock; \
	 fi
	@pwd -P > $@

.venv/.project: pyproject.toml .venv/.environment
	@echo "set-up 3/4: cuspline itself, editable"
	@if $(UV) --version >/dev/null 2>&1; then \
	    $(UV) pip install --quiet --python $(BIN)/python --no-deps --no-build-isolation --no-index -e .; \
	 else \
	    $(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --no-index -e .; \
	 fi
	@$(BIN)/cuspline doctor
	@touch $@

.venv/.kernels: $(KERNELS) .venv/.project
	@echo "set-up 4/4: compiled kernels"
	@$(BIN)/cuspline warm
	@touch $@

# designs ---------------------------------------------------------------------------------------
# outputs/.made/<folder>.json is a copy of the manifest that make saw made.  A folder whose manifest
# is another one (built by hand with other parameters, half deleted) is built again.  The copy is
# emptied when a build starts; the manifest gets that time, so an edit during a build counts.

FOREIGN := $(shell for d in $(DESIGNS:%='%$(VARIANT)') $(DESIGNS:%='%$(VARIANT)-step'); do \
             cmp -s "outputs/$$d/manifest.json" "outputs/.made/$$d.json" || echo "outputs/$$d/manifest.json"; done)
ifneq ($(FOREIGN),)
$(FOREIGN): FORCE
endif

define build
@mkdir -p outputs/.made
@: > 'outputs/.made/$(@:outputs/%/manifest.json=%).json'
$(BIN)/cuspline build $(1) --params "$$CUSPLINE_PARAMS" --out '$(@D)' $(2)
@touch -r 'outputs/.made/$(@:outputs/%/manifest.json=%).json' '$@'
@cp -p '$@' 'outputs/.made/$(@:outputs/%/manifest.json=%).json'
endef

$(PUBLISHED): outputs/%$(VARIANT)/manifest.json: designs/%.py $(SHARED) $(STAGES) requirements.lock | .venv/.kernels
	$(call build,$*,)

$(STEPS): outputs/%$(VARIANT)-step/manifest.json: designs/%.py $(SHARED) $(STAGES) requirements.lock | .venv/.project
	$(call build,$*,--stage step)

FORCE:
