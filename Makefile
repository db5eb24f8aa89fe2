# A bare machine needs only python3 and make: this file installs the virtual environment, a pinned
# uv in it, and all pinned packages. It changes nothing outside this folder.
#
# The loop is interpreted, and builds of one Python version differ in speed by a factor of two
# (builds without profile-guided optimisation are slow). This file therefore chooses the fastest
# interpreter on the PATH that is new enough and has venv. Set PYTHON to choose yourself.
PROBE := import sys, timeit, venv, ensurepip; assert sys.version_info >= (3, 11); \
  print(round(1e6 * min(timeit.repeat("f(f(1.0))", "f = lambda x: (x, x)[0]", number=20000))), \
  sys.executable)
PYTHON ?= $(shell for d in $$(echo "$$PATH" | tr ":" " "); do \
  test -x $$d/python3 && $$d/python3 -c '$(PROBE)' 2>/dev/null; done | sort -n | head -n 1 | cut -d " " -f 2)
VENV := .venv
BIN := $(VENV)/bin
UV_VERSION := 0.13.8

# Test processes keep the byte code of test modules, which halves the time of their start.
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := help
.PHONY: help setup run wheel release pythons licences compiled docs test test-fast test-long \
  test-socketcan lint bench bench-batch clean constraints

help:
	@echo "make run    rehearse the default campaign on the simulated WaveBot; results in runs/"
	@echo "make wheel  build the package that pip installs; result in dist/"
	@echo "make release  sdist, wheel, SBOM in dist/; licences checked, installed and tested"
	@echo "make test   lint, types, import contracts, and all tests except most of the long ones"
	@echo "make test-fast   lint and the tests that take at most a few seconds (some minutes)"
	@echo "make test-long   lint and all tests"
	@echo "make test-socketcan  the CAN driver on a kernel with SocketCAN (user-mode Linux, a minute)"
	@echo "make bench  measure cycle, rehearsal, lateness, ring, logging and reading (about 30 min)"
	@echo "make bench-batch  only the benchmarks of the compiled loop and sweeps (about 25 min)"
	@echo "make docs   build the documentation as a site; result in site/, opens without a server"
	@echo "make clean  remove the virtual environment and caches (never runs/)"

setup: $(VENV)/.ready

$(VENV)/.ready: pyproject.toml constraints.txt
	@python="$(PYTHON)"; test -n "$$python" || { \
	  echo "no python3 on the PATH is 3.11 or newer and has venv (Debian: apt-get install" \
	    "python3-venv); or set PYTHON=/path/to/python3"; exit 1; }; \
	echo "setting up $(VENV) with $$python"; "$$python" -m venv --clear $(VENV)
	@if $(BIN)/python -m pip install --quiet --disable-pip-version-check uv==$(UV_VERSION); then \
	  $(BIN)/uv pip install --quiet --python $(BIN)/python --compile-bytecode \
	    --constraint constraints.txt --build-constraint constraints.txt --editable '.[dev]'; \
	else \
	  echo "uv is not available; installing with pip (slower)"; \
	  $(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[dev]'; \
	fi
	@$(BIN)/python -m compileall -q controllers drivers rig sim_plant
	@touch $@

run: setup
	$(BIN)/rig run configs/campaigns/default.yaml

wheel: setup
	@if [ -x $(BIN)/uv ]; then \
	  $(BIN)/uv build --quiet --wheel --build-constraint constraints.txt; \
	else \
	  $(BIN)/python -m pip wheel --quiet --no-deps --wheel-dir dist .; \
	fi
	@ls dist/*.whl

# MkDocs takes the pages of docs/, docs/generate/ those that the program generates. With --quiet it
# would not count its warnings, so that --strict would have no effect.
docs: setup
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict
	@echo "site/index.html"

# The wheel is built from the sdist, so tests of the wheel are tests of both.
RELEASE := build/release
CYCLONEDX := cyclonedx-bom==7.5.0
release: setup
	rm -rf dist $(RELEASE)
	$(BIN)/uv build --quiet --build-constraint constraints.txt
	$(BIN)/uv venv --quiet --python $(BIN)/python $(RELEASE)
	$(BIN)/uv pip install --quiet --python $(RELEASE)/bin/python --constraint constraints.txt \
	  packaging dist/*.whl
	$(RELEASE)/bin/python .ci/licences.py
	$(BIN)/uv tool run --quiet --from $(CYCLONEDX) cyclonedx-py environment --of JSON \
	  --output-file dist/sbom.cdx.json $(RELEASE)/bin/python
	WEC_RIG_WHEEL=$$(ls dist/*.whl) $(PYTEST) --long all -rs tests/cli/test_cli_installed.py \
	  tests/cli/test_each_python.py
	@ls dist

licences: setup
	$(BIN)/python .ci/licences.py

# A rehearsal and its replay on each Python of this host, in an environment of its own.
pythons: setup
	$(PYTEST) -rs -v tests/cli/test_each_python.py

lint: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/python -m tests.docs.prose

# Tests of runs in real time mostly wait. The other tests run at the same time, in the processor time
# that these leave: at the kernel's idle priority, which every other process displaces at once.
# A shared host sometimes pauses for longer than the timeout of a test, so failed tests run once
# more, alone: a test that then passes is listed as flaky at the end, one that fails again has
# failed. A test whose process dies fails, and xdist replaces the process; therefore even tests that
# run one after the other use one worker process (-n 1). The distribution is worksteal, because with
# distribution by file xdist 3.8 waits for ever for the tests of a dead worker. Tests in real time
# are sought in the files that mark some, because imports of all files take ten seconds. Paired ones
# run in two workers, each in a network of its own, with its own lock of the loop in real time.
# Rewriting all assertions takes each worker 15 s: the first try shows local variables instead, the
# second one the values of the assertion.
PYTEST := $(BIN)/python -m pytest
LONG := part
WITHOUT_CLOCK = -m "not realtime" --long $(LONG) -o cache_dir=.pytest_cache/without_clock
REALTIME = $$(grep -rl --include="test_*.py" mark.$(1) tests examples) --long $(LONG)
PAIRED = $(call REALTIME,paired) -m "realtime and paired" -o cache_dir=.pytest_cache/with_paired_clock
ALONE = $(call REALTIME,realtime) -m "realtime and not paired" -o cache_dir=.pytest_cache/with_clock
FIRST_TRY := --assert=plain --showlocals
SECOND_TRY := --last-failed --last-failed-no-failures none --second-try
FLAKY := .pytest_cache/flaky
export OWN_NETWORK := unshare --net sh -c 'ip link set lo up && exec "$$0" "$$@"'
LOG := .pytest_cache/without_clock.log
LINT_LOG := .pytest_cache/lint.log
IDLE := $(shell command -v chrt >/dev/null && echo chrt --idle 0)

# Rehearsals whose loop and plant are compiled start without the compiler and tick 20 times as fast.
compiled: setup
	@$(BIN)/rig compile configs/campaigns/quick.yaml >/dev/null & \
	$(BIN)/rig compile configs/sessions/driveline_short.yaml >/dev/null; \
	$(BIN)/rig compile configs/sessions/flap_free_decay.yaml >/dev/null; wait

test: setup
	@rm -rf $(FLAKY) .pytest_cache/with*_clock; mkdir -p .pytest_cache
	@$(IDLE) $(MAKE) --no-print-directory lint docs >$(LINT_LOG) 2>&1 & lint=$$!; \
	trap "kill $$lint 2>/dev/null" EXIT; \
	$(MAKE) --no-print-directory compiled; \
	echo "tests in real time; lint, site and the other tests at the same time, their output follows below"; \
	$(PYTEST) $(WITHOUT_CLOCK) $(FIRST_TRY) --idle -n 2 --dist worksteal >$(LOG) 2>&1 & others=$$!; \
	trap "kill $$others $$lint 2>/dev/null" EXIT; \
	two=popen; ! eval "$$OWN_NETWORK true" || two="2*popen//python=$$OWN_NETWORK $(BIN)/python"; \
	$(PYTEST) $(PAIRED) --tx "$$two" --dist worksteal; paired=$$?; \
	$(PYTEST) $(ALONE) -n 1; alone=$$?; \
	wait $$others; without_clock=$$?; cat $(LOG); \
	[ $$without_clock -eq 0 ] || $(PYTEST) $(WITHOUT_CLOCK) $(SECOND_TRY); without_clock=$$?; \
	[ $$paired -eq 0 ] || $(PYTEST) $(PAIRED) $(SECOND_TRY); paired=$$?; \
	[ $$alone -eq 0 ] || $(PYTEST) $(ALONE) $(SECOND_TRY); alone=$$?; \
	wait $$lint; lint=$$?; cat $(LINT_LOG); [ $$paired$$alone$$without_clock$$lint = 0000 ]
	@if [ -s $(FLAKY) ]; then echo "FLAKY TESTS (failed once, then passed alone):"; cat $(FLAKY); fi

test-long: LONG := all
test-long: test

test-fast: lint docs
	$(PYTEST) -m "not slow and not realtime" --long none -n 2 --dist worksteal

# Ends with status 77 and the reason if no such kernel is available.
test-socketcan: setup
	$(BIN)/python tests/socketcan/user_mode_linux.py

bench: setup
	$(BIN)/python -m benchmarks

bench-batch: setup
	$(BIN)/python -m benchmarks batch start arithmetic bits cluster counterfactual

constraints: setup  ## resolve the newest versions (on purpose only; then test and commit)
	$(BIN)/uv pip compile --quiet --extra dev --upgrade --no-header --no-annotate \
	  pyproject.toml --output-file constraints.txt

clean:
	rm -rf $(VENV) .mypy_cache .ruff_cache .pytest_cache .import_linter_cache
