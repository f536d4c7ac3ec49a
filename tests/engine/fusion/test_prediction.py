"""Prediction of tracks."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.linalg import expm

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.fusion import prediction
from eidrive_scenario.fusion.prediction import CAR_LENGTH, REPORT_LIFETIME, predictable_time
from eidrive_scenario.perception.tracking.motion_models import ACCELERATION_DENSITY, ConstantVelocity, Estimates

STATE = np.array([[1.0, 2.0, 10.0, -3.0]])
SPREAD = np.array([[[0.5, 0.1, 0.02, 0.0], [0.1, 0.4, 0.0, 0.03], [0.02, 0.0, 0.2, 0.05], [0.0, 0.03, 0.05, 0.3]]])


def predict(mean: Array, covariance: Array, step: Array, turn: Array) -> tuple[Array, Array]:
    return prediction.predict(mean, covariance, step, turn, turn != 0.0)


def test_predict_without_turn_equals_the_tracker() -> None:
    """White noise acceleration has the process noise q [[T³/3, T²/2], [T²/2, T]] for each axis."""
    mean, covariance = predict(STATE, SPREAD, np.array([0.3]), np.array([0.0]))
    other = ConstantVelocity().predict(Estimates(STATE, SPREAD), 0.3)
    np.testing.assert_allclose(mean, other.state, atol=1e-12)
    np.testing.assert_allclose(covariance, other.covariance, atol=1e-12)
    still, noise = predict(STATE, np.zeros((1, 4, 4)), np.array([0.3]), np.array([0.0]))
    assert noise[0, 0, 0] == pytest.approx(ACCELERATION_DENSITY * 0.009)
    assert noise[0, 0, 2] == pytest.approx(ACCELERATION_DENSITY * 0.045)
    assert noise[0, 3, 3] == pytest.approx(ACCELERATION_DENSITY * 0.3)
    np.testing.assert_allclose(still, mean)


def test_predict_with_turn_follows_an_arc() -> None:
    """A quarter of a circle at 10 m/s and 1 rad/s: radius 10 m."""
    quarter = math.pi / 2.0
    mean, _ = predict(np.array([[0.0, 0.0, 10.0, 0.0]]), SPREAD, np.array([quarter]), np.array([1.0]))
    np.testing.assert_allclose(mean, [[10.0, 10.0, 0.0, 10.0]], atol=1e-9)
    right, _ = predict(np.array([[0.0, 0.0, 10.0, 0.0]]), SPREAD, np.array([quarter]), np.array([-1.0]))
    np.testing.assert_allclose(right, [[10.0, -10.0, 0.0, -10.0]], atol=1e-9)


@pytest.mark.parametrize("turn", [0.7, -0.2, 1e-7])
def test_predict_with_turn_solves_its_differential_equation(turn: float) -> None:
    """x' = v, v' = ω v rotated by a right angle."""
    generator = np.zeros((4, 4))
    generator[0, 2] = generator[1, 3] = 1.0
    generator[2, 3], generator[3, 2] = -turn, turn
    forward = expm(0.4 * generator)
    mean, covariance = predict(STATE, SPREAD, np.array([0.4]), np.array([turn]))
    _, noise = predict(STATE, np.zeros((1, 4, 4)), np.array([0.4]), np.array([turn]))
    np.testing.assert_allclose(mean[0], forward @ STATE[0], atol=1e-9)
    np.testing.assert_allclose((covariance - noise)[0], forward @ SPREAD[0] @ forward.T, atol=1e-9)


def test_predict_two_steps_equal_one_per_track() -> None:
    steps = np.array([0.1, 0.25])
    both = predict(np.repeat(STATE, 2, 0), np.repeat(SPREAD, 2, 0), steps, np.zeros(2))
    half = predict(*predict(STATE, SPREAD, np.array([0.1]), np.zeros(1)), np.array([0.15]), np.zeros(1))
    np.testing.assert_allclose(both[0][1], half[0][0], atol=1e-12)
    np.testing.assert_allclose(both[1][1], half[1][0], atol=1e-12)


def test_predict_negative_step_increases_the_covariance() -> None:
    _, covariance = predict(STATE, SPREAD, np.array([-0.02]), np.zeros(1))
    assert np.linalg.eigvalsh(covariance[0]).min() > 0.0
    assert covariance[0, 2, 2] > SPREAD[0, 2, 2]


@pytest.mark.parametrize("deviation", [0.1, 1.0, 4.0])
def test_prediction_over_predictable_time_adds_the_deviation(deviation: float) -> None:
    """Reported velocities have a deviation of 0.5 m/s."""
    covariance = np.diag([0.0, 0.0, 0.25, 0.25])[None]
    _, after = predict(STATE, covariance, np.array([predictable_time(deviation)]), np.zeros(1))
    np.testing.assert_allclose(after[0, [0, 1], [0, 1]], deviation**2)


def test_report_lifetime_is_time_of_a_car_length() -> None:
    """0.25 · 2.28² + 6 / 3 · 2.28³ = 1.30 + 23.70 = 25.00 [m²]."""
    assert CAR_LENGTH == 5.0
    assert pytest.approx(2.28, abs=0.001) == REPORT_LIFETIME
