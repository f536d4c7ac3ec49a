"""Criterion `collision`: actors, time, position and speed of contacts."""

from typing import Any

import pytest
from eidrive_criteria.collision import Collision, CollisionSettings

from eidrive_scenario.api.common import Contact
from eidrive_scenario.api.criteria import evaluate_criteria


def criterion(**settings: Any) -> Collision:
    return Collision(CollisionSettings.model_validate({"of": "Ego", **settings}))


def test_collision_first_contact_is_the_verdict(frame: Any, car: Any) -> None:
    cars = {"Incoming": car(0), "Ego": car(9)}
    touch = Contact("Incoming", "Ego", (29.84, 7.06, 0.5), 11.24)
    frames = [frame(0.0, cars), frame(6.35, cars, [touch]), frame(6.4, cars, [Contact("Ego", "Wall", (0, 0, 0), 1.0)])]
    collision = criterion()
    (verdict,) = evaluate_criteria(frames, [collision])
    assert not verdict.passed
    assert (verdict.value, verdict.limit, verdict.first_violation) == (2.0, 0.0, 6.35)
    assert verdict.reason == (
        "Ego and Incoming hit each other at 6.35 s at (29.8, 7.1) m at a relative speed of 11.2 m/s"
    )
    assert collision.metrics() == {"collision.count": 2.0, "collision.time": 6.35, "collision.impact_speed": 11.24}


@pytest.mark.parametrize(("others", "passed"), [(None, False), ("Bus", False), ("Van", True), (["Van", "Bus"], False)])
def test_collision_with_restricts_the_actors(frame: Any, car: Any, others: Any, passed: bool) -> None:
    cars = {"Ego": car(0), "Bus": car(5), "Van": car(9)}
    (verdict,) = evaluate_criteria(
        [frame(1.0, cars, [Contact("Ego", "Bus", (0, 0, 0), 1.0)])], [criterion(**{"with": others})]
    )
    assert verdict.passed is passed


def test_collision_of_other_actors_is_ignored(frame: Any, car: Any) -> None:
    cars = {"Ego": car(0), "Bus": car(5), "Van": car(9)}
    (verdict,) = evaluate_criteria([frame(1.0, cars, [Contact("Van", "Bus", (0, 0, 0), 1.0)])], [criterion()])
    assert verdict.passed
    assert verdict.reason == "Ego touched nothing"


@pytest.mark.parametrize("settings", [{"of": "Eg0"}, {"with": "Incoming"}, {"with": ["Bus", "Incoming"]}])
def test_collision_of_absent_actor_fails(frame: Any, car: Any, settings: dict[str, Any]) -> None:
    (verdict,) = evaluate_criteria([frame(0.0, {"Ego": car(0), "Bus": car(9)})], [criterion(**settings)])
    assert not verdict.passed
    assert "never present" in verdict.reason


def test_collision_is_fatal_at_contact_only(frame: Any, car: Any) -> None:
    criterion_under_test = criterion(**{"with": "Incoming", "fatal": True})
    (waiting,) = evaluate_criteria([frame(0.0, {"Ego": car(0)})], [criterion_under_test])
    cars = {"Ego": car(0), "Incoming": car(9)}
    (hit,) = evaluate_criteria([frame(1.0, cars, [Contact("Ego", "Incoming", (0, 0, 0), 1.0)])], [criterion_under_test])
    assert (waiting.passed, waiting.fatal, hit.passed, hit.fatal) == (False, False, False, True)


def test_collision_actor_may_be_added_later(frame: Any, car: Any) -> None:
    frames = [frame(0.0, {"Ego": car(0)}), frame(1.0, {"Ego": car(0), "Incoming": car(9)}), frame(2.0, {"Ego": car(0)})]
    (verdict,) = evaluate_criteria(frames, [criterion(**{"with": "Incoming"})])
    assert verdict.passed
