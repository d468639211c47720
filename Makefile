# make demo | test | bench | study | docs | lint: each makes .venv itself, with the packages it needs.
# PYTHON=/path/to/python3 chooses another interpreter.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
# Workers of the test run (see test/conftest.py): two more than processors, for the tests of nodes mostly wait.
JOBS   ?= $(shell expr $$(nproc) + 2)

# The ROS wheels restart Python once and mark that in this variable; inherited by the Python of
# this environment, the mark would keep its own wheels from being found.
unexport _ROS_WHEELS_BOOTSTRAP_COMPLETE
unexport PYTHONHOME
# A random domain and no network: runs beside each other never mix their topics.
export ROS_DOMAIN_ID := $(shell expr $$(od -An -N2 -tu2 /dev/urandom) % 100 + 1)
export ROS_AUTOMATIC_DISCOVERY_RANGE := LOCALHOST

RUN_STAMP := $(VENV)/installed-run
DEV_STAMP := $(VENV)/installed-dev
DOCS_STAMP := $(VENV)/installed-docs
INSTALL    = $(BIN)/python -m pip install -qq --disable-pip-version-check

.PHONY: help demo test bench study docs readme lint clean
help:
	@echo "make demo   a piezo stage linearised through ROS, and a measured actuator identified (about 3 minutes)"
	@echo "make test   the tests"
	@echo "make bench  the benchmarks"
	@echo "make study  the properties on new examples, then the full hidden-effect study (hours; resumable)"
	@echo "make docs   the documentation as a site in build/site, its notebooks executed, its links checked"
	@echo "make readme every command of the README in a room like a fresh container (half an hour; ARGS=\"--share DIR\")"
	@echo "make lint   ruff (complexity, docstrings, format) and mypy"

demo: $(RUN_STAMP)
	@$(BIN)/fomrc demo

# One thread of BLAS for each worker: more of them than processors only wait for each other.
test: export OPENBLAS_NUM_THREADS := 1
test: export OMP_NUM_THREADS := 1
test: $(DEV_STAMP)
	@$(BIN)/python -m pytest -n $(JOBS) --max-worker-restart 0 $(ARGS)

bench: $(DEV_STAMP)
	@$(BIN)/python -m pytest benchmarks -p no:xdist --benchmark-only
	@$(BIN)/python -m benchmarks.ratios $(ARGS)

study: $(DEV_STAMP)
	@$(BIN)/python -m pytest test/core -m hypothesis --hypothesis-profile new_examples -n $(JOBS)
	@FOMRC_ALL_CASES=1 $(BIN)/python -m pytest test -n $(JOBS)
	@$(BIN)/python test/hidden/study.py $(ARGS)

docs: $(DOCS_STAMP)
	@NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet
	@for notebook in docs/notebooks/*.py; do \
	  $(BIN)/jupytext --quiet --to ipynb --output build/site/notebooks/$$(basename $$notebook .py).ipynb $$notebook || exit 1; \
	done
	@echo "build/site/index.html"

readme:
	@$(PYTHON) test/clean/readme_commands.py $(ARGS)

lint: $(DEV_STAMP)
	@$(BIN)/ruff check . && $(BIN)/ruff format --check . && $(BIN)/mypy

clean:
	rm -rf $(VENV) build install log demo_output .pytest_cache .mypy_cache .ruff_cache .hypothesis *.egg-info

$(BIN)/python:
	@$(PYTHON) -m venv --clear $(VENV) >/dev/null 2>&1 || { \
	  rm -rf $(VENV); \
	  echo "make: '$(PYTHON) -m venv' failed: install python3 and python3-venv (Debian, Ubuntu: apt install python3-venv), or name another interpreter with PYTHON=..." >&2; \
	  exit 1; }

# Where a ROS installation is sourced its own rclpy is used; elsewhere it comes as wheels.
$(RUN_STAMP): setup.py setup.cfg pyproject.toml | $(BIN)/python
	@if $(BIN)/python -c 'import importlib.util as u, sys; sys.exit(u.find_spec("rclpy") is None or u.find_spec("ros_wheels_bootstrapper") is not None)'; then \
	  extras=bags; \
	elif $(BIN)/python -c 'import platform, sys; sys.exit(not ((3, 10) <= sys.version_info[:2] <= (3, 14) and platform.python_implementation() == "CPython" and platform.machine() in ("x86_64", "AMD64") and sys.platform == "linux"))'; then \
	  extras=ros,bags; \
	else \
	  echo "make: no ROS found, and its wheels need CPython 3.10-3.14 on x86-64 Linux; $(PYTHON) is $$($(BIN)/python -c 'import platform as p; print(p.python_implementation(), p.python_version(), "on", p.machine(), p.system())'): name another with PYTHON=..., or source a ROS 2 installation" >&2; \
	  rm -rf $(VENV); exit 1; \
	fi; \
	echo "Installing into $(VENV) (a minute or so, once) ..."; \
	$(INSTALL) -e ".[$$extras]"
	@touch $@

$(DEV_STAMP): $(RUN_STAMP)
	@echo "Installing what the tests need ..."
	@$(INSTALL) -e ".[test,bench,lint]"
	@touch $@

$(DOCS_STAMP): $(RUN_STAMP)
	@echo "Installing what the documentation needs ..."
	@$(INSTALL) -e ".[docs]"
	@touch $@
