"""Corner cases of the library: what messages change, and when the ego first knows the hidden actor."""

from __future__ import annotations

import pytest

from eidrive_scenario.simulation import RunResult, RunSettings, run_file

HIDDEN = {
    "cyclist_right_turn": ("rsu", "Cyclist"),
    "emergency_vehicle": ("vehicle", "Ambulance"),
    "pedestrian_parked_cars": ("vehicle", "Child"),
}
"""Senders and the actor that they report."""


def play(name: str, participants: str, seed: int = 2, **parameters: str) -> RunResult:
    settings = RunSettings(parameters={"Participants": participants, **parameters})
    return run_file(f"corner_cases/{name}", seed=seed, settings=settings)


def failed(result: RunResult) -> set[str]:
    return {verdict.name for verdict in result.criteria if not verdict.passed}


def detection(result: RunResult, actor: str) -> float:
    """Return the time at which the ego first knows an actor [s]."""
    verdict = next(verdict for verdict in result.criteria if verdict.name == "first_detection")
    assert f"first knew {actor}" in verdict.reason
    assert verdict.value is not None
    return verdict.value


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", HIDDEN)
def test_ego_with_messages_passes_and_knows_the_actor_early(name: str) -> None:
    participants, actor = HIDDEN[name]
    result = play(name, participants)
    assert not failed(result)
    assert not result.warnings
    assert detection(result, actor) < 5.0


@pytest.mark.exhaustive
def test_ego_without_messages_knows_the_child_late_and_collides() -> None:
    result = play("pedestrian_parked_cars", "none")
    assert "collision" in failed(result)
    assert detection(result, "Child") > 7.0


@pytest.mark.exhaustive
def test_emergency_braking_ends_at_standstill() -> None:
    """The cyclist appears late: the ego stops beside its way, instead of creeping into it with the last 0.4 m/s."""
    assert "collision" not in failed(play("cyclist_right_turn", "none", seed=4))


@pytest.mark.exhaustive
def test_ghost_stops_the_ego() -> None:
    assert failed(play("ghost", "rsu")) == {"min_speed"}


@pytest.mark.exhaustive
def test_wrong_place_is_not_corrected_by_a_right_report() -> None:
    assert failed(play("contradicting_senders", "both")) == {"min_speed"}


@pytest.mark.exhaustive
def test_clock_behind_by_more_than_the_report_lifetime_hides_the_crossing_car() -> None:
    result = play("wrong_clock", "rsu", ClockOffset="-2.3")
    assert "collision" in failed(result)
    assert result.metrics["messages.expired"] == result.links["RSU", "Ego"].received > 0
    assert any("does not use" in warning for warning in result.warnings)


@pytest.mark.exhaustive
def test_jammer_blocks_the_unit_from_its_start_on() -> None:
    result = play("jammer", "rsu")
    assert "collision" in failed(result)
    link = result.links["RSU", "Ego"]
    assert set(link.lost_by) == {"queue"}, "the unit is so close to the jammer that it senses a busy channel"
    assert link.received == pytest.approx(1.0 / 0.05, abs=1)
    assert link.lost == link.sent - link.received > 3 * link.received
