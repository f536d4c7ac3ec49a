"""Criteria `min_speed`, `average_speed` and `reached_region`."""

from typing import Any

import pytest
from eidrive_criteria.average_speed import AverageSpeed, AverageSpeedSettings
from eidrive_criteria.min_speed import MinSpeed, MinSpeedSettings
from eidrive_criteria.reached_region import ReachedRegion, ReachedRegionSettings
from pydantic import ValidationError

from eidrive_scenario.api.criteria import Criterion, Verdict, evaluate_criteria


def judge(criterion: Criterion, frames: list[Any]) -> Verdict:
    (verdict,) = evaluate_criteria(frames, [criterion])
    return verdict


def speeds(frame: Any, car: Any, *values: float) -> list[Any]:
    return [frame(float(second), {"Ego": car(0.0, speed=value)}) for second, value in enumerate(values)]


def min_speed(**settings: Any) -> MinSpeed:
    return MinSpeed(MinSpeedSettings(of="Ego", **settings))


def average(**settings: Any) -> AverageSpeed:
    return AverageSpeed(AverageSpeedSettings(of="Ego", **settings))


def region(*corners: tuple[float, float], **settings: Any) -> ReachedRegion:
    return ReachedRegion(ReachedRegionSettings(of="Ego", region=corners, **settings))


def test_min_speed_is_required_after_a_time(frame: Any, car: Any) -> None:
    frames = speeds(frame, car, 0.0, 4.0, 3.0, -5.0)
    assert judge(min_speed(at_least=3.0, after=1.0), frames).passed
    verdict = judge(min_speed(at_least=3.5, after=1.0), frames)
    assert (verdict.passed, verdict.value, verdict.first_violation) == (False, 3.0, 2.0)
    assert judge(min_speed(at_least=1.0), frames).first_violation == 0.0
    early, late = min_speed(), min_speed(after=1.0, name="late")
    evaluate_criteria(frames, [early, late])
    assert {**early.metrics(), **late.metrics()} == {"min_speed.Ego": 0.0, "late.Ego": 3.0}
    verdict = judge(min_speed(after=9.0), frames)
    assert (verdict.passed, verdict.value) == (False, None)
    assert "from 9.00 s on" in verdict.reason


def test_average_speed_is_distance_over_time(frame: Any, car: Any) -> None:
    """(5 + 10 + 10) m in 3 s."""
    frames = speeds(frame, car, 0.0, 10.0, 10.0, 10.0)
    assert judge(average(), frames).value == pytest.approx(25 / 3)
    assert judge(average(at_least=8.3, at_most=8.4), frames).passed
    assert not judge(average(at_least=8.4), frames).passed
    verdict = judge(average(at_least=1.0, at_most=8.3), frames)
    assert (verdict.passed, verdict.limit) == (False, 8.3)


@pytest.mark.parametrize(("speed", "limit"), [(1.0, 2.0), (2.5, 2.0), (6.99, 7.0), (8.0, 7.0)])
def test_verdict_states_the_nearer_one_of_two_limits(frame: Any, car: Any, speed: float, limit: float) -> None:
    assert judge(average(at_least=2.0, at_most=7.0), speeds(frame, car, speed)).limit == limit


def test_average_speed_in_one_frame_and_with_absence(frame: Any, car: Any) -> None:
    assert judge(average(at_least=7.0), speeds(frame, car, 7.0)).value == 7.0
    frames = speeds(frame, car, 4.0, 4.0)
    frames += [frame(5.0, {"Other": car(0)}), *(frame(t, {"Ego": car(90, speed=8.0)}) for t in (9.0, 10.0))]
    assert judge(average(), frames).value == pytest.approx(6.0)


@pytest.mark.parametrize(
    ("corners", "arrival"),
    [
        ([(10, -1), (20, 1)], 2.0),
        ([(20, 1), (10, -1)], 2.0),
        ([(10, 2), (20, 4)], None),
        ([(12, -1), (18, -1), (15, 5)], 3.0),
    ],
)
def test_region_is_reached_by_the_center(frame: Any, car: Any, corners: Any, arrival: float | None) -> None:
    frames = [frame(float(second), {"Ego": car(5.0 * second + 0.1)}) for second in range(5)]
    verdict = judge(region(*corners), frames)
    assert (verdict.passed, verdict.value) == (arrival is not None, arrival)


def test_region_has_a_deadline(frame: Any, car: Any) -> None:
    frames = [frame(float(second), {"Ego": car(5.0 * second + 0.1)}) for second in range(5)]
    assert judge(region((10, -1), (20, 1), by=2.0), frames).passed
    verdict = judge(region((10, -1), (20, 1), by=1.5, fatal=True), frames)
    assert (verdict.passed, verdict.fatal) == (False, True)
    assert not judge(region((10, -1), (20, 1), by=2.0, fatal=True), frames).fatal


def test_settings_are_checked() -> None:
    with pytest.raises(ValidationError, match="no area"):
        ReachedRegionSettings(of="Ego", region=((0, 0), (0, 5)))
    with pytest.raises(ValidationError, match="exceeds"):
        AverageSpeedSettings(of="Ego", at_least=5, at_most=4)


@pytest.mark.parametrize("criterion", [min_speed(), average(), region((0, 0), (1, 1))], ids=lambda each: each.name)
def test_absent_actor_fails(frame: Any, car: Any, criterion: Criterion) -> None:
    verdict = judge(criterion, [frame(0.0, {"Bus": car(0)})])
    assert (verdict.passed, verdict.value) == (False, None)
    assert verdict.reason == "Ego was never present, so nothing was measured"
    assert criterion.metrics() == {}
