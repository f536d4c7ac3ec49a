"""Obstructed crossings of the library: visibility, time of braking, participants."""

from __future__ import annotations

import re

import pytest

from eidrive_scenario.api.run import RunResult, RunSettings, Simulation, load_distribution, run_file
from eidrive_scenario.errors import InputError
from eidrive_scenario.extensions.library import library_path

CROSSINGS = {"crossing_car": ("Other", "OtherKmh", 25.0), "crossing_child": ("Walker", "WalkerKmh", 3.8)}
"""Hidden actor, parameter of its speed, and distance of the conflict area's beginning from the meeting point [m]."""


def play(name: str, seed: int = 1, **parameters: object) -> RunResult:
    settings = RunSettings(parameters={key: str(value) for key, value in parameters.items()}, planner="conflict_area")
    return run_file(f"ncap/{name}", seed=seed, settings=settings)


def failed(result: RunResult) -> list[str]:
    return [verdict.name for verdict in result.criteria if not verdict.passed]


def braking_time(name: str, **parameters: str) -> float:
    """Return the time at which the ego is slower by 0.3 m/s than at the start."""
    with Simulation(f"ncap/{name}", settings=RunSettings(parameters=parameters, planner="conflict_area")) as simulation:
        frame, end = simulation.tick()
        row = frame.view.row("Ego")
        first = frame.view.states[row].velocity_x
        while end is None:
            frame, end = simulation.tick()
            if frame.view.states[frame.view.row("Ego")].velocity_x < first - 0.3:
                return frame.view.time
    raise AssertionError("the ego did not brake")


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    ("name", "speeds"),
    [
        ("crossing_car", {"EgoKmh": 55, "OtherKmh": 50}),
        ("crossing_child", {"EgoKmh": 50, "WalkerKmh": 6}),
    ],
)
@pytest.mark.parametrize("participants", ["none", "vehicle", "rsu", "both"])
def test_any_participant_avoids_the_collision(name: str, speeds: dict[str, object], participants: str) -> None:
    result = play(name, 1, Participants=participants, **speeds)
    assert failed(result) == (["collision", "reach_position"] if participants == "none" else [])
    assert not result.warnings


@pytest.mark.parametrize("latency", [0.0, 0.1, 0.3, 0.5])
@pytest.mark.parametrize("name", CROSSINGS)
def test_braking_begins_when_the_message_about_the_area_arrives(name: str, latency: float) -> None:
    """A message takes at least one time step. The brake needs up to two more for the first 0.3 m/s at 5 m/s²."""
    _, parameter, depth = CROSSINGS[name]
    lead_time, speed = 5.0, {"crossing_car": 40.0, "crossing_child": 5.0}[name]
    given = {"LeadTime": str(lead_time), parameter: str(speed), "Latency": str(latency), "Participants": "rsu"}
    expected = lead_time - depth / (speed / 3.6) + max(latency, 0.05) + 0.3 / 5.0
    assert braking_time(name, **given) == pytest.approx(expected, abs=0.16)


@pytest.mark.exhaustive
@pytest.mark.parametrize(("name", "parameter"), [("crossing_car", "OtherKmh"), ("crossing_child", "WalkerKmh")])
def test_latency_costs_the_gain_at_high_speeds_only(name: str, parameter: str) -> None:
    slow, fast = {"crossing_car": (25, 60), "crossing_child": (3, 8)}[name]
    for speed, expected in ((slow, []), (fast, ["collision", "reach_position"])):
        parameters: dict[str, object] = {"EgoKmh": 60, parameter: speed, "Latency": 0.5}
        assert failed(play(name, 1, **parameters)) == expected


@pytest.mark.parametrize("name", CROSSINGS)
def test_both_meet_after_the_lead_time_without_a_reaction(name: str) -> None:
    """The bodies touch before the centers meet: by half a length and half a width at most."""
    other, parameter, _ = CROSSINGS[name]
    speed = {"crossing_car": 36.0, "crossing_child": 6.0}[name]
    settings = RunSettings(parameters={"EgoKmh": "36", parameter: str(speed), "LeadTime": "4"}, planner="route")
    (collision, *_) = run_file(f"ncap/{name}", settings=settings).criteria
    at = re.search(rf"Ego and {other} hit each other at (\d+\.\d+) s", collision.reason)
    assert at is not None
    assert 4.0 - (4.892 + 1.837) / 2 / 10.0 - 0.1 <= float(at[1]) <= 4.0


@pytest.mark.parametrize(
    ("name", "count"),
    [
        ("crossing_car_grid", 9 * 9),
        ("crossing_child_grid", 11 * 6),
        ("crossing_car_participants", 4 * 3 * 3),
        ("crossing_child_participants", 4 * 3 * 3),
    ],
)
def test_distribution_varies_both_speeds(name: str, count: int) -> None:
    runs = load_distribution(library_path() / "ncap" / f"{name}.xosc")
    assert len(runs) == count
    assert {"EgoKmh", CROSSINGS[name.rpartition("_")[0]][1]} <= runs[0].parameters.keys()


@pytest.mark.parametrize("name", CROSSINGS)
@pytest.mark.parametrize(("parameter", "value"), [("EgoKmh", "0"), ("LeadTime", "30"), ("Latency", "-0.1")])
def test_value_outside_the_constraints_is_an_error(name: str, parameter: str, value: str) -> None:
    with pytest.raises(InputError, match=parameter):
        play(name, 1, **{parameter: value})
