"""Lateral motion against the closed form of the quintic blend."""

from __future__ import annotations

import math

import numpy as np
import pytest

from eidrive_scenario.driving.planning.behavior.proposals import Start, change_length, passing, towards


@pytest.mark.parametrize(("change", "speed", "limit"), [(3.5, 15.0, 2.0), (-3.5, 25.0, 1.0), (1.0, 30.0, 0.5)])
def test_lane_change_reaches_its_lateral_acceleration(change: float, speed: float, limit: float) -> None:
    # The second derivative of 10u³ - 15u⁴ + 6u⁵ has its extremes 10/√3 at u = 1/2 ± √3/6: a = 5.774 d / T²
    profile = towards("change", change, Start(100.0, 0.0, 0.0, speed), limit)
    duration = (profile.places[-1] - 100.0) / speed
    assert duration == pytest.approx(math.sqrt(5.7735 * abs(change) / limit), rel=1e-4)
    times = np.arange(0.0, duration, 0.001)
    offset = profile.offset(100.0 + speed * times)
    acceleration = np.gradient(np.gradient(offset, times), times)[5:-5]
    assert np.abs(acceleration).max() == pytest.approx(limit, rel=2e-3)
    peak = float(times[5:-5][np.argmax(np.abs(acceleration))]) / duration
    assert min(abs(peak - 0.5 - math.sqrt(3) / 6), abs(peak - 0.5 + math.sqrt(3) / 6)) < 0.01


def test_change_starts_with_offset_and_slope_and_ends_level() -> None:
    profile = towards("back", 0.0, Start(50.0, 1.2, 0.08, 12.0), 2.0)
    assert profile.offset_at(50.0) == pytest.approx(1.2)
    assert (profile.offset_at(50.01) - profile.offset_at(50.0)) / 0.01 == pytest.approx(0.08, abs=1e-3)
    end = profile.places[-1]
    assert profile.offset_at(end) == pytest.approx(0.0, abs=1e-9)
    assert profile.slope_at(end) == pytest.approx(0.0, abs=1e-4)
    assert profile.offset_at(end + 100.0) == 0.0
    assert profile.offset_at(0.0) == pytest.approx(1.2), "constant before the start"


def test_slow_change_is_not_shorter_than_a_car_can_steer() -> None:
    # At 1 m/s the lateral acceleration alone allows 3.2 m for a lane. The radius of a car of 2.85 m wheelbase at
    # 0.6 rad is 4.2 m: two arcs to each side for 3.5 m need at least 2 √(4.2 · 3.5 - 3.5²/4) = 6.8 m.
    assert change_length(3.5, 1.0, 2.0) > 6.8
    assert change_length(0.0, 10.0, 2.0) == 1.0


def test_passing_has_its_offset_along_the_obstacle_and_returns() -> None:
    profile = passing("pass", 2.0, (100.0, 120.0), Start(50.0, 0.0, 0.0, 10.0), 2.0, 1, lengths=(20.0, 30.0))
    assert profile is not None
    np.testing.assert_allclose(profile.offset(np.linspace(100.0, 120.0, 21)), 2.0)
    assert profile.offset_at(50.0) == 0.0
    assert profile.offset_at(150.0) == 0.0
    assert (np.diff(profile.places) > 0.0).all()


@pytest.mark.parametrize(("start", "possible"), [(90.0, False), (50.0, True), (79.0, True)])
def test_obstacle_that_is_too_near_is_not_passed(start: float, possible: bool) -> None:
    # 2 m to the side at 10 m/s and 1.5 · 2 m/s² take √(5.774 · 2 / 3) s, 19.6 m; 60 % of it have to be left
    profile = passing("pass", 2.0, (100.0, 120.0), Start(start, 0.0, 0.0, 10.0), 2.0, 1, lengths=(20.0, 20.0))
    assert (profile is not None) == possible
