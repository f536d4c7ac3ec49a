"""Criteria on position, driven distance and speed of an actor."""

from typing import Any

import pytest
from eidrive_criteria.driven_distance import DrivenDistance, DrivenDistanceSettings
from eidrive_criteria.max_speed import MaxSpeed, MaxSpeedSettings
from eidrive_criteria.reach_position import ReachPosition, ReachPositionSettings

from eidrive_scenario.api.criteria import Criterion, evaluate_criteria


def reach(**settings: Any) -> ReachPosition:
    return ReachPosition(ReachPositionSettings.model_validate({"of": "Ego", "x": 10, "y": 3, **settings}))


def driving(frame: Any, car: Any) -> list[Any]:
    """Return frames at 5 m/s along x from the origin, 4 s long."""
    return [frame(float(second), {"Ego": car(5.0 * second, speed=5.0)}) for second in range(5)]


@pytest.mark.parametrize(
    ("settings", "passed", "nearest"),
    [
        ({"within": 3}, True, 3.0),
        ({"within": 3, "by": 8}, True, 3.0),
        ({"within": 2.9}, False, 3.0),
        ({"within": 3, "by": 1.5}, False, 34**0.5),
    ],
)
def test_reach_position_depends_on_tolerance_and_deadline(
    frame: Any, car: Any, settings: dict[str, Any], passed: bool, nearest: float
) -> None:
    criterion = reach(**settings)
    (verdict,) = evaluate_criteria(driving(frame, car), [criterion])
    assert verdict.passed is passed
    assert verdict.value == pytest.approx(nearest)
    by = settings.get("by")
    margin = 1.0 if by is None else 1.0 - 2.0 / by
    assert criterion.metrics() == ({"reach_position.time": 2.0, "reach_position.margin": margin} if passed else {})


def test_reach_position_is_fatal_after_the_deadline_only(frame: Any, car: Any) -> None:
    criterion = reach(within=1, by=2.5, fatal=True)
    frames = driving(frame, car)
    assert [evaluate_criteria([each], [criterion])[0].fatal for each in frames] == [False, False, False, True, True]


def test_driven_distance_is_compared_with_at_least(frame: Any, car: Any) -> None:
    """Without it, the distance is measured only."""
    limits = (20.0, 20.1, None)
    criteria = [DrivenDistance(DrivenDistanceSettings(of="Ego", at_least=meters)) for meters in limits]
    verdicts = evaluate_criteria(driving(frame, car), criteria)
    assert [(verdict.passed, verdict.limit) for verdict in verdicts] == [(True, 20.0), (False, 20.1), (True, None)]
    assert [verdict.value for verdict in verdicts] == pytest.approx([20.0] * 3)
    assert [criterion.demands_progress for criterion in criteria] == [True, True, False]


def test_metrics_of_driven_distances_with_different_deadlines_are_separate(frame: Any, car: Any) -> None:
    """10 m at 2 s, 20 m at 4 s."""
    whole = DrivenDistance(DrivenDistanceSettings(of="Ego", at_least=20.0))
    early = DrivenDistance(DrivenDistanceSettings(of="Ego", at_least=10.0, by=2.0, name="early"))
    evaluate_criteria(driving(frame, car), [whole, early])
    assert {**whole.metrics(), **early.metrics()} == {"driven_distance.Ego": 20.0, "early.Ego": 10.0}


def test_driven_distance_excludes_teleports(frame: Any, car: Any) -> None:
    criterion = DrivenDistance(DrivenDistanceSettings(of="Ego", at_least=50))
    (verdict,) = evaluate_criteria([frame(0.0, {"Ego": car(0)}), frame(1.0, {"Ego": car(100)})], [criterion])
    assert (verdict.passed, verdict.value) == (False, 0.0)


def test_driven_distance_excludes_absence(frame: Any, car: Any) -> None:
    """The actor drives 5 m, is absent for 8 s, and drives 10 m more."""
    criterion = DrivenDistance(DrivenDistanceSettings(of="Ego", at_least=20))
    times, away = [0.0, 1.0, 2.0, 9.0, 10.0, 12.0], {"Other": car(0)}
    frames = [frame(time, away if 1.0 < time < 10.0 else {"Ego": car(0, speed=5.0)}) for time in times]
    (verdict,) = evaluate_criteria(frames, [criterion])
    assert not verdict.passed
    assert verdict.value == pytest.approx(15.0)
    (verdict,) = evaluate_criteria([frame(13.0, away)], [criterion])
    assert verdict.value == pytest.approx(15.0)


def test_max_speed_includes_backward_motion(frame: Any, car: Any) -> None:
    criterion = MaxSpeed(MaxSpeedSettings(of="Ego", at_most=6))
    frames = [*driving(frame, car), frame(5.0, {"Ego": car(0, speed=-7.0)})]
    (verdict,) = evaluate_criteria(frames, [criterion])
    assert (verdict.passed, verdict.value, verdict.first_violation) == (False, 7.0, 5.0)


@pytest.mark.parametrize(
    "criterion",
    [
        reach(),
        DrivenDistance(DrivenDistanceSettings(of="Ego", at_least=1)),
        MaxSpeed(MaxSpeedSettings(of="Ego", at_most=99)),
    ],
    ids=lambda criterion: criterion.name,
)
def test_progress_criteria_of_absent_actor_fail(frame: Any, car: Any, criterion: Criterion) -> None:
    (verdict,) = evaluate_criteria([frame(0.0, {"Bus": car(0)})], [criterion])
    assert (verdict.passed, verdict.value) == (False, None)
    assert verdict.reason == "Ego was never present, so nothing was measured"
    assert criterion.metrics() == {}
