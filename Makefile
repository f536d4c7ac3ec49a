# `make demo` and `make test` do all the set-up that they need.
PYTHON ?= python3.11
VENV   := .venv
BIN    := $(VENV)/bin
STAMP  := $(VENV)/.installed

.PHONY: help install demo test lint reproduce-trends docs bench eval closed-loop weather-sheet clean

help:           ## this list
	@grep -E '^[a-z-]+: .*##|^[a-z-]+:  +##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 20

install: $(STAMP)  ## create .venv and install the project with its development tools

$(STAMP): pyproject.toml constraints.txt
	@command -v $(PYTHON) >/dev/null || { echo "$(PYTHON) is not installed; name another with: make PYTHON=python3 …"; exit 2; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[dev,learned,onnx]'
	@touch $@

demo: install   ## run the main job: scenarios 1 and 2 of the paper, all arms, reports/demo.html
	$(BIN)/python -m eidrive_scenario.reporting.demo --out reports/demo.html

test: install   ## run the test suite and the scenario library's own tests
	$(BIN)/python -m pytest -n auto tests xosc/coop

lint: install   ## style, types, import arrows
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

docs: install   ## make the coverage table of docs/openscenario.md anew
	$(BIN)/python tests/coverage_table.py

reproduce-trends: install  ## known trends, measured and expected: reports/trends/*.png
	$(BIN)/python -m eidrive_scenario.reporting.trends --out reports/trends

bench: install  ## simulated seconds per wall second, and where the time goes
	$(BIN)/python benchmarks/bench_scenario_1.py
	$(BIN)/python benchmarks/bench_fusion.py
	OPENBLAS_NUM_THREADS=1 $(BIN)/python benchmarks/bench_perception.py
	$(BIN)/python benchmarks/bench_radio.py
	@test -z "$$EIDRIVE_MAPS" && echo 'EIDRIVE_MAPS is not set: no bench_traffic' || $(BIN)/python benchmarks/bench_traffic.py
	@test -z "$$EIDRIVE_CORPORA" && echo 'EIDRIVE_CORPORA is not set: no bench_corpora' || $(BIN)/python benchmarks/bench_corpora.py

eval: install   ## what the learned detectors see: held-out pictures, library scenes, reports/detection.md
	$(BIN)/python -m training.evaluate

closed-loop: install  ## learned detectors in the paper's scenarios, 20 seeds each: reports/closed_loop.md
	$(BIN)/python -m eidrive_scenario.experiments.closed_loop --out reports

weather-sheet: install  ## one street in all weathers of the library: reports/weather.png
	$(BIN)/python -m eidrive_scenario.reporting.weather_sheet

clean:          ## remove the virtual environment and everything generated
	rm -rf $(VENV) dist build .pytest_cache .mypy_cache .ruff_cache .import_linter_cache
	find reports -mindepth 1 ! -name README.md -delete
