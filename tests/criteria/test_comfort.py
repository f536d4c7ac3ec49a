"""Criteria `comfort` and `actor_blocked`: motions whose derivatives are constant."""

from collections.abc import Callable
from typing import Any

import pytest
from eidrive_criteria.actor_blocked import ActorBlocked, ActorBlockedSettings
from eidrive_criteria.comfort import Comfort, ComfortSettings

from eidrive_scenario.api.criteria import Verdict, evaluate_criteria


def judge(frames: list[Any], **settings: Any) -> Verdict:
    (verdict,) = evaluate_criteria(frames, [Comfort(ComfortSettings(of="Ego", **settings))])
    return verdict


def motion(
    frame: Any,
    car: Any,
    speed: Callable[[float], float],
    yaw: Callable[[float], float] = lambda time: 0.0,
    until: float = 3.0,
) -> list[Any]:
    """Return frames each 0.05 s in which the Ego has this speed and heading at one place."""
    times = [0.05 * tick for tick in range(round(until / 0.05) + 1)]
    return [frame(time, {"Ego": car(0.0, 0.0, yaw(time), speed(time))}) for time in times]


@pytest.mark.parametrize(
    ("acceleration", "ratio"), [(2.0, 2.0 / 2.40), (3.0, 3.0 / 2.40), (-4.0, 4.0 / 4.05), (-4.2, 4.2 / 4.05)]
)
def test_constant_acceleration(frame: Any, car: Any, acceleration: float, ratio: float) -> None:
    verdict = judge(motion(frame, car, lambda time: 20.0 + acceleration * time))
    assert verdict.value == pytest.approx(ratio)
    assert verdict.passed is (ratio <= 1.0)
    assert verdict.reason.startswith("acceleration of Ego")


@pytest.mark.parametrize(("jerk", "passed"), [(4.0, True), (4.3, False)])
def test_constant_jerk(frame: Any, car: Any, jerk: float, passed: bool) -> None:
    """The acceleration changes from -jerk / 2 to jerk / 2 in 1 s."""
    verdict = judge(motion(frame, car, lambda time: 10.0 + jerk * (time - 0.5) ** 2 / 2.0, until=1.0))
    assert verdict.value == pytest.approx(jerk / 4.13)
    assert verdict.passed is passed


@pytest.mark.parametrize(("rate", "passed"), [(0.45, True), (0.5, False)])
def test_circle_has_a_lateral_acceleration(frame: Any, car: Any, rate: float, passed: bool) -> None:
    """10 m/s times the yaw rate, at most 4.89 m/s²; the fit of a circle is accurate to 2 %."""
    verdict = judge(motion(frame, car, lambda time: 10.0, lambda time: rate * time))
    assert verdict.value == pytest.approx(10.0 * rate / 4.89, rel=0.02)
    assert verdict.passed is passed


def test_first_violation_is_earlier_than_a_larger_one(frame: Any, car: Any) -> None:
    """Braking with 5 m/s² until 1.5 s, then with 8 m/s² from 3 s on, of at most 4.05 m/s²."""
    frames = motion(frame, car, lambda time: 60.0 - 5.0 * min(time, 1.5) - 8.0 * max(time - 3.0, 0.0), until=5.0)
    verdict = judge(frames, longitudinal_jerk=1000.0, jerk=1000.0)
    assert verdict.value is not None
    assert verdict.value > 7.9 / 4.05
    assert verdict.first_violation == 0.0


def test_yaw_rate_and_yaw_acceleration(frame: Any, car: Any) -> None:
    """A turn through the heading of 180 degrees, where the angle jumps."""
    criterion = Comfort(ComfortSettings(of="Ego"))
    frames = motion(frame, car, lambda time: 0.5, lambda time: (time + 3.0 + 3.14159265) % 6.2831853 - 3.14159265)
    (verdict,) = evaluate_criteria(frames, [criterion])
    assert verdict.value == pytest.approx(1.0 / 0.95, rel=1e-3)
    verdict = judge(motion(frame, car, lambda time: 0.1, lambda time: time**2, until=0.4))
    assert verdict.value == pytest.approx(2.0 / 1.93)


def test_limits_are_settings(frame: Any, car: Any) -> None:
    frames = motion(frame, car, lambda time: 3.0 * time)
    assert judge(frames, max_acceleration=3.1).passed
    assert judge(frames, max_acceleration=1.5).value == pytest.approx(2.0)


@pytest.mark.parametrize("count", [1, 2])
def test_few_frames_have_no_acceleration(frame: Any, car: Any, count: int) -> None:
    verdict = judge(motion(frame, car, lambda time: 100.0 * time)[:count])
    assert (verdict.passed, verdict.value) == (True, None)
    assert "fewer than 3" in verdict.reason


def test_teleport_and_absence_interrupt(frame: Any, car: Any) -> None:
    """The speed changes from 0 to 20 m/s at a jump, and again while the Ego is absent."""
    still = [frame(0.05 * tick, {"Ego": car(0.0)}) for tick in range(20)]
    jumped = [frame(1.0 + 0.05 * tick, {"Ego": car(500.0, speed=20.0)}) for tick in range(20)]
    away = [frame(2.0, {"Bus": car(0.0)})]
    back = [frame(2.05 + 0.05 * tick, {"Ego": car(500.0, speed=5.0)}) for tick in range(20)]
    assert judge([*still, *jumped, *away, *back]).value == pytest.approx(0.0, abs=1e-9)


def test_absent_actor_fails(frame: Any, car: Any) -> None:
    verdict = judge([frame(0.0, {"Bus": car(0)})])
    assert (verdict.passed, verdict.value) == (False, None)
    assert verdict.reason.startswith("Ego was never present")


def test_actor_blocked_is_the_longest_time_without_a_break(frame: Any, car: Any) -> None:
    speeds = [5.0, 0.05, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]
    frames = [frame(float(second), {"Ego": car(0.0, speed=speed)}) for second, speed in enumerate(speeds)]
    passed, failed = (ActorBlocked(ActorBlockedSettings(of="Ego", at_most=limit)) for limit in (3.0, 2.9))
    first, second = evaluate_criteria(frames, [passed, failed])
    assert (first.passed, first.value) == (True, 3.0)
    assert (second.passed, second.first_violation) == (False, 8.0)
    assert first.reason == "Ego was blocked for 3.00 s from 5.00 s on"


def test_actor_blocked_without_and_with_absence(frame: Any, car: Any) -> None:
    criterion = ActorBlocked(ActorBlockedSettings(of="Ego", at_most=1.5))
    frames = [frame(0.0, {"Ego": car(0)}), frame(1.0, {"Bus": car(0)}), frame(2.0, {"Ego": car(0)})]
    (verdict,) = evaluate_criteria(frames, [criterion])
    assert (verdict.passed, verdict.value) == (True, 0.0)
    (verdict,) = evaluate_criteria([], [ActorBlocked(ActorBlockedSettings(of="Ego"))])
    assert (verdict.passed, verdict.limit) == (False, 180.0)
