"""Criterion `min_distance`: distances of boxes 4 m by 2 m, calculated by hand."""

import math
from typing import Any

import pytest
from eidrive_criteria.min_distance import MinDistance, MinDistanceSettings

from eidrive_scenario.api.criteria import Verdict, evaluate_criteria
from eidrive_scenario.simulation.run_outcome import criteria_metrics


def criterion(**settings: Any) -> MinDistance:
    return MinDistance(MinDistanceSettings.model_validate({"of": "Ego", "to": "Incoming", **settings}))


def passing(frame: Any, car: Any) -> list[Any]:
    """Return frames in which Incoming crosses from left to right, 10 m ahead at first and 5 m ahead at 2 s."""
    places = [car(10, 10, -math.pi / 2), car(8, 4, -math.pi / 2), car(5, 0, -math.pi / 2), car(5, -8, -math.pi / 2)]
    return [frame(float(second), {"Ego": car(0), "Incoming": place}) for second, place in enumerate(places)]


def test_min_distance_measures_center_and_box(frame: Any, car: Any) -> None:
    distance = criterion(measure="center")
    (verdict,) = evaluate_criteria(passing(frame, car), [distance])
    # Perpendicular at 2 s: half of Ego's length is 2 m, half of Incoming's width 1 m.
    assert verdict == Verdict(
        "min_distance",
        True,
        5.0,
        None,
        "m",
        None,
        "Ego and Incoming came within 5.00 m (center to center) at 2.00 s, boxes within 2.00 m",
    )
    assert distance.metrics() == {
        "min_distance.Ego.Incoming.center": 5.0,
        "min_distance.Ego.Incoming.box": pytest.approx(2.0),
        "min_distance.Ego.Incoming.time": 2.0,
    }


@pytest.mark.parametrize(
    ("measure", "at_least", "violated"),
    [("center", 5.0, None), ("center", 5.01, 2.0), ("center", 9.0, 1.0), ("box", 1.99, None), ("box", 2.01, 2.0)],
)
def test_min_distance_limit_is_violated_below_at_least(
    frame: Any, car: Any, measure: str, at_least: float, violated: float | None
) -> None:
    (verdict,) = evaluate_criteria(passing(frame, car), [criterion(measure=measure, at_least=at_least)])
    assert verdict.passed is (violated is None)
    assert verdict.first_violation == violated
    assert verdict.limit == at_least


def test_min_distance_by_default_measures_between_bodies(frame: Any, car: Any) -> None:
    (verdict,) = evaluate_criteria(passing(frame, car), [criterion(at_least=2.5)])
    assert (verdict.passed, verdict.first_violation) == (False, 2.0)
    assert verdict.value == pytest.approx(2.0)
    assert verdict.reason == "Ego and Incoming came within 2.00 m (box to box) at 2.00 s, centers within 5.00 m"


def test_min_distance_of_a_crash_fails_every_limit_by_default(frame: Any, car: Any) -> None:
    """Perpendicular impact on the center of the other's side: the centers are 3 m apart."""
    crash = [frame(0.0, {"Ego": car(0), "Incoming": car(3, 0, math.pi / 2)})]
    assert [verdict.passed for verdict in evaluate_criteria(crash, [criterion(at_least=0.01)])] == [False]
    assert [verdict.passed for verdict in evaluate_criteria(crash, [criterion(at_least=2.9, measure="center")])] == [
        True
    ]


def test_min_distance_of_overlapping_boxes_is_zero(frame: Any, car: Any) -> None:
    (verdict,) = evaluate_criteria(
        [frame(0.0, {"Ego": car(0), "Incoming": car(3, 1)})], [criterion(measure="box", at_least=0.1)]
    )
    assert not verdict.passed
    assert verdict.value == 0.0


def test_min_distance_of_absent_actor_fails(frame: Any, car: Any) -> None:
    (verdict,) = evaluate_criteria([frame(0.0, {"Ego": car(0)})], [criterion(at_least=1.0)])
    assert (verdict.passed, verdict.value) == (False, None)
    assert verdict.reason == "Incoming was never present, so nothing was measured"


def test_min_distance_without_common_presence_fails(frame: Any, car: Any) -> None:
    distance = criterion()
    (verdict,) = evaluate_criteria([frame(0.0, {"Ego": car(0)}), frame(1.0, {"Incoming": car(0)})], [distance])
    assert not verdict.passed
    assert verdict.reason == "Ego and Incoming were never present at the same time"
    assert distance.metrics() == {}


def test_two_measures_of_a_pair_have_a_time_each(frame: Any, car: Any) -> None:
    """Beside Ego the centers are 3.9 m and the bodies 1.9 m apart, ahead of it 4.5 m and 0.5 m."""
    places = enumerate([car(0.0, 3.9), car(4.5, 0.0)])
    frames = [frame(float(second), {"Ego": car(0.0), "Incoming": place}) for second, place in places]
    criteria = [criterion(measure="center"), criterion(measure="box", name="min_distance_2")]
    evaluate_criteria(frames, criteria)
    assert criteria_metrics(criteria) == {
        "min_distance.Ego.Incoming.center": pytest.approx(3.9),
        "min_distance.Ego.Incoming.box": pytest.approx(0.5),
        "min_distance.Ego.Incoming.time": 0.0,
        "min_distance_2.Ego.Incoming.time": 1.0,
    }
