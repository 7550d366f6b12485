PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready

.PHONY: demo test test-full lint style types layers collected bench docs clean

# The tests start hundreds of processes: compiled modules are kept, whatever the shell says.
unexport PYTHONDONTWRITEBYTECODE

demo: $(READY)
	$(BIN)/dyknow demo

# Rows of the bench keep all processors busy: platforms of other live tests would time out next to them.
test: $(READY)
	$(MAKE) --no-print-directory -j 2 lint collected
	$(BIN)/pytest -m "not full" --ignore=tests/live -n 3 --dist worksteal
	$(BIN)/pytest -m "not full" tests/live --ignore=tests/live/bench -n 5 --dist loadfile --no-loadscope-reorder
	$(BIN)/pytest -m "not full" tests/live/bench -n 2

test-full: $(READY) lint
	DYKNOW_FULL=1 $(BIN)/pytest --timeout=3600 --ignore=tests/live -n 2 --dist worksteal
	DYKNOW_FULL=1 $(BIN)/pytest --timeout=3600 tests/live -n 2 --dist loadfile --no-loadscope-reorder

lint: style types layers

style: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(READY)
	$(BIN)/mypy

layers: $(READY)
	$(BIN)/lint-imports

collected: $(READY)
	@$(BIN)/pytest --collect-only --quiet > /dev/null || true

bench: $(READY)
	$(BIN)/python -m bench

$(READY): pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --disable-pip-version-check -e ".[dev]"
	touch $@

docs: $(READY)
	$(BIN)/pip install --quiet --disable-pip-version-check -e ".[site]"
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --quiet

clean:
	rm -rf $(VENV) build dist site .mypy_cache .ruff_cache .pytest_cache .import_linter_cache
