"""Distribution files of the corpora: number of runs, and validity of each value."""

from __future__ import annotations

import time
import tracemalloc
from pathlib import Path

import pytest
from corpora import needs_corpora, scenario_files

from eidrive_scenario.checks.scenario_checks import check_distribution
from eidrive_scenario.errors import ConstraintError
from eidrive_scenario.extensions.library import definition
from eidrive_scenario.openscenario import load_distribution, load_scenario
from eidrive_scenario.simulation import RunSettings, Simulation

pytestmark = needs_corpora

LARGEST = "alks_scenario_4_4_1_cut_in_no_collision_variation.xosc"
TRIGGER = "CutInVehicle_HeadwayDistanceTrigger_dx0_m"


def distributions() -> list[Path]:
    return [path for path in scenario_files() if definition(path) == "distribution"]


def test_distribution_files_are_all_covered() -> None:
    """The expected sums are from an independent count: 121,060 runs in all ALKS variations, 52,500 in the largest."""
    counts = {path: len(load_distribution(path)) for path in distributions()}
    assert len(counts) == 21
    assert sum(count for path, count in counts.items() if path.parent.name == "alks") == 121_060
    assert counts[next(path for path in counts if path.name == LARGEST)] == 52_500


@pytest.mark.exhaustive
def test_largest_distribution_iterates_in_constant_memory() -> None:
    path = next(path for path in distributions() if path.name == LARGEST)
    started = time.process_time()
    runs = load_distribution(path)
    assert len(runs) == 52_500
    assert time.process_time() - started < 2
    seen = set()
    tracemalloc.start()
    for run in runs:
        seen.add(hash(tuple(run.parameters.values())))
        if run.number == 1000:
            tracemalloc.reset_peak()
            early = tracemalloc.get_traced_memory()[0]
        if run.number == 12_000:
            late = tracemalloc.get_traced_memory()[1]
            tracemalloc.stop()
    assert len(seen) == 52_500, "no run comes twice"
    assert late - early < 1.7 * 2**20, "the hashes themselves take about 1 MB, and 160 bytes per run are the limit"


@pytest.mark.exhaustive
@pytest.mark.filterwarnings("default")
def test_cut_in_at_negative_gap_never_starts() -> None:
    """In run 12,394 `dx0_m` is 0, and free space is never negative; the stop trigger waits for the cut-in."""
    path = next(path for path in distributions() if path.name == LARGEST)
    runs = load_distribution(path)
    assert sum(run.parameters[TRIGGER] == "0" for run in runs) == 7_500
    run = runs[12_394]
    assert run.parameters[TRIGGER] == "0"
    simulation = Simulation(load_scenario(run.scenario, run.assignments), settings=RunSettings(dt=0.1, time_limit=20.0))
    with simulation:
        frames = [simulation.tick()]
        while frames[-1][1] is None:
            frames.append(simulation.tick())
    assert frames[-1][1] == "time limit"
    assert not any(
        change.element == "CutInEvent" and change.transition for frame, _ in frames for change in frame.changes
    )


@pytest.mark.exhaustive
def test_check_distribution_reports_impossible_conditions() -> None:
    """In the other runs the condition can hold."""
    path = next(path for path in distributions() if path.name == LARGEST)
    (told,) = (one for one in check_distribution(path).warnings if one.rule == "impossible-condition")
    number, _, what = told.message.removeprefix("in run ").partition(": ")
    assert load_distribution(path)[int(number)].parameters[TRIGGER] == "0"
    assert what.startswith("condition 'CutInStartCondition' is never true: a distance is never negative")


@pytest.mark.exhaustive
@pytest.mark.parametrize("path", distributions(), ids=lambda path: path.stem)
def test_every_value_loads_as_scenario(path: Path) -> None:
    """No file has errors; some combinations violate constraints, which is a warning."""
    collector = check_distribution(path)
    assert collector.errors == ()
    own = [warning for warning in collector.warnings if warning.source == str(path)]
    assert all("outside its constraints" in warning.message for warning in own)
    assert collector.runs == len(load_distribution(path))


@pytest.mark.parametrize("path", distributions(), ids=lambda path: path.stem)
def test_run_has_the_values_of_its_combination(path: Path) -> None:
    runs = load_distribution(path)
    for number in runs.spread(5):
        run = runs[number]
        with_defaults = load_scenario(run.scenario).parameters
        try:
            parameters = load_scenario(run.scenario, run.assignments).parameters
        except ConstraintError:
            continue
        assert parameters == {**with_defaults, **run.parameters}
