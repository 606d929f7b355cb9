# Every target sets itself up: a virtual environment in .venv, the package in it, and nothing else.
# Needed on the machine: python 3.11 or newer, with pip or ensurepip. Once set up (the demo sets up its part of it), only
# the targets that build further environments (test-lowest, wheel, clean-room, bench) need a network.

VENV   := .venv
PYTHON := $(shell for p in python3 python3.14 python3.13 python3.12 python3.11 python; do \
            $$p -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && { command -v $$p; break; }; done)
PY     := $(VENV)/bin/python
EXTRAS := all,dev,docs
STAMP  := installed.toml

export MLFLOW_DISABLE_TELEMETRY := true
# uv installs no bytecode. Where the environment forbids Python to keep any, each process compiled its imports anew:
# `whsklearn gap` of a log of 24 s took 13.1 s in place of 5.9 s.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: help setup demo test test-all test-lowest clean-room ui lint bench docs commands wheel clean

help:  ## list the targets
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed 's/:.*##/\t/' | expand -t 14

# The stamp is a copy of pyproject.toml, compared by content: a fresh checkout or a touched file installs nothing anew.
setup:
	@cmp -s pyproject.toml $(VENV)/installed.toml || $(MAKE) --no-print-directory install

.PHONY: install
install: $(PY)
	@echo "Setting up $(VENV) (once; a few minutes at most)"
	@$(PY) -m uv --version >/dev/null 2>&1 || $(PYTHON) -m pip --python $(PY) install --quiet uv 2>/dev/null || \
	  { $(PY) -m ensurepip >/dev/null 2>&1 && $(PY) -m pip install --quiet uv 2>/dev/null; } || true
	@if $(PY) -m uv --version >/dev/null 2>&1; then \
	    $(PY) -m uv pip install --quiet --python $(PY) -e '.[$(EXTRAS)]'; \
	  elif $(PY) -m pip --version >/dev/null 2>&1; then \
	    echo "uv is not available; using pip, which takes longer"; \
	    $(PY) -m pip install --quiet -e '.[$(EXTRAS)]'; \
	  else \
	    echo "uv is not available; using pip, which takes longer"; \
	    $(PYTHON) -m pip --python $(PY) install --quiet -e '.[$(EXTRAS)]'; \
	  fi
	@cp pyproject.toml $(VENV)/$(STAMP)

$(PY):
	@test -n "$(PYTHON)" || { echo "No python 3.11 or newer on the PATH; install one and run make again."; exit 1; }
	@$(PYTHON) -m venv --without-pip $(VENV)

# Two of the extras are all that it needs, and are there in half the time.
demo:  ## identify the simulated example with every estimator, then find a hidden effect; all in MLflow
	@cmp -s pyproject.toml $(VENV)/installed.toml || cmp -s pyproject.toml $(VENV)/demo.toml || \
	  $(MAKE) --no-print-directory install EXTRAS=mlflow,plot STAMP=demo.toml
	$(PY) -m whsklearn demo

test: setup  ## the tests but the slow ones
	$(PY) -m pytest -m "not slow"

test-all: setup  ## all tests, as in CI: whole diagnoses of arms, commands that are killed, a browser
	$(PY) -m pytest

test-lowest:  ## the tests on the lowest versions that pyproject.toml admits, in .venv-lowest
	@test -x .venv-lowest/bin/python || $(PYTHON) -m venv --without-pip .venv-lowest
	@$(MAKE) --no-print-directory setup
	$(PY) -m uv pip install --python .venv-lowest/bin/python --resolution lowest-direct -e '.[all,dev]'
	.venv-lowest/bin/python -m pytest

lint: setup  ## ruff, the direction of imports, mypy
	$(PY) -m ruff check .
	$(PY) -m ruff format --check .
	$(VENV)/bin/lint-imports
	$(PY) -m mypy

# Users install a wheel, not a checkout: does it hold all that is needed, with the oldest and with the newest that it admits?
wheel: setup  ## build the wheel and try it in two clean environments
	rm -rf dist .venv-wheel
	$(PY) -m uv build --quiet --wheel --out-dir dist .
	for resolution in lowest-direct highest; do \
	    $(PYTHON) -m venv --without-pip .venv-wheel && \
	    $(PY) -m uv pip compile --quiet --resolution $$resolution --python .venv-wheel/bin/python pyproject.toml -o dist/needs.txt && \
	    $(PY) -m uv pip install --quiet --python .venv-wheel/bin/python -r dist/needs.txt dist/*.whl && \
	    (cd dist && ../.venv-wheel/bin/python -W error::FutureWarning ../.ci/smoke.py) && rm -rf .venv-wheel || exit 1; \
	done

clean-room: setup  ## five stories of a stranger, with the built wheel in an empty environment
	$(PY) .ci/clean_room.py

ui: setup  ## the recorded runs in the browser
	$(PY) -m pipelines.ui

# The peers want older NumPys than ours, so they live in an environment of their own. The full measurements, with blind
# records and a hundred seeds, are the scripts in benchmarks/ without options.
bench: setup  ## speed against peers, accuracy on 20 seeds, real records
	@test -x .venv-bench/bin/python || $(PYTHON) -m venv --without-pip .venv-bench
	@cmp -s pyproject.toml .venv-bench/installed.toml || { \
	    $(PY) -m uv pip install --quiet --python .venv-bench/bin/python -e '.[all,bench]' 2>/dev/null || \
	    $(PYTHON) -m pip --python .venv-bench/bin/python install --quiet -e '.[all,bench]'; \
	    cp pyproject.toml .venv-bench/installed.toml; }
	OMP_NUM_THREADS=1 .venv-bench/bin/python -m benchmarks.speed
	OMP_NUM_THREADS=1 .venv-bench/bin/python benchmarks/streaming.py --rows 3e5
	OMP_NUM_THREADS=1 .venv-bench/bin/python benchmarks/accuracy.py --section example --runs 20
	OMP_NUM_THREADS=1 .venv-bench/bin/python -m benchmarks.real_data

docs: setup  ## the documentation, into docs/_build/html
	$(PY) -m sphinx -b html -W --keep-going docs docs/_build/html
	@echo "Open docs/_build/html/index.html"

# Benchmarks and what serves until it is stopped are left out, each with its reason.
commands: setup  ## type every command that the README and the documentation show
	$(PY) tests/docs/type_commands.py

clean:  ## remove caches and build outputs; the runs in mlruns/ stay
	rm -rf build dist docs/_build docs/auto_examples docs/gen_modules docs/api .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find whsklearn pipelines tests benchmarks -name __pycache__ -type d -prune -exec rm -rf {} +
