"""Criterion `time_limit`: the run has to end in time."""

from typing import Any

import pytest
from eidrive_criteria.time_limit import TimeLimit, TimeLimitSettings

from eidrive_scenario.api.criteria import evaluate_criteria


@pytest.mark.parametrize(("end", "passed"), [(1.0, True), (400 * 0.05, True), (20.05, False)])
def test_time_limit_passes_up_to_the_limit(frame: Any, car: Any, end: float, passed: bool) -> None:
    frames = [frame(0.0, {"Ego": car(0)}), frame(end, {"Ego": car(0)})]
    (verdict,) = evaluate_criteria(frames, [TimeLimit(TimeLimitSettings(within=20))])
    assert (verdict.passed, verdict.value, verdict.limit, verdict.unit) == (passed, end, 20.0, "s")
    assert verdict.first_violation == (None if passed else end)


def test_time_limit_violation_starts_at_the_limit(frame: Any, car: Any) -> None:
    frames = [frame(time, {"Ego": car(0)}) for time in (19.0, 21.0, 25.0)]
    (verdict,) = evaluate_criteria(frames, [TimeLimit(TimeLimitSettings(within=20, fatal=False))])
    assert (verdict.value, verdict.first_violation) == (25.0, 21.0)


@pytest.mark.parametrize(("end", "fatal", "ends_run"), [(2.0, True, True), (2.0, False, False), (0.5, True, False)])
def test_time_limit_verdict_is_fatal_only_after_a_violation(
    frame: Any, car: Any, end: float, fatal: bool, ends_run: bool
) -> None:
    criterion = TimeLimit(TimeLimitSettings(within=1, fatal=fatal))
    (verdict,) = evaluate_criteria([frame(end, {"Ego": car(0)})], [criterion])
    assert verdict.fatal is ends_run


def test_time_limit_is_fatal_by_default() -> None:
    assert TimeLimitSettings(within=1).fatal
