"""Corner cases of the library: what messages change, and when the ego first knows the hidden actor."""

from __future__ import annotations

import pytest

from eidrive_scenario.simulation import RunResult, RunSettings, run_file

HIDDEN = {
    "cyclist_right_turn": ("rsu", "Cyclist"),
    "emergency_vehicle": ("vehicle", "Ambulance"),
    "jam_end": ("vehicle", "Right1"),
    "pedestrian_parked_cars": ("vehicle", "Child"),
    "tunnel_breakdown": ("vehicle", "Truck"),
    "wrong_way_driver": ("rsu", "WrongWay"),
}
"""Senders and the actor that they report."""


def play(name: str, participants: str, seed: int = 2) -> RunResult:
    return run_file(f"corner_cases/{name}", seed=seed, settings=RunSettings(parameters={"Participants": participants}))


def failed(result: RunResult) -> set[str]:
    return {verdict.name for verdict in result.criteria if not verdict.passed}


def detection(result: RunResult, actor: str) -> float:
    """Return the time at which the ego first knows an actor [s]."""
    verdict = next(verdict for verdict in result.criteria if verdict.name == "first_detection")
    assert f"first knew {actor}" in verdict.reason
    assert verdict.value is not None
    return verdict.value


@pytest.mark.parametrize("name", HIDDEN)
def test_ego_with_messages_passes_and_knows_the_actor_early(name: str) -> None:
    participants, actor = HIDDEN[name]
    result = play(name, participants)
    assert not failed(result)
    assert not result.warnings
    assert detection(result, actor) < 5.0


@pytest.mark.parametrize("name", ["jam_end", "pedestrian_parked_cars"])
def test_ego_without_messages_knows_the_actor_late_and_collides(name: str) -> None:
    result = play(name, "none")
    assert "collision" in failed(result)
    assert detection(result, HIDDEN[name][1]) > 7.0
