"""Criterion `time_to_collision`: boxes 4 m by 2 m on straight courses, times calculated by hand."""

import math
from typing import Any

import pytest
from eidrive_criteria.time_to_collision import TimeToCollision, TimeToCollisionSettings, time_to_contact

from eidrive_scenario.api.criteria import evaluate_criteria


def box(x: float, y: float = 0.0, yaw: float = 0.0, z: float = 0.75) -> list[float]:
    return [x, y, z, 4.0, 2.0, 1.5, yaw]


@pytest.mark.parametrize(
    ("other", "velocity", "expected"),
    [
        (box(14), (-5, 0, 0), 2.0),  # a gap of 10 m closes at 5 m/s
        (box(14), (5, 0, 0), math.inf),  # away
        (box(14), (0, 0, 0), math.inf),  # standing still
        (box(14, 2.5), (-5, 0, 0), math.inf),  # passes at 0.5 m
        (box(13, yaw=math.pi / 2), (-5, 0, 0), 2.0),  # broadside: half a length and half a width are 3 m
        (box(0, 13, -math.pi / 2), (0, -5, 0), 2.0),  # crosses into the side: 13 - 1 - 2
        (box(8, 9), (-4, -7, 0), 1.0),  # both axes must close: x after 1 s, y after 1 s
        (box(0, 13, -math.pi / 2), (30, -5, 0), math.inf),  # has crossed ahead before it is near
        (box(1), (-5, 0, 0), 0.0),  # overlaps already
        (box(14, z=5.0), (-5, 0, 0), math.inf),  # on a bridge
        (box(24), (-5, 0, 0), 4.0),  # 15 m/s behind 10 m/s, gap 20 m
        (box(16), (-8, 0, 0), 1.5),  # 8 m/s towards a standing car, gap 12 m
    ],
)
def test_time_to_contact(other: list[float], velocity: tuple[float, float, float], expected: float) -> None:
    assert time_to_contact(box(0), other, velocity) == pytest.approx(expected)


def test_time_to_contact_of_successive_passages_is_infinite() -> None:
    """The ego is in the common zone from 2.000 s to 3.433 s, the other one from 4.286 s on."""
    ego = [-2.0 - 12.0 - 2.3, 0.0, 0.75, 4.6, 3.0, 1.5, 0.0]
    other = [0.0, -1.5 - 30.0 - 2.4, 0.75, 4.8, 4.0, 1.5, math.pi / 2]
    assert time_to_contact(ego, other, (-6.0, 7.0, 0.0)) == math.inf
    other[1] += 16.0
    assert time_to_contact(ego, other, (-6.0, 7.0, 0.0)) == pytest.approx(2.0), "both arrive after 2 s"


def criterion(**settings: Any) -> TimeToCollision:
    return TimeToCollision(TimeToCollisionSettings.model_validate({"of": "Ego", "to": "Lead", **settings}))


def test_time_to_collision_minimum_is_compared(frame: Any, car: Any) -> None:
    frames = [
        frame(0.0, {"Ego": car(0, speed=10), "Lead": car(34, speed=5)}),  # 30 m at 5 m/s
        frame(1.0, {"Ego": car(10, speed=10), "Lead": car(24, speed=5)}),  # 10 m at 5 m/s
        frame(2.0, {"Ego": car(20, speed=4), "Lead": car(29, speed=5)}),  # opens
    ]
    minimum = criterion(at_least=2.5)
    (verdict,) = evaluate_criteria(frames, [minimum])
    assert (verdict.passed, verdict.first_violation) == (False, 1.0)
    assert verdict.value == pytest.approx(2.0)
    assert minimum.metrics() == {"time_to_collision.Ego.Lead": pytest.approx(2.0)}


def test_time_to_collision_without_collision_course_passes(frame: Any, car: Any) -> None:
    (verdict,) = evaluate_criteria([frame(0.0, {"Ego": car(0), "Lead": car(9)})], [criterion(at_least=2)])
    assert (verdict.passed, verdict.value) == (True, None)


def test_time_to_collision_of_absent_actor_fails(frame: Any, car: Any) -> None:
    (verdict,) = evaluate_criteria([frame(0.0, {"Ego": car(0)})], [criterion(at_least=2)])
    assert not verdict.passed
    assert verdict.reason.startswith("Lead was never present")
