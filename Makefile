# `make demo` and `make test` set everything up on a fresh machine with Python 3.11 or newer.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed

.PHONY: demo bench-demo test test-long bench docs figures metrics freeze lint clean

$(STAMP): pyproject.toml constraints.txt
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[all,test]"
	touch $@

demo: $(STAMP)
	$(BIN)/inclinometry demo --output demo-output

# a bench in the browser: a ledger, a simulated instrument, one tool half-way through its calibration
bench-demo: $(STAMP)
	mkdir -p demo-output
	$(BIN)/inclinometry bench --demo --ledger demo-output/bench.sqlite

# what a change is held against while it is made: minutes; COVERAGE=1 measures that of the mathematics
MATHEMATICS := earth sensors* calibration gyro survey simulate arrays* rotations* orientation* wahba* channels* conventions* allan* uncertainty* least_squares*
comma := ,
empty :=
test: $(STAMP)
	$(BIN)/python -m pytest -n 2 -m "not long" $(if $(COVERAGE),--cov --cov-report=)
	$(if $(COVERAGE),$(BIN)/python -m coverage report --include="$(subst $(empty) $(empty),$(comma),$(MATHEMATICS:%=src/inclinometry/%/*))" --fail-under=95)

# the long statistics, whole runs and the browser
test-long: $(STAMP)
	$(BIN)/python -m pytest -n 2 -m long

bench: $(STAMP)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[all,test,bench]"
	$(BIN)/python -m benchmarks

lint: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

docs: $(STAMP)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[all,test,docs]"
	$(BIN)/python -m sphinx -W --keep-going -n -b html docs docs/_build/html
	$(BIN)/python docs/check_links.py docs/_build/html

# the computed numbers and tables of the pages, worked out anew: a few minutes; make docs works nothing out
figures: $(STAMP)
	$(BIN)/python docs/computed.py

# the project in figures: files, records, names, imports
metrics: $(STAMP)
	$(BIN)/python tools/metrics.py $(if $(WRITE),--write)

# what the program does today, to compare a change of the project with: make freeze TO=after AGAINST=before
TO ?= frozen
freeze: $(STAMP)
	$(BIN)/python tools/freeze.py $(TO) $(if $(AGAINST),--against $(AGAINST))

clean:
	rm -rf $(VENV) demo-output bench-output docs/_build docs/gallery .coverage
