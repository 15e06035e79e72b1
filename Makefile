# What a new user types. Needs Python 3.11 or newer and make, nothing else.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
CLASSIFIERS := knn1,knn3,svm-linear,svm-rbf,forest,net-hsmm
INSTALLED := $(VENV)/.installed
TESTING := $(VENV)/.testing
DOCUMENTING := $(VENV)/.documenting

.PHONY: help demo test test-fast check docs bench example-report clean

help:
	@echo "make demo   install signface in $(VENV) and annotate the takes that ship with it"
	@echo "make test   install what the tests need, then check the code and run them all"
	@echo "make test-fast  the same without the slow tests"
	@echo "make docs   build the documentation site in docs/_build/html"
	@echo "make bench  measure the solver against its rivals (a few minutes)"

$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "signface needs Python 3.11 or newer; name one with: make PYTHON=python3.12 ..."; exit 2; }
	$(PYTHON) -m venv $(VENV)

$(INSTALLED): pyproject.toml | $(BIN)/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e .
	@touch $@

$(TESTING): pyproject.toml | $(BIN)/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e ".[test]"
	@touch $@ $(INSTALLED)

$(DOCUMENTING): pyproject.toml | $(BIN)/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e ".[docs]"
	@touch $@

demo: $(INSTALLED)
	$(BIN)/signface demo -o demo-output

check: $(TESTING)
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/codespell

test: check
	$(BIN)/python -m pytest -n auto

test-fast: $(TESTING)
	$(BIN)/python -m pytest -n auto -m "not slow"

docs: $(DOCUMENTING)
	MPLBACKEND=Agg $(BIN)/python -m sphinx -q -W --keep-going -j auto docs docs/_build/html
	@echo "open docs/_build/html/index.html"

example-report: $(INSTALLED)
	test -d corpora/example || $(BIN)/signface synth corpora/example --signers 3 --seed 20261122
	$(BIN)/signface evaluate corpora/example -o reports/example --classifiers $(CLASSIFIERS)

bench: $(TESTING)
	$(BIN)/python -m benchmarks.solver

clean:
	rm -rf $(VENV) demo-output build dist docs/_build docs/api docs/gallery .pytest_cache .mypy_cache .ruff_cache .hypothesis
