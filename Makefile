# Each target installs what it needs into .venv.
PYTHON ?= python3.11
VENV   := .venv
BIN    := $(VENV)/bin
STAMP  := $(VENV)/.installed
EXTRAS ?= dev,learned,onnx,openvino

.PHONY: help help-all install demo test test-all lint reproduce docs check-docs check-standards bench bench-compare bench-corpora bench-history eval closed-loop planners overtaking corner-cases driven-files long-drives heat-maps fusion-picture library-pictures weather-sheet pages clean

help:           ## print this list
	@grep -hE '^[a-z-]+:.* ## ' $(MAKEFILE_LIST) | sed -E 's/:.* ## /\t/' | expand -t 20

help-all:       ## print all targets, those of the project's own studies and checks included
	@grep -hE '^[a-z-]+:.* (##|#-) ' $(MAKEFILE_LIST) | sed -E 's/:.* (##|#-) /\t/' | expand -t 20

install: $(STAMP)  ## create .venv and install the project with its development tools

$(STAMP): pyproject.toml constraints.txt
	@command -v $(PYTHON) >/dev/null || { echo "$(PYTHON) is not installed; name another with: make PYTHON=python3 …"; exit 2; }
	$(PYTHON) -m venv --upgrade-deps $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[$(EXTRAS)]'
	$(BIN)/python -m eidrive_scenario.cli.compile_kernels
	@touch $@

demo: install   ## run scenarios 1 and 2 of the paper in all arms: reports/demo.html
	$(BIN)/python -m eidrive_reports.demo --out reports/demo.html

test: install   ## run the quick tests, in about four minutes on two cores
	$(BIN)/python -m pytest -n auto -m "not (process or statistical or exhaustive)" tests

test-all: install  ## run all tests and the scenarios of the library
	$(BIN)/python -m pytest -n auto --durations 25 tests xosc/coop

lint: install   ## check style, types and import contracts
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

docs: install   ## update the coverage table of docs/openscenario.md, and build the site: build/site/index.html
	$(BIN)/python tests/coverage_table.py
	$(BIN)/sphinx-build -W --keep-going --quiet docs build/site

check-docs: install  #- execute the commands of the documentation in a new environment with a wheel of the project
	$(BIN)/python -m pip install --quiet -c constraints.txt stable-baselines3
	$(BIN)/python -m pytest -q tests/test_examples.py -k stable_baselines
	$(BIN)/python tests/document_commands.py

check-standards: install  #- check scenarios, road files and OSI traces by the checkers of ASAM and by omega-prime
	$(BIN)/python tests/standard_checkers.py

reproduce: install  ## repeat the experiments of the paper, and compare trends with expected ones: reports/paper, reports/trends
	OPENBLAS_NUM_THREADS=1 $(BIN)/eidrive reproduce all --out reports/paper
	$(BIN)/python -m eidrive_reports.trends --out reports/trends

bench: install  ## measure the figures of docs/performance.md, and the time per package
	$(BIN)/python benchmarks/figures.py
	$(BIN)/python benchmarks/bench_scenario_1.py
	OPENBLAS_NUM_THREADS=1 $(BIN)/python benchmarks/bench_planner.py
	$(BIN)/python benchmarks/bench_fusion.py
	OPENBLAS_NUM_THREADS=1 $(BIN)/python benchmarks/bench_perception.py
	$(BIN)/python benchmarks/bench_radio.py
	OPENBLAS_NUM_THREADS=1 $(BIN)/python benchmarks/bench_gym.py
	@test -z "$$EIDRIVE_MAPS" && echo 'bench_traffic is skipped: EIDRIVE_MAPS is not set' || $(BIN)/python benchmarks/bench_traffic.py
	@test -z "$$EIDRIVE_CORPORA" && echo 'bench_corpora is skipped: EIDRIVE_CORPORA is not set' || $(BIN)/python benchmarks/bench_corpora.py

bench-compare: install  #- measure the commits BASE and HEAD in turn, and print the ratios
	@test -n "$(BASE)" || { echo 'BASE is not set: the commit to compare with, as in make bench-compare BASE=main~5'; exit 2; }
	$(BIN)/python benchmarks/compare.py $(BASE)

bench-corpora: install  #- run the suites of EIDRIVE_CORPORA with the commits BASE and HEAD in turn, and print the ratios
	@test -n "$(BASE)" || { echo 'BASE is not set: the commit to compare with, as in make bench-corpora BASE=main~5'; exit 2; }
	$(BIN)/python benchmarks/compare_corpora.py $(BASE) --processes

bench-history: install  #- add the figures of the current commit to benchmarks/history.csv
	$(BIN)/python benchmarks/history.py

eval: install   #- evaluate the learned detectors on held-out images and library scenes: reports/detection.md
	$(BIN)/python -m training.evaluate

closed-loop: install  #- run the scenarios of the paper with learned detectors, 20 seeds each: reports/closed_loop.md
	$(BIN)/python -m eidrive_reports.closed_loop --out reports

heat-maps: install  #- run the obstructed crossings over both speeds: reports/heat_maps/*.png
	$(BIN)/python -m eidrive_reports.heat_maps --out reports/heat_maps

fusion-picture: install  #- draw features, transmitted cells and fused objects of scenario 5: docs/figures/feature_fusion.png
	$(BIN)/python -m eidrive_reports.fusion_picture

library-pictures: install  #- draw the scenarios of the library: docs/library/*.png and docs/library.md
	$(BIN)/python -m eidrive_reports.library_pictures

planners: install  #- run the scenes for planners with two planners, 10 seeds each: reports/planner_scenes.md
	$(BIN)/python -m eidrive_reports.planner_scenes --out reports

overtaking: install  #- overtake with oncoming traffic at gaps of 4 to 20 s, and in random drives: reports/overtaking.md
	$(BIN)/python -m eidrive_reports.overtaking --out reports --detector lidar --detector yolov5

driven-files: install  #- drive the files of EIDRIVE_CORPORA by the planner: reports/driven_corpora.md
	@test -n "$$EIDRIVE_CORPORA" || { echo 'EIDRIVE_CORPORA is not set: the folder of the corpora'; exit 2; }
	@test -n "$$EIDRIVE_MAPS" || { echo 'EIDRIVE_MAPS is not set: the folder of the maps of ScenarioRunner'; exit 2; }
	$(BIN)/python -m eidrive_reports.driven_corpora --out reports --resume

long-drives: install  #- drive at least ten minutes through traffic on Town01 and Town04 of EIDRIVE_MAPS: reports/long_drives.md
	@test -n "$$EIDRIVE_MAPS" || { echo 'EIDRIVE_MAPS is not set: the folder of Town01.xodr and Town04.xodr'; exit 2; }
	$(BIN)/python -m eidrive_reports.long_drives "$$EIDRIVE_MAPS"/Town01.xodr "$$EIDRIVE_MAPS"/Town04.xodr --minutes 15 --out reports

corner-cases: install  #- run the corner cases with and without messages, 10 seeds each: reports/corner_cases.md
	$(BIN)/python -m eidrive_reports.corner_cases --out reports

weather-sheet: install  #- render one street in all weather presets: reports/weather.png
	$(BIN)/python -m eidrive_reports.weather_sheet

pages: install  #- open a report and replays in EIDRIVE_BROWSER, with axe-playwright-python: reports/pages, docs/figures/{replay,two_runs}.png
	@test -n "$$EIDRIVE_BROWSER" || { echo 'EIDRIVE_BROWSER is not set: the program of Chromium'; exit 2; }
	$(BIN)/python -m pip install axe-playwright-python
	mkdir -p reports/pages
	EIDRIVE_SCREENSHOTS=reports/pages $(BIN)/python -m pytest tests/engine/cli/test_pages_in_browser.py
	cp reports/pages/replay.png docs/figures/replay.png
	cp reports/pages/two-runs-desktop.png docs/figures/two_runs.png

clean:          #- remove the virtual environment and all generated files
	rm -rf $(VENV) dist build .pytest_cache .mypy_cache .ruff_cache .import_linter_cache
	git clean -qfdX reports
