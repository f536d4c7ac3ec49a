"""Criterion `detection_count`: hand-made objects and actors, and scenario 1 with and without cooperation."""

from typing import Any

import pytest
from eidrive_criteria.detection_count import DetectionCount, DetectionCountSettings
from pydantic import ValidationError

from eidrive_scenario.api.criteria import Verdict, evaluate_criteria


def count(frames: list[Any], **settings: Any) -> Verdict:
    (verdict,) = evaluate_criteria(frames, [DetectionCount(DetectionCountSettings(of="Ego", **settings))])
    return verdict


@pytest.fixture
def frames(frame: Any, car: Any, perceived: Any) -> list[Any]:
    """Two cars and a pedestrian. Own objects: 1, 2 and 0 of the cars; fused objects: 2, 3 and 1 of all actors."""
    actors = {"Ego": car(0), "A": car(20), "B": car(20, 5), "Walker": car(10, -5)}
    classes = {"Walker": "pedestrian"}
    own = [[(20, 0)], [(20, 0), (20, 5)], []]
    fused = [[(20, 0), (10, -5)], [(20, 0), (20, 5), (10, -5)], [(20, 5)]]
    return [
        perceived(frame(float(second), actors, categories=classes), "Ego", own=own[second], fused=fused[second])
        for second in range(3)
    ]


@pytest.mark.parametrize(
    ("settings", "value"),
    [
        ({"source": "own"}, 1.0),
        ({"source": "own", "measure": "min"}, 0.0),
        ({"source": "own", "measure": "max"}, 2.0),
        ({"source": "own", "measure": "total"}, 2.0),
        ({}, 4 / 3),
        ({"classes": ["pedestrian"]}, 2 / 3),
        ({"classes": ["pedestrian", "car"], "measure": "total"}, 3.0),
        ({"measure": "min"}, 1.0),
        ({"after": 1.0}, 1.5),
        ({"min_confidence": 1.0}, 4 / 3),
    ],
)
def test_vehicles_of_each_source_are_counted(frames: list[Any], settings: dict[str, Any], value: float) -> None:
    verdict = count(frames, **settings)
    assert verdict.value == pytest.approx(value)
    assert verdict.passed


def test_limits(frames: list[Any]) -> None:
    assert count(frames, at_least=1.3, at_most=1.4).passed
    verdict = count(frames, at_least=1.4)
    assert (verdict.passed, verdict.limit, verdict.first_violation) == (False, 1.4, None)
    verdict = count(frames, measure="min", at_least=1.5, fatal=True)
    assert (verdict.passed, verdict.first_violation, verdict.fatal) == (False, 0.0, True)
    verdict = count(frames, measure="max", at_most=1, fatal=True)
    assert (verdict.passed, verdict.first_violation, verdict.limit) == (False, 1.0, 1.0)
    assert count(frames, measure="total", at_least=2, fatal=True).passed


def test_duplicates_false_objects_and_the_own_body_do_not_count(frame: Any, car: Any, perceived: Any) -> None:
    """Two objects of A, one far from all actors, one at the Ego, one 2.5 m from the center of B."""
    points = [(20.5, 0.0), (19.5, 0.0), (60.0, 0.0), (0.0, 0.0), (20.0, 12.5)]
    actors = {"Ego": car(0), "A": car(20), "B": car(20, 10)}
    frames = [perceived(frame(0.0, actors), "Ego", fused=points)]
    assert count(frames).value == 1.0
    assert count(frames, within=2.5).value == 2.0


def test_score_below_the_minimum_does_not_count(frame: Any, car: Any, perceived: Any) -> None:
    frames = [perceived(frame(0.0, {"Ego": car(0), "A": car(20)}), "Ego", fused=[(20, 0)], score=0.4)]
    assert count(frames, min_confidence=0.4).value == 1.0
    assert count(frames, min_confidence=0.41).value == 0.0


def test_station_without_perception_fails(frames: list[Any], frame: Any, car: Any) -> None:
    for given, text in (
        ([frame(0.0, {"Ego": car(0)})], "has no driving stack"),
        ([frame(0.0, {"Other": car(0)})], "was never present"),
        ([], "was never present"),
    ):
        verdict = count(given)
        assert (verdict.passed, verdict.value) == (False, None)
        assert text in verdict.reason
    assert "from 9.00 s on" in count(frames, after=9.0).reason


def test_limits_in_reverse_order_are_refused() -> None:
    with pytest.raises(ValidationError, match="exceeds"):
        DetectionCountSettings(of="Ego", at_least=3, at_most=2)
