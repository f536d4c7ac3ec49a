"""EIScenarios of the library with the lane follower `route`, which ignores objects, and so collides in each."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import pytest
from corpora import corpora_folder
from lxml import etree

from eidrive_scenario.api.run import RunResult, RunSettings, Simulation, check_scenario, run_file
from eidrive_scenario.evaluation import Verdict

FOLDER = Path(__file__).parents[2] / "xosc" / "ei"
OTHERS = {
    "01": "Truck",
    "02": "Lead",
    "03": "Crossing",
    "04": "LeadTruck",
    "05": "Crossing",
    "06": "Crossing",
    "07": "Lead",
    "08": "Lead",
    "09": "LeftTurner",
    "11": "Turner",
    "12": "PullingOut",
    "13": "FromLeft2",
    "14": "Merging",
    "15": "Turner",
    "16": "Lead",
    "17": "Walker",
    "18": "Walker",
}
"""Actor that the ego hits in each scenario; EI-Drive has no number 10."""
WITH_ROUTE = RunSettings(parameters={"Planner": "route"})


@cache
def run_with_route(number: str) -> RunResult:
    """Return the result of a scenario with the lane follower."""
    return run_file(f"ei/scenario_{number}", seed=1, settings=WITH_ROUTE)


def verdict(result: RunResult, name: str) -> Verdict:
    return next(item for item in result.criteria if item.name == name)


def test_library_has_the_scenarios_of_ei_drive() -> None:
    assert [path.stem for path in sorted(FOLDER.glob("*.xosc"))] == [f"scenario_{number}" for number in OTHERS]


@pytest.mark.exhaustive
@pytest.mark.parametrize(("number", "other"), OTHERS.items())
def test_lane_follower_collides(number: str, other: str) -> None:
    result = run_with_route(number)
    collision = verdict(result, "collision")
    assert not collision.passed
    assert f"Ego and {other} hit each other" in collision.reason
    assert not verdict(result, "reach_position").passed
    assert verdict(result, "time_limit").passed
    assert not result.warnings


@pytest.mark.statistical
@pytest.mark.parametrize(("number", "time"), [("01", 2.77), ("03", 6.45), ("06", 6.45), ("11", 6.35), ("12", 4.0)])
def test_time_of_collision_is_that_of_the_original_paths(number: str, time: float) -> None:
    # Contact of the boxes on EI-Drive's paths if all actors accelerate from standstill at 3 m/s²; in scenario 1 the
    # nose of the ego is at the truck after 10.5 m. The paths here deviate by up to half a meter.
    result = run_with_route(number)
    at = re.search(r"at (\d+\.\d+) s", verdict(result, "collision").reason)
    assert at is not None
    assert float(at[1]) == pytest.approx(time, abs=0.25)


@pytest.mark.exhaustive
@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.xosc")), ids=lambda path: path.stem)
def test_file_has_no_diagnostics(path: Path) -> None:
    report = check_scenario(path)
    assert not [*report.errors, *report.warnings, *report.notes]


def test_files_are_valid_by_the_schema() -> None:
    schema = etree.XMLSchema(etree.parse(corpora_folder() / "schema" / "OpenSCENARIOv1.2.xsd"))
    for path in sorted(FOLDER.glob("*.xosc")):
        schema.assertValid(etree.parse(path))


@pytest.mark.statistical
@pytest.mark.parametrize("number", ["03", "05", "06", "09", "11"])
def test_station_knows_the_hidden_vehicle_before_the_ego_sees_it(number: str) -> None:
    with Simulation(f"ei/scenario_{number}", seed=1, settings=WITH_ROUTE) as simulation:
        end = None
        known: list[bool] = []
        seen: list[bool] = []
        while end is None:
            frame, end = simulation.tick()
            step, row = frame.steps["Ego"], frame.view.row(OTHERS[number])
            place = frame.view.boxes[row, :2]
            for found, objects in ((known, step.fused), (seen, step.detections)):
                found.append(bool((abs(objects.boxes[:, :2] - place) < 0.5).all(axis=1).any()))
    hidden = [index for index, visible in enumerate(seen[1:90], start=1) if not visible]
    assert len(hidden) >= 10
    assert all(known[index] for index in hidden)
