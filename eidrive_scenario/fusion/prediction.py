"""Prediction of tracks by individual time steps: constant velocity, or coordinated turn."""

from __future__ import annotations

import numpy as np

from eidrive_scenario.arrays import Array, Bools
from eidrive_scenario.perception.tracking.motion_models import ACCELERATION_DENSITY, KNOWN_SPEED

_PLACE = np.diag([1.0, 1.0, 0.0, 0.0])
_SPEED = np.diag([0.0, 0.0, 1.0, 1.0])
_BOTH = np.eye(4, k=2) + np.eye(4, k=-2)


def predictable_time(deviation: float) -> float:
    """Return the time [s] in which prediction adds a standard deviation [m] to each coordinate of a position.

    It is the root of deviation² = KNOWN_SPEED² t² + ACCELERATION_DENSITY t³ / 3, the variance that `predict` adds to an
    object with a reported velocity.
    """
    roots = np.roots([ACCELERATION_DENSITY / 3.0, KNOWN_SPEED**2, 0.0, -(deviation**2)])
    return float(roots.real.max())  # the only positive root: the coefficients change their sign once


CAR_LENGTH = 5.0
"""Length of a car [m], twice the distance within which the planner `behavior` recognizes an object."""
REPORT_LIFETIME = predictable_time(CAR_LENGTH)
"""Default maximum age of a report [s]: 2.28 s. The standard deviation that prediction adds is then the length of a car,
and the predicted box of a car does not overlap with the car any more.

One lost message about an object at rest, which is reported once per second (ETSI TS 103 324, T_GenCpmMax), is bridged.
"""


def predict(
    mean: Array, covariance: Array, step: Array, turn: Array, turning: Bools | None = None
) -> tuple[Array, Array]:
    """Return states (N, 4) x y vx vy and covariances (N, 4, 4), predicted by `step` (N,) [s].

    The model is white noise acceleration with a coordinated turn of known rate `turn` (N,) [rad/s] (Bar-Shalom, Li and
    Kirubarajan, Estimation with applications to tracking and navigation, 2001, sections 6.3.2 and 11.7.1). A step can
    be negative if a clock is fast; the uncertainty grows by the same amount.

    turning  (N,) whether the equations of a turn are evaluated, which differ from the others by rounding if the rate is
             0; None: for all if any track turns
    """
    if turning is None:
        turning = np.full(len(turn), turn.any())
    if not turning.any():
        return _predict_straight(mean, covariance, step)
    if turning.all():
        return _predict_turn(mean, covariance, step, turn)
    moved, later = np.empty_like(mean), np.empty_like(covariance)
    straight = ~turning
    moved[straight], later[straight] = _predict_straight(mean[straight], covariance[straight], step[straight])
    moved[turning], later[turning] = _predict_turn(mean[turning], covariance[turning], step[turning], turn[turning])
    return moved, later


def _predict_turn(mean: Array, covariance: Array, step: Array, turn: Array) -> tuple[Array, Array]:
    """Return the prediction with a turn."""
    forward = np.zeros(covariance.shape)
    forward[:, 0, 0] = forward[:, 1, 1] = forward[:, 2, 2] = forward[:, 3, 3] = 1.0
    angle = turn * step
    cos, sin = np.cos(angle), np.sin(angle)
    chord = step * np.sinc(angle / np.pi)
    aside = 0.5 * angle * step * np.sinc(0.5 * angle / np.pi) ** 2
    forward[:, 0, 2] = forward[:, 1, 3] = chord
    forward[:, 0, 3], forward[:, 1, 2] = -aside, aside
    forward[:, 2, 2] = forward[:, 3, 3] = cos
    forward[:, 2, 3], forward[:, 3, 2] = -sin, sin
    later = forward @ covariance @ np.swapaxes(forward, 1, 2)
    length = np.abs(step)
    noise = (ACCELERATION_DENSITY * length)[:, None, None]
    across = step[:, None, None]
    later += noise * (_SPEED + across * (0.5 * _BOTH + (across / 3.0) * _PLACE))
    return (forward @ mean[:, :, None])[:, :, 0], later


def _predict_straight(mean: Array, covariance: Array, step: Array) -> tuple[Array, Array]:
    """Return the prediction without a turn. Tracks are the last axis, which makes numpy three times as fast."""
    entries = np.ascontiguousarray(covariance.reshape(-1, 16).T).reshape(4, 4, -1)
    place, both, speed = entries[:2, :2], entries[:2, 2:], entries[2:, 2:]
    noise = ACCELERATION_DENSITY * np.abs(step) * np.eye(2)[:, :, None]
    change = step * speed
    later = np.empty_like(entries)
    later[2:, 2:] = speed + noise
    later[:2, 2:] = both + change + 0.5 * step * noise
    later[2:, :2] = later[:2, 2:].swapaxes(0, 1)
    later[:2, :2] = place + step * (both + both.swapaxes(0, 1) + change + (step / 3.0) * noise)
    moved = mean.copy()
    moved[:, :2] += step[:, None] * mean[:, 2:]
    return moved, later.reshape(16, -1).T.reshape(-1, 4, 4)
