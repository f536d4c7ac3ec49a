"""Motion models of tracks: predictions by integration, Jacobians by differences, updates by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from eidrive_scenario.perception.tracking.motion_models import (
    ACCELERATION_DENSITY,
    TURN_DENSITY,
    ConstantVelocity,
    Estimates,
    MovingModel,
    TurnRate,
)


def box(x: float, y: float, yaw: float = 0.0) -> np.ndarray:
    return np.array([[x, y, 0.75, 4.6, 1.8, 1.5, yaw]])


def noise(deviation: float = 0.1) -> np.ndarray:
    return deviation**2 * np.eye(2)[None]


UNKNOWN = np.full((1, 2), np.nan)


def test_constant_velocity_predict_moves_straight() -> None:
    """Two seconds at (3, -1) m/s; white acceleration q adds q T³/3 to the position variance and q T to the velocity
    variance."""
    start = Estimates(np.array([[1.0, 2.0, 3.0, -1.0]]), np.zeros((1, 4, 4)))
    state, covariance = ConstantVelocity().predict(start, 2.0)
    np.testing.assert_allclose(state, [[7.0, 0.0, 3.0, -1.0]])
    assert covariance[0, 0, 0] == pytest.approx(ACCELERATION_DENSITY * 8.0 / 3.0)
    assert covariance[0, 2, 2] == pytest.approx(ACCELERATION_DENSITY * 2.0)
    assert covariance[0, 0, 2] == pytest.approx(ACCELERATION_DENSITY * 2.0)
    assert covariance[0, 0, 1] == 0.0


@pytest.mark.parametrize(("model", "speed"), [(ConstantVelocity, slice(2, 4)), (TurnRate, slice(3, 4))])
@pytest.mark.parametrize(("deviation", "expected"), [(None, 0.5), (1.5, 1.5)])
def test_begin_has_the_deviation_of_the_detected_velocity(
    model: type[MovingModel], speed: slice, deviation: float | None, expected: float
) -> None:
    given = model() if deviation is None else model(deviation)
    held = given.begin(box(0.0, 0.0), np.array([[8.0, 0.0]]), noise())
    np.testing.assert_allclose(np.diagonal(held.covariance[0])[speed], expected**2)
    unknown = given.begin(box(0.0, 0.0), UNKNOWN, noise())
    np.testing.assert_allclose(np.diagonal(unknown.covariance[0])[speed], 144.0)


def test_constant_velocity_many_small_steps_equal_one_step() -> None:
    start = Estimates(np.array([[1.0, 2.0, 3.0, -1.0]]), np.eye(4)[None])
    once = ConstantVelocity().predict(start, 1.0)
    often = start
    for _ in range(50):
        often = ConstantVelocity().predict(often, 0.02)
    np.testing.assert_allclose(often.state, once.state, atol=1e-12)
    np.testing.assert_allclose(often.covariance, once.covariance, atol=1e-9)


@pytest.mark.parametrize("turn", [0.0, 1e-7, 0.3, -0.8])
def test_turn_rate_predict_follows_circle(turn: float) -> None:
    """Comparison with integration in 20,000 steps: 10 m/s for 1.5 s."""
    start = Estimates(np.array([[2.0, -1.0, 0.5, 10.0, turn]]), np.zeros((1, 5, 5)))
    state, _ = TurnRate().predict(start, 1.5)
    x, y, heading, steps = 2.0, -1.0, 0.5, 20_000
    for _ in range(steps):
        middle = heading + 0.5 * turn * 1.5 / steps
        x, y = x + 10.0 * math.cos(middle) * 1.5 / steps, y + 10.0 * math.sin(middle) * 1.5 / steps
        heading += turn * 1.5 / steps
    np.testing.assert_allclose(state, [[x, y, heading, 10.0, turn]], atol=1e-7)


@pytest.mark.parametrize("turn", [0.0, 1e-6, 0.4, -0.7])
def test_turn_rate_predict_covariance_follows_numerical_jacobian(turn: float) -> None:
    """The predicted covariance follows the numerical Jacobian, plus noise on speed and turn rate."""
    model, step = TurnRate(), 0.3
    middle = np.array([2.0, -1.0, 0.5, 10.0, turn])
    before = np.diag([0.3, 0.2, 0.05, 1.0, 0.1])
    jacobian = np.empty((5, 5))
    for column in range(5):
        nudge = np.zeros(5)
        nudge[column] = 1e-5
        ends = [model.predict(Estimates((middle + s * nudge)[None], np.zeros((1, 5, 5))), step)[0] for s in (1, -1)]
        jacobian[:, column] = (ends[0] - ends[1])[0] / 2e-5
    gain = np.array([[0.5 * step * math.cos(0.5), 0], [0.5 * step * math.sin(0.5), 0], [0, 0.5 * step], [1, 0], [0, 1]])
    expected = jacobian @ before @ jacobian.T
    expected += gain @ np.diag([ACCELERATION_DENSITY * step, TURN_DENSITY * step]) @ gain.T
    _, covariance = model.predict(Estimates(middle[None], before[None]), step)
    np.testing.assert_allclose(covariance[0], expected, atol=1e-6)


def test_update_weights_by_variance() -> None:
    """Prior and measurement of equal variance average, and the variance halves."""
    before = Estimates(np.array([[0.0, 0.0, 0.0, 0.0]]), 0.01 * np.eye(4)[None])
    (state, covariance), _ = ConstantVelocity().update(before, box(1.0, -2.0), noise(0.1))
    np.testing.assert_allclose(state[0, :2], [0.5, -1.0])
    assert covariance[0, 0, 0] == pytest.approx(0.005)
    assert covariance[0, 2, 2] == pytest.approx(0.01)


def test_turn_rate_update_ignores_box_across_heading() -> None:
    """A heading of 0 and a box at 80 degrees: the fit mistook the width for the length."""
    model = TurnRate()
    before = Estimates(np.array([[0.0, 0.0, 0.0, 5.0, 0.0]]), np.diag([0.1, 0.1, 0.02, 1.0, 0.1])[None])
    (across, _), _ = model.update(before, box(0.0, 0.0, math.radians(80)), noise())
    (oblique, _), _ = model.update(before, box(0.0, 0.0, math.radians(10)), noise())
    (reverse, _), _ = model.update(before, box(0.0, 0.0, math.radians(190)), noise())
    assert across[0, 2] == pytest.approx(0.0, abs=1e-6)
    assert 0.0 < oblique[0, 2] < math.radians(10)
    assert reverse[0, 2] == pytest.approx(oblique[0, 2])


def test_turn_rate_update_reverses_backward_motion() -> None:
    """The box points west, the object moves east: after some updates it has heading east and positive speed."""
    model = TurnRate()
    tracks = model.begin(box(0.0, 0.0, math.pi), UNKNOWN, noise())
    for tick in range(1, 20):
        tracks = model.predict(tracks, 0.1)
        tracks = model.update(tracks, box(0.8 * tick, 0.0, math.pi), noise()).estimates
    assert tracks.state[0, 3] == pytest.approx(8.0, abs=0.5)
    assert abs(tracks.state[0, 2]) < 0.05
    assert np.all(np.linalg.eigvalsh(tracks.covariance[0]) > 0.0)


def test_begin_uses_velocity_of_detector() -> None:
    for model in (ConstantVelocity(), TurnRate()):
        known = model.begin(box(0.0, 0.0, 0.1), np.array([[7.0, 0.0]]), noise())
        unknown = model.begin(box(0.0, 0.0, 0.1), UNKNOWN, noise())
        np.testing.assert_allclose(model.velocity(known.state), [[7.0, 0.0]], atol=0.75)
        np.testing.assert_array_equal(model.velocity(unknown.state), [[0.0, 0.0]])
