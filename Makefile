# Two commands do the set-up of a fresh clone: `make validate` and `make test`.
# Both install the exact versions of requirements.lock into .venv, once.

VENV    ?= .venv
JOBS    ?= 2
BIN     := $(VENV)/bin
PY      := $(BIN)/python
STAMP   := $(VENV)/.installed
PIP     := $(PY) -m pip --disable-pip-version-check --no-input -qq
PYTEST  := $(BIN)/pytest

FIND_PYTHON = for p in $(PYTHON) python3.11 python3.12 python3.13 python3; do \
	if $$p -c 'import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; \
	then echo $$p; break; fi; done

.DEFAULT_GOAL := help
.PHONY: help install validate test lint slow md mutation oracles coverage docs bench notebooks wheel-check \
	lock clean

help: ## this list
	@grep -hE '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | awk -F ':.*## ' '{printf "  make %-12s %s\n", $$1, $$2}'

install: $(STAMP) ## environment with the locked versions, the package itself, kernels compiled
	@$(BIN)/dnacheck compile

$(PY):
	@python=$$($(FIND_PYTHON)); \
	if [ -z "$$python" ]; then echo "make: needs Python 3.11 or newer with venv; set PYTHON=..." >&2; exit 1; fi; \
	echo "creating $(VENV) with $$python"; $$python -m venv $(VENV)

# Imported once after installing, so that their bytecode is on disk: compiling it anew costs every
# start seconds, where Python is told not to write any.
HEAVY := numba, scipy.optimize, Bio.SeqIO, matplotlib.pyplot, plotly, MDAnalysis, openmm.app, \
	rich.progress, pydantic, jinja2, pytest, hypothesis

# uv, at the version and hash of the lock, installs in seconds what takes pip a minute. Where it
# cannot (an index known to pip only, say), pip does the same work.
$(STAMP): requirements.lock pyproject.toml | $(PY)
	@echo "installing the locked packages into $(VENV) (once)"
	@awk '/^[^ ]/ { keep = /^uv==/ } keep' requirements.lock > $(VENV)/uv.lock
	@$(PIP) install --require-hashes --no-deps -r $(VENV)/uv.lock
	@$(PY) -m uv pip install --quiet --python $(PY) --require-hashes --no-deps \
		-r requirements.lock 2>/dev/null || { \
		echo "uv cannot reach the packages; pip installs them (about a minute)"; \
		$(PIP) install --require-hashes --no-deps --no-compile -r requirements.lock; }
	@$(PIP) install --no-deps --no-build-isolation --editable .
	@env -u PYTHONDONTWRITEBYTECODE $(PY) -c "import $(HEAVY)" >/dev/null 2>&1 || true
	@touch $@

validate: $(STAMP) ## compute the default scene and write report/report.html
	$(BIN)/dnacheck validate -o report

lint: $(STAMP) ## style, types, import contracts, spelling
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-cache
	$(BIN)/codespell

test: lint ## linters and the fast tests
	$(PYTEST) -n $(JOBS)

slow: $(STAMP) ## tests of minutes
	$(PYTEST) -n $(JOBS) -m slow

md: $(STAMP) ## tests that run OpenMM dynamics
	$(PYTEST) -m md

mutation: $(STAMP) ## break the kernels 200 times; hours
	$(PY) tests/mutation.py --count 200 --jobs $(JOBS)

oracles: $(STAMP) ## comparisons with independent programs; absent ones are skipped
	@sh validation/oracles/auto07p/install.sh
	$(PYTEST) -m oracle

# Three runs, joined: the fast tests, the kernels as plain Python, the harness on its default scene
# (without its longest samplings, whose code the others cover).
HARNESS = table2 wanted discrete continuum sweeps hard speed bead_chain.energy bead_chain.minimum \
	jfactor.acceptance jfactor.laplace jfactor.table3 jfactor.shifts
coverage: $(STAMP) ## line coverage, compiled kernels included; fails below 90 %
	$(BIN)/coverage erase
	$(BIN)/coverage run -m pytest -q -n $(JOBS) --ignore=tests/docs --ignore=tests/notebooks
	NUMBA_DISABLE_JIT=1 $(BIN)/coverage run tests/interpreted.py >/dev/null
	$(BIN)/coverage run -m dnacheck validate -o build/coverage-report $(HARNESS:%=--only %)
	$(BIN)/coverage combine -q
	$(BIN)/coverage report --fail-under=90

docs: $(STAMP) ## HTML documentation, warnings are errors
	$(BIN)/sphinx-build -W --keep-going -b html docs docs/_build/html

bench: $(STAMP) ## print the benchmark figures
	@for script in validation/benchmarks/*.py; do \
		case $$script in */_*) continue;; esac; \
		echo "== $$script"; $(PY) $$script || exit 1; done

notebooks: $(STAMP) ## execute the notebooks at full size
	@mkdir -p build/notebooks
	@for notebook in validation/notebooks/*.ipynb; do \
		echo "== $$notebook"; \
		$(BIN)/jupyter execute --output="$(CURDIR)/build/notebooks/$$(basename $$notebook)" \
			$$notebook || exit 1; done

# A wheel and the libraries it asks for, nothing else, used from an empty directory.
wheel-check: $(STAMP) ## build a wheel and use it away from the checkout
	@set -e; rm -rf build/wheel; mkdir -p build/wheel; \
	$(PY) -m build --wheel --no-isolation --outdir build/wheel . >/dev/null; \
	away=$$(mktemp -d); trap 'rm -rf "$$away"' EXIT; \
	sed -n 's/ *\\$$//; /==/p' requirements.lock > "$$away/constraints.txt"; \
	$(PY) -m venv "$$away/venv"; \
	$(PY) -m uv pip install --quiet --python "$$away/venv/bin/python" \
		-c "$$away/constraints.txt" build/wheel/*.whl || \
	"$$away/venv/bin/python" -m pip install -qq -c "$$away/constraints.txt" build/wheel/*.whl; \
	cd "$$away"; env -u PYTHONPATH venv/bin/dnacheck ring 11T15

lock: $(PY) ## resolve the dependencies anew into requirements.lock
	$(PY) -m uv pip compile pyproject.toml --all-extras --universal --python-version 3.11 \
		--generate-hashes --no-annotate --no-header --no-emit-index-url --no-emit-find-links \
		--quiet --upgrade --output-file requirements.lock

clean: ## remove what was built, keep the environment
	rm -rf build dist report docs/_build .coverage .coverage.* .pytest_cache .mypy_cache .ruff_cache
