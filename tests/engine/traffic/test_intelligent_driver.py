"""Tests of the car-following model against its closed forms."""

import math

import numpy as np
import pytest

from eidrive_scenario.base.car_following import Drivers, ballistic
from eidrive_scenario.traffic import IntelligentDriver

DRIVER = IntelligentDriver(time_gap=1.5, standstill_gap=2.0, acceleration=1.2, deceleration=2.0, exponent=4.0)


def response(speed: float, desired: float, gap: float = math.inf, approach: float = 0.0) -> float:
    return float(Drivers.of([DRIVER]).response(*(np.array([value]) for value in (speed, desired, gap, approach)))[0])


def test_free_car_accelerates_to_desired_speed() -> None:
    assert response(0.0, 20.0) == pytest.approx(1.2)
    assert response(10.0, 20.0) == pytest.approx(1.2 * (1 - 0.5**4))
    assert response(20.0, 20.0) == pytest.approx(0.0)


def test_braking_above_desired_speed_is_limited() -> None:
    """At twice the desired speed the model alone gives a deceleration of 1.2·(2⁴ - 1) = 18 m/s²."""
    assert response(22.0, 20.0) == pytest.approx(1.2 * (1 - 1.1**4))
    assert response(40.0, 20.0) == pytest.approx(-2.0 * 2.0)


def test_drivers_use_individual_parameters() -> None:
    other = IntelligentDriver(time_gap=0.8, standstill_gap=3.0, acceleration=2.0)
    speed, desired, gap, approach = np.array([[8.0, 8.0], [15.0, 15.0], [20.0, 20.0], [1.0, 1.0]])
    both = Drivers.of([DRIVER, other]).response(speed, desired, gap, approach)
    assert both[0] == Drivers.of([DRIVER]).response(speed, desired, gap, approach)[0]
    assert both[1] == Drivers.of([other]).response(speed, desired, gap, approach)[1]
    assert both[0] != both[1]


def test_equilibrium_gap_at_standstill_is_the_standstill_gap() -> None:
    assert response(0.0, 20.0, gap=2.0) == pytest.approx(0.0)


def test_acceleration_in_equilibrium_is_zero() -> None:
    for speed in (1.0, 8.0, 15.0):
        gap = (2.0 + 1.5 * speed) / math.sqrt(1.0 - (speed / 20.0) ** 4)
        assert response(speed, 20.0, gap) == pytest.approx(0.0, abs=1e-12)


def test_response_to_approach_rate_is_limited_by_the_brakes() -> None:
    wanted = 2.0 + 10.0 * 1.5 + 10.0 * 4.0 / (2.0 * math.sqrt(1.2 * 2.0))
    assert response(10.0, 20.0, 40.0, 4.0) == pytest.approx(1.2 * (1 - 0.5**4 - (wanted / 40.0) ** 2))
    assert response(10.0, 20.0, 0.0, 10.0) == -DRIVER.emergency


def test_ballistic_step_of_braking_car_ends_at_standstill() -> None:
    covered, after = ballistic(np.array([10.0, 1.0]), np.array([-2.0, -2.0]), 1.0)
    assert covered == pytest.approx([9.0, 0.25])
    assert after == pytest.approx([8.0, 0.0])
