"""Outcomes of the library scenarios: those that the paper reports, and those that follow from their situation."""

from __future__ import annotations

import re

import pytest

from eidrive_scenario.simulation import RunResult, RunSettings, run_file


def play(name: str, seed: int = 1, **parameters: str) -> RunResult:
    return run_file(name, seed=seed, settings=RunSettings(parameters=parameters))


def passed(result: RunResult) -> dict[str, bool]:
    return {verdict.name: verdict.passed for verdict in result.criteria}


@pytest.mark.exhaustive
@pytest.mark.parametrize("number", [5, 6, 7, 8])
@pytest.mark.parametrize(("participants", "avoided"), [("none", False), ("rsu", True)])
def test_roadside_unit_avoids_the_collision_in_traffic(number: int, participants: str, avoided: bool) -> None:
    result = play(f"coop/scenario_{number}", seed=2, Participants=participants)
    assert passed(result) == {"collision": avoided, "min_distance": True, "reached_region": avoided}
    assert not result.warnings


@pytest.mark.exhaustive
def test_spectator_behind_the_bus_does_not_help() -> None:
    """The variation of the start of the bus hides the incoming car in one seed, and not in the other."""
    assert not passed(play("coop/scenario_5", seed=7, Participants="vehicle"))["collision"]
    assert passed(play("coop/scenario_5", seed=3, Participants="vehicle"))["collision"]


@pytest.mark.exhaustive
@pytest.mark.parametrize("number", [7, 8])
def test_spectator_behind_three_buses_does_not_help(number: int) -> None:
    """With buses that start 95 m farther back, and without other traffic, it sees the incoming car."""
    scenario = f"coop/scenario_{number}"
    assert not passed(play(scenario, seed=7, Participants="vehicle"))["collision"]
    assert passed(play(scenario, seed=7, Participants="vehicle", BusStart="-120", Traffic="0"))["collision"]


@pytest.mark.exhaustive
@pytest.mark.parametrize(("number", "participants"), [(3, "vehicle"), (4, "rsu")])
def test_participants_increase_the_number_of_known_vehicles(number: int, participants: str) -> None:
    alone, joined = (play(f"coop/scenario_{number}", Participants=name) for name in ("none", participants))
    assert passed(alone) == {"detection_count": False, "own_detection_count": True}
    assert passed(joined) == {"detection_count": True, "own_detection_count": True}
    assert joined.metrics["own_detection_count.Ego.mean"] == alone.metrics["own_detection_count.Ego.mean"]
    assert joined.metrics["detection_count.Ego.mean"] > alone.metrics["detection_count.Ego.mean"]


@pytest.mark.exhaustive
@pytest.mark.parametrize(("number", "participants"), [(1, "rsu"), (2, "vehicle")])
def test_participants_decide_on_the_collision_without_traffic(number: int, participants: str) -> None:
    alone, joined = (play(f"coop/scenario_{number}", Participants=name) for name in ("none", participants))
    assert not passed(alone)["collision"]
    assert passed(joined)["collision"]
    assert alone.metrics["messages.sent"] == 0
    assert joined.metrics["messages.sent"] > 0


@pytest.mark.exhaustive
@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize(("number", "other"), [(1, "First"), (2, "Lead")])
def test_lane_follower_hits_the_slower_vehicle(number: int, other: str, seed: int) -> None:
    result = play(f"pipeline/scenario_{number}", seed, Planner="route")
    assert [name for name, success in passed(result).items() if success] == ["time_limit"]
    assert f"Ego and {other} hit each other" in result.criteria[0].reason


@pytest.mark.exhaustive
@pytest.mark.parametrize(("detector", "seed"), [("ssd", 1), ("yolov5", 2)])
def test_images_are_sufficient_to_overtake(detector: str, seed: int) -> None:
    """Every such run of the paper completes the task."""
    assert run_file("pipeline/scenario_1", seed=seed, settings=RunSettings(detector=detector)).passed


@pytest.mark.exhaustive
@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize(("number", "rule"), [(3, "running_red_light"), (4, "running_stop_sign")])
def test_signal_criterion_depends_on_obedience_only(number: int, rule: str, seed: int) -> None:
    name = f"pipeline/scenario_{number}"
    obeying, ignoring = (play(name, seed, ObeySignals=value, Planner="route") for value in ("true", "false"))
    assert obeying.passed
    assert [name for name, success in passed(ignoring).items() if not success] == [rule]


def test_time_at_the_stop_line_is_that_of_the_original_distance() -> None:
    """The line is 48.9 m ahead of the center in EI-Drive; 3.33 m/s is reached at 3 m/s². Sites deviate by 0.75 m."""
    result = play("pipeline/scenario_3", ObeySignals="false", Planner="route", EgoOffset="0", EgoSpeedOffset="0")
    at = re.search(r"at (\d+\.\d+) s", result.criteria[0].reason)
    assert at is not None
    expected = (48.9 - 4.892 / 2) / 3.3333 + 3.3333 / (2 * 3.0)
    assert float(at[1]) == pytest.approx(expected, abs=0.75 / 3.3333 + 0.05)


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    "name", ["coop/scenario_1", "coop/scenario_2", *(f"pipeline/scenario_{number}" for number in range(1, 5))]
)
def test_planner_behavior_passes(name: str) -> None:
    assert play(name, Planner="behavior").passed
