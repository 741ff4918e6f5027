# make demo    plan a bundled world, verify the plan, write a page to look at
# make test    the tests of daily work, with the same random cases each time; pytest alone draws new ones
# make test-slow  the slow tests, which make test leaves out
# make test-random  tests of random cases with twelve times as many of them, and those that take minutes
# make coverage  the lines that the suite runs, every kernel as plain Python too; fails under 95 in a hundred
# make soak    all bundled worlds and WORLDS=500 random ones, half of them round a motion known to be free,
#              judged by other libraries
# make fuzz    SECONDS=120 of broken files of each kind, after files made to do harm
# make lint    style, types, import order
# make bench   whole jobs beside what one would pick instead, into docs/benchmarks.md and docs/benchmarks.json
#              (a quarter of an hour); DATA=FOLDER also runs public paths, in its folders bstar and iklink
# make bench-history  our own kernels and stages timed, kept in .benchmarks/, beside the runs before
# make bench-all  areas, base motion, clear postures and real robots, measured and checked in the same run
# make tables  recompute every table of the papers into docs/tables.md, beside the printed figures
# make docs    build the documentation into site/, all bundled worlds planned for its gallery
# make figures draw the figures of docs/method.md and the tutorial again (with Chromium)
# make pages   write the outputs of the commands in docs/ again
# make test-lowest  the quick tests with the lowest direct dependencies that pyproject.toml allows
# make test-newest  the same with the newest versions of everything that it stands on
# make faults  TIMES=30 long commands ended at random moments by SIGNAL=INT, TERM or KILL
# make clean   remove what the others made

# The newest Python that fits and can make virtual environments; or say PYTHON=/path/to/python.
FITS := import ensurepip, sys, venv; sys.exit(not (3, 11) <= sys.version_info[:2] < (3, 14))
PYTHON ?= $(shell for python in python3.13 python3.12 python3.11 python3; do \
	if $$python -c '$(FITS)' >/dev/null 2>&1; then command -v $$python; break; fi; done)
BIN := .venv/bin
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt
NEEDS := pyproject.toml constraints.txt

.PHONY: demo test test-slow test-random coverage soak fuzz faults lint bench bench-history bench-all tables docs figures pages \
	test-lowest test-newest clean

demo: .venv/installed
	$(BIN)/regionik plan l_shape -o plan.json --html l_shape.html
	$(BIN)/regionik verify plan.json
	@echo "Look at it: file://$(CURDIR)/l_shape.html"

PYTEST := $(BIN)/python -m pytest -q -n 2 --dist loadfile --no-loadscope-reorder --hypothesis-seed=0

test: .venv/installed-test,compare,distributed,geotiff,second,simulate
	$(PYTEST) -m "not slow"

test-slow: .venv/installed-test,compare,distributed,geotiff,second,simulate
	$(PYTEST) --hypothesis-profile=long -m "slow and not long"

test-random: .venv/installed-test,compare,distributed,geotiff,second,simulate
	$(PYTEST) --hypothesis-profile=long -m "hypothesis or long"

# What compiled kernels run cannot be counted line by line: tests.twice calls them as plain Python as well, and
# a test fails where the two differ.
COVERED := COVERAGE_FILE=$(CURDIR)/.coverage $(BIN)/coverage

coverage: .venv/installed-test,compare,distributed,geotiff,second,simulate
	rm -f .coverage .coverage.*
	$(COVERED) run -m pytest -q -n 2 --dist loadfile --hypothesis-seed=0 --hypothesis-profile=long -m "not long" \
		-p tests.twice
	$(COVERED) combine -q
	$(COVERED) report --skip-covered

WORLDS ?= 500
soak: .venv/installed-test,compare,distributed,geotiff,second,simulate
	$(BIN)/python -m tests.soak $(WORLDS) -o docs/soak.md

SECONDS ?= 120
fuzz: .venv/installed-test,compare,distributed,geotiff,second,simulate
	$(BIN)/python -m tests.fuzz $(SECONDS)

lint: .venv/installed-lint
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

bench: .venv/installed-bench,compare,simulate,test
	$(BIN)/regionik warm-up
	$(BIN)/python -m benchmarks.page -o docs/benchmarks $(if $(DATA),--data $(DATA))

bench-history: .venv/installed-test,bench
	$(BIN)/python -m pytest -q -p benchmark benchmarks/history.py --benchmark-storage=.benchmarks --benchmark-autosave --benchmark-quiet
	$(BIN)/pytest-benchmark --storage=.benchmarks compare --columns=median,iqr --group-by=name --sort=fullname

bench-all: .venv/installed-simulate
	$(BIN)/regionik warm-up
	@for script in benchmarks/bench_*.py; do echo "$$script"; \
		$(BIN)/python -m benchmarks.$$(basename $$script .py) || exit 1; done

tables: .venv/installed-compare
	$(BIN)/python -m benchmarks.tables -o docs/tables.md

docs: .venv/installed-docs
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict
	@echo "Look at it: file://$(CURDIR)/site/index.html"

figures: .venv/installed
	$(BIN)/python -m docs.figures

pages: .venv/installed
	$(BIN)/python -m tests.pages

# Warnings are no errors here: old versions warn of new ones, and new ones of their next.
QUICK := tests/test_world_file.py tests/test_regions.py tests/test_mfabrik.py tests/test_verify.py tests/test_jerk.py \
	tests/test_retime.py tests/test_distances.py tests/test_urdf.py tests/test_occupancy_map.py tests/test_plot.py

QUICKLY = -m pytest -q -o filterwarnings=ignore -n 2 --dist loadfile $(QUICK)

test-lowest: .venv-lowest/installed
	NUMBA_CACHE_DIR=$(CURDIR)/.venv-lowest/numba .venv-lowest/bin/python $(QUICKLY)

test-newest:
	$(PYTHON) -m venv .venv-newest
	.venv-newest/bin/python -m pip install --quiet --disable-pip-version-check \
		--upgrade --upgrade-strategy eager --editable '.[test]'
	NUMBA_CACHE_DIR=$(CURDIR)/.venv-newest/numba .venv-newest/bin/python $(QUICKLY)

TIMES ?= 30
SIGNAL ?= INT
faults: .venv/installed-test,compare,distributed,geotiff,second,simulate
	$(BIN)/python -m tests.faults $(TIMES) --signal $(SIGNAL)

.venv-lowest/installed: pyproject.toml .ci/lowest.py
	$(PYTHON) -m venv .venv-lowest
	.venv-lowest/bin/python .ci/lowest.py pyproject.toml test > .venv-lowest/lowest.txt
	@echo "The lowest versions:" && cat .venv-lowest/lowest.txt
	.venv-lowest/bin/python -m pip install --quiet --disable-pip-version-check \
		--constraint .venv-lowest/lowest.txt --editable '.[test]'
	@touch $@

clean:
	rm -rf .venv .venv-lowest .venv-newest .coverage .coverage.* site build dist regionik.egg-info plan.json l_shape.html

.venv/bin/python:
	@test -n "$(PYTHON)" || { echo "regionik needs Python 3.11, 3.12 or 3.13 with venv and ensurepip" \
		"(on Debian and Ubuntu: apt install python3-venv); none was found, see make PYTHON=..." >&2; exit 1; }
	$(PYTHON) -m venv .venv

.venv/installed: .venv/bin/python $(NEEDS)
	@echo "Installing regionik into .venv (a few minutes the first time)"
	$(PIP) --editable .
	@touch $@

.venv/installed-%: .venv/bin/python $(NEEDS)
	@echo "Installing regionik[$*] into .venv (a few minutes the first time)"
	$(PIP) --editable '.[$*]'
	@touch $@
