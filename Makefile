# Everything runs in an environment of its own, made on first use from the ordinary index.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed

.PHONY: demo test check crazyflow format bench docs clean

demo: $(STAMP) ## plan a real racing course, prove it, and write flight file and pictures
	$(BIN)/peakflight plan examples/courses/uzh_19wp.json --max-pieces 31 -o out/demo
	$(BIN)/peakflight check out/demo/plan.json
	@echo "Look at out/demo/course.png; fly out/demo/crazyflie.csv."

test: $(STAMP) ## run the tests
	$(BIN)/python -m pytest

check: $(STAMP) ## format, lint, types, import contracts, examples
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/python examples/run_all.py

crazyflow: $(STAMP) ## install crazyflow (1.1 GB), and fly a few plans there
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[crazyflow]'
	$(BIN)/python -m pytest -q tests/test_crazyflow.py

format: $(STAMP) ## mend format and what lint can mend
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

bench: $(STAMP) ## measure, beside peers, against the marks we set ourselves
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[bench]'
	$(BIN)/python -m benchmarks $(BENCH)

docs: $(STAMP) ## build the pages in docs/_build
	$(BIN)/python -m sphinx -W -b html docs docs/_build

clean:
	rm -rf $(VENV) out docs/_build
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

$(STAMP): pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[dev]'
	touch $@
