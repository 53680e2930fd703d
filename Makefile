# make demo    train a small trimodal model on the embedded corpus; ends with a table and a page to open
# make test    the fast tests
# make docs    the site: outputs/site/index.html
# make check   what CI runs: fast tests, lint, types, layers, the site, slow tests
#
# Each starts from a clone with nothing but Python 3.11+ and make. PIP_ARGS is passed to every pip
# call (a mirror, an index with another build of torch, ...).

PYTHON ?= python3
VENV ?= .venv
PIP_ARGS ?=
EXTRAS ?= dev
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip install --disable-pip-version-check $(PIP_ARGS) -c constraints.txt

.PHONY: help demo test slow lint docs check clean

help:
	@sed -n 's/^# \(make .*\)/\1/p' Makefile

$(BIN)/python:
	$(PYTHON) -c 'import sys; assert (3, 11) <= sys.version_info[:2] < (3, 14), "Cospeech needs Python 3.11 to 3.13; make PYTHON=python3.11 ..."'
	$(PYTHON) -m venv $(VENV)

# torch first and alone: what comes after finds the pinned release in place.
$(VENV)/.torch: constraints.txt | $(BIN)/python
	$(PIP) torch
	@touch $@

$(VENV)/.demo: pyproject.toml constraints.txt | $(VENV)/.torch
	$(PIP) -e '.[demo]'
	@touch $@

comma := ,
DEV := $(VENV)/.dev-$(subst $(comma),-,$(EXTRAS))

$(DEV): pyproject.toml constraints.txt | $(VENV)/.torch
	$(PIP) -e '.[$(EXTRAS)]'
	@touch $@ $(VENV)/.demo

$(VENV)/.docs: pyproject.toml constraints.txt | $(VENV)/.torch
	$(PIP) -e '.[docs]'
	@touch $@

demo: $(VENV)/.demo
	$(BIN)/python train.py model=trimodal experiment=trimodal_quick

test: $(DEV)
	$(BIN)/python -m pytest -m "not slow" -n 2 --dist loadgroup -q

slow: $(DEV)
	$(BIN)/python -m pytest -m slow -n 2 --dist loadscope -q

lint: $(DEV)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

docs: $(VENV)/.docs
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict

check: test lint docs slow

clean:
	rm -rf $(VENV)
