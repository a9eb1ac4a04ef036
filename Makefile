# Each target sets up .venv by itself and does nothing where nothing changed. PYTHON picks the interpreter (3.11 or newer).
PYTHON ?= python3
BIN := .venv/bin
SOURCES := $(shell git ls-files --cached --others --exclude-standard '*.py' '*.toml' '*.urdf' '*.csv' '*.json' '*.c' '*.h' 'fmu/c/*.txt' 2>/dev/null | grep -v -e '^tests/' -e '^bench/' -e '^proof/')
# The longest first, so that two at a time end together.
STUDIES := zero-g-rig cart orbit-inspection orbit-hover orbit-abort kuka free-floating tx40 ground-capture bam emps tolerance

# Where processes share the cores, threads of a linear algebra library wait for each other, and burn the time they wait.
ONE_THREAD := OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1

# Hundreds of processes are started: what an interpreter compiles, it keeps, whatever the environment says.
unexport PYTHONDONTWRITEBYTECODE

BENCHES := torque friction_fit diagnosis joints fast floating cosim fmu snare ecos_inspection tolerance formulas

.PHONY: help demo test test-slow check fix hooks studies bench accuracy fuzz kills first-hour hostile mutants proof ledger fmus docs clean $(STUDIES:%=study-%)

help:            ## what can be made
	@sed -n -e 's/^\$$(filter-out.*## /  make study-NAME\t/p' -e 's/^\([a-z-]*\):.*## /  make \1\t/p' $(firstword $(MAKEFILE_LIST)) | expand -t 24

demo: study-emps ## set up the core alone, then the main job: name the physics that a viscous model of EMPS leaves out

study-emps: .venv/core
	$(ONE_THREAD) $(BIN)/python -m snarelab.studies.emps

$(filter-out study-emps,$(STUDIES:%=study-%)): study-%: .venv/installed ## run one study: report and numbers in build/studies/NAME
	$(ONE_THREAD) $(BIN)/python -m snarelab.studies.$(subst -,_,$*)

studies: $(filter-out study-tolerance,$(STUDIES:%=study-%)) ## every study but the tolerances, one after the other: three quarters of an hour; CI runs them

test: .venv/installed ## set up, then the tests
	$(ONE_THREAD) $(BIN)/python -m pytest -n 2 --dist worksteal

test-slow: .venv/installed ## the tests of whole studies and captures, which `make test` leaves out: three quarters of an hour; PART=2: every second file
	$(ONE_THREAD) $(BIN)/python -m pytest -n 2 --dist loadfile -m slow $(if $(PART),--part $(PART))

check: .venv/installed ## formatting, lint, words and types
	$(BIN)/ruff check . && $(BIN)/ruff format --check . && $(BIN)/python docs/check_words.py && $(BIN)/pyright --pythonpath $(BIN)/python

fix: .venv/installed ## formatting, and the lint that mends itself
	$(BIN)/ruff check --fix --quiet . ; $(BIN)/ruff format .

hooks:           ## let git run `make check` before every commit of this clone
	git config core.hooksPath .githooks

bench: .venv/installed ## ratios against named rivals, measured in one run
	@set -e; for name in $(BENCHES); do \
	    echo; echo "bench/$$name.py"; $(ONE_THREAD) $(BIN)/python bench/$$name.py; done

accuracy: .venv/installed ## the snare on 30 random captures, and against rods in another engine on 10: half an hour
	$(BIN)/python bench/snare_accuracy.py --result build/bench/snare_accuracy.json
	OMP_NUM_THREADS=1 $(BIN)/python bench/snare.py --cases 10

SECONDS ?= 60
fuzz: .venv/installed ## broken files at every reader, SECONDS for each
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt '.[fuzz]'
	$(BIN)/python tests/fuzz --seconds $(SECONDS)

kills: .venv/installed ## runs, importers of FMUs and `snarelab cosim`, two hundred each, killed at random: nothing lost that was reported, nothing left; resumed
	$(BIN)/python bench/kills.py
	$(BIN)/python bench/importer_kills.py c python
	$(BIN)/python bench/importer_kills.py cosim

IMAGES ?= docker.io/library/python:3.11-slim docker.io/library/python:3.13-slim
first-hour: .venv/installed ## from the wheel to a verdict in bare containers of IMAGES, and `make demo` twice, timed and weighed
	$(BIN)/python bench/first_hour.py $(IMAGES:%=--image %) --demo

hostile: .venv/installed ## forty FMUs that crash, hang, fork and lie: each ends in one line
	$(BIN)/python bench/hostile_fmus.py

MUTANTS ?= 40
mutants: .venv/installed ## halve and double what decides, change identification, cosim and models at random places, and count how often a test notices; branch coverage; numbers in build/mutants/result.json
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt '.[mutants]'
	$(BIN)/python bench/moved_constants.py
	$(BIN)/python bench/mutants.py --mutants $(MUTANTS)

proof: .venv/installed ## conceal effects in another engine's recordings, let the tool name them, and score it: half an hour; HOURS=H: what is registered, for so long, resumed
	$(BIN)/python -m proof $(if $(HOURS),registered --hours $(HOURS))

ledger: .venv/installed ## what the tool says of every recording that must not get worse, into bench/ledger.json: half an hour, resumed; OLD=FILE tells what moved
	$(BIN)/python bench/ledger.py $(if $(OLD),--compare $(OLD))

fmus: .venv/installed ## the shipped FMUs and a page on each, into build/fmus
	$(BIN)/python -m snarelab.fmu.shipped

docs: .venv/installed ## the pages with their generated parts, into build/docs; a broken link is an error
	$(BIN)/python docs/make_pages.py && $(BIN)/python -m sphinx -q -W --keep-going -E -d build/docs-tree docs build/docs

clean:           ## remove what was built; the environment too
	rm -rf .venv build *.egg-info

# What physics on an arm needs comes first and is enough for the demo; extras and tools come when a target asks for them.
WANTED := import tomllib; p = tomllib.load(open("pyproject.toml", "rb"))["project"]; e = p["optional-dependencies"]
INSTALL := -m pip install --quiet --no-compile --disable-pip-version-check

.venv/needed: constraints.txt pyproject.toml
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "snarelab needs Python 3.11 or newer: make PYTHON=...")'
	$(PYTHON) -m venv .venv
	$(BIN)/python -c '$(WANTED); print(*p["dependencies"], sep="\n")' > .venv/needed.txt
	$(BIN)/python $(INSTALL) -c constraints.txt -r .venv/needed.txt
	touch $@

.venv/core: .venv/needed $(SOURCES)
	rm -rf build/lib build/bdist.*
	$(BIN)/python $(INSTALL) --no-deps --force-reinstall .
	touch $@

.venv/tools: .venv/needed
	$(BIN)/python -c '$(WANTED); print(*(r for x in e["all"][0][9:-1].split(",") + ["dev"] for r in e[x] if not r.startswith("snarelab[")), sep="\n")' > .venv/wanted.txt
	$(BIN)/python $(INSTALL) -c constraints.txt -r .venv/wanted.txt
	$(BIN)/python $(INSTALL) --no-deps -c constraints.txt example-robot-data
	touch $@

.venv/installed: .venv/tools .venv/core
	touch $@
