"""One run, however it is asked for: same file, seed and settings give the same trace hash."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from openscenario_xml import deterministic_xml, distribution_xml, values_xml

from eidrive_scenario.errors import InputError
from eidrive_scenario.extensions.library import resolve_scenario
from eidrive_scenario.openscenario import load_distribution, load_scenario
from eidrive_scenario.simulation import RunSettings, Simulation, load_for_seed, run_file

pytest_plugins = ["pytester"]

ONE = "coop/scenario_1"
DRAWN = "EgoOffset"
SHORT = RunSettings(time_limit=0.5)


def test_run_asked_for_in_any_way_has_one_trace_hash(pytester: pytest.Pytester) -> None:
    path = resolve_scenario(ONE)
    printed = subprocess.run(
        [sys.executable, "-m", "eidrive_scenario", "run", ONE, "--json"], capture_output=True, text=True, check=False
    )
    expected = json.loads(printed.stdout)["trace_hash"]
    pytester.makepyfile(
        f"""
        import pytest

        @pytest.mark.scenario("{ONE}")
        def test_one(run_scenario):
            assert run_scenario().trace_hash == "{expected}"
        """
    )
    pytester.runpytest_inprocess("-p", "no:cacheprovider").assert_outcomes(passed=1)
    assert {
        "run_file by name": run_file(ONE).trace_hash,
        "run_file by path": run_file(path, seed=1).trace_hash,
        "Simulation of a loaded scenario": Simulation(load_scenario(path), seed=1).run().trace_hash,
        "Simulation of a name": Simulation(ONE).run().trace_hash,
        "Simulation of another seed's scenario": Simulation(load_for_seed(ONE, 7), seed=1).run().trace_hash,
    } == dict.fromkeys(
        [
            "run_file by name",
            "run_file by path",
            "Simulation of a loaded scenario",
            "Simulation of a name",
            "Simulation of another seed's scenario",
        ],
        expected,
    )


def test_simulation_of_loaded_scenario_draws_for_its_own_seed() -> None:
    loaded = load_scenario(ONE)
    drawn = {}
    for seed in (1, 2):
        with Simulation(loaded, seed=seed, settings=SHORT) as simulation:
            drawn[seed] = simulation.scenario.parameters[DRAWN]
    assert drawn == {seed: load_for_seed(ONE, seed).parameters[DRAWN] for seed in (1, 2)}
    assert drawn[1] != drawn[2]
    assert loaded.parameters[DRAWN] == "0"


def test_assigned_parameters_win_over_drawn_ones() -> None:
    loaded = load_scenario(ONE, {DRAWN: "0.125"})
    with Simulation(loaded, seed=3) as simulation:
        assert simulation.scenario.parameters[DRAWN] == "0.125"
        assert simulation.scenario.parameters["IncomingOffset"] != loaded.parameters["IncomingOffset"]
    with Simulation(loaded, seed=3, settings=RunSettings(parameters={DRAWN: "0.5"})) as simulation:
        assert simulation.scenario.parameters[DRAWN] == "0.5"
    with Simulation(load_scenario(ONE), settings=RunSettings(parameters={"EgoSpeed": "5"})) as simulation:
        assert simulation.scenario.parameters["EgoSpeed"] == "5"


def test_scenario_without_change_is_not_loaded_again() -> None:
    loaded = load_for_seed(ONE, 5)
    assert load_for_seed(loaded, 5) is loaded
    assert load_for_seed(loaded, 5, {"EgoSpeed": loaded.parameters["EgoSpeed"]}) is loaded


def test_source_without_file_draws_too() -> None:
    path = resolve_scenario(ONE)
    text = path.read_text().replace('"../', f'"{path.parent.parent}/').encode()
    with Simulation(load_scenario(text), seed=4) as simulation:
        assert simulation.scenario.parameters[DRAWN] == load_for_seed(ONE, 4).parameters[DRAWN]


def test_unknown_library_name_suggests_the_nearest() -> None:
    with pytest.raises(InputError, match="did you mean 'coop/scenario_1'"):
        run_file("coop/scenaro_1")


def test_run_of_a_distribution_keeps_its_number_and_values(tmp_path: Path) -> None:
    distribution = tmp_path / "speeds.xosc"
    body = deterministic_xml(values_xml("EgoSpeed", "5", "7"))
    distribution.write_bytes(distribution_xml(body, scenario=resolve_scenario(ONE)))
    results = [run_file(run, settings=SHORT) for run in load_distribution(distribution)]
    assert [(result.run, result.parameters["EgoSpeed"]) for result in results] == [(0, "5"), (1, "7")]
