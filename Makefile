# `make demo` and `make test` set everything up on a fresh machine with Python 3.11 or newer.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
# keys and witnesses of the ledgers made here: not among those of who runs this
export INCLINOMETRY_KEYS ?= $(CURDIR)/demo-output/keys

.PHONY: demo bench-demo test test-long bench bench-fleet bench-honest docs figures metrics freeze mutants fuzz lint clean

$(STAMP): pyproject.toml constraints.txt
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[all,test]"
	touch $@

# after the demo's pages: runs of ten tools, one of which is calibrated again; exactly its file is made anew
FLEET := demo-output/ten-tools
demo: $(STAMP)
	$(BIN)/inclinometry demo --output demo-output
	rm -rf $(FLEET)
	$(BIN)/inclinometry simulate fleet --jumps 1 --runs 1 --seed 1 -o $(FLEET)
	$(BIN)/inclinometry fleet add $(FLEET)/runs --pattern "{tool}_{run}_{date}" --fleet $(FLEET)/fleet
	$(BIN)/inclinometry fleet run --fleet $(FLEET)/fleet --ledger $(FLEET)/lab.sqlite
	$(BIN)/inclinometry simulate bench --tool $(FLEET)/truth/SIM-0001.json --plan twelve --rig-sd-deg 0.1 --bits 16 --seed 3 -o $(FLEET)/again.csv
	$(BIN)/inclinometry ledger enter $(FLEET)/again.csv --serial SIM-0001 --performed 2024-02-01 --rig "rig 1" --certify --laboratory $(FLEET)/lab.toml --ledger $(FLEET)/lab.sqlite
	$(BIN)/inclinometry fleet plan --fleet $(FLEET)/fleet --ledger $(FLEET)/lab.sqlite
	$(BIN)/inclinometry fleet run --fleet $(FLEET)/fleet --ledger $(FLEET)/lab.sqlite

# a bench in the browser: a ledger, a simulated instrument, one tool half-way through its calibration
bench-demo: $(STAMP)
	mkdir -p demo-output
	$(BIN)/inclinometry bench --demo --ledger demo-output/bench.sqlite

# what a change is held against while it is made: minutes; COVERAGE=1 holds that of the mathematics, a fifth slower
MATHEMATICS := earth sensors calibration gyro survey simulate arrays rotations orientation wahba channels conventions allan uncertainty least_squares
test: $(STAMP)
	$(BIN)/python -m pytest -n 2 --dist worksteal -m "not long" $(if $(COVERAGE),$(MATHEMATICS:%=--cov=inclinometry.%) --cov-report=)
	$(if $(COVERAGE),$(BIN)/python -m coverage report --fail-under=95)

# the long statistics, whole runs and the browser
test-long: $(STAMP)
	$(BIN)/python -m pytest -n 2 --dist worksteal -m long

bench: $(STAMP)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[all,test,bench]"
	$(BIN)/python -m benchmarks

# a fleet: throughput beside other engines, many files, flipped bits, kills; ROUNDS=100 takes an hour
ROUNDS ?= 3
bench-fleet: $(STAMP)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[all,test,bench]"
	$(BIN)/python -m benchmarks.fleet --rounds $(ROUNDS)

# stated uncertainty where the model breaks, by simulators of their own: an hour
bench-honest: $(STAMP)
	for part in bench motion drilling survey certificate gyro; do $(BIN)/python -m benchmarks.honest_$$part || exit 1; done

lint: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

# the manual, and its copy in the package, which `inclinometry manual` opens, the bench serves and a wheel takes along
MANUAL := src/inclinometry/manual
docs: $(STAMP)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[all,test,docs]"
	$(BIN)/python -m sphinx -W --keep-going -n -j 2 -b html docs docs/_build/html
	$(BIN)/python docs/check_links.py docs/_build/html
	rm -rf $(MANUAL)
	cp -r docs/_build/html $(MANUAL)
	rm -rf $(MANUAL)/_sources $(MANUAL)/_downloads $(MANUAL)/.buildinfo $(MANUAL)/.doctrees

# the computed numbers, tables, outputs and pictures of the pages, worked out anew; make docs works nothing out
figures: $(STAMP)
	$(BIN)/python docs/computed.py
	$(BIN)/python docs/computed.py shown

# the project in figures: files, records, names, imports
metrics: $(STAMP)
	$(BIN)/python tools/metrics.py $(if $(WRITE),--write)

# what the program does today, to compare a change of the project with: make freeze TO=after AGAINST=before
TO ?= frozen
freeze: $(STAMP)
	$(BIN)/python tools/freeze.py $(TO) $(if $(AGAINST),--against $(AGAINST))

# do the tests bite: COUNT changes of the code, one at a time, and the tests of their room; ROOMS="guard gyro", all without
COUNT ?= 400
mutants: $(STAMP)
	$(BIN)/python tools/mutants.py $(ROOMS) --count $(COUNT)

# COUNT broken files of every format, for every command: no internal error, nothing beyond 10 s and 1 GB
fuzz: COUNT = 100000
fuzz: $(STAMP)
	$(BIN)/python -m benchmarks.fuzz --count $(COUNT) --keep tests/fuzz/kept

clean:
	rm -rf $(VENV) demo-output bench-output docs/_build docs/gallery $(MANUAL) .coverage
