"""Prediction of tracks by individual time steps, and the filtering and fusion of headings."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Array, Bools
from eidrive_scenario.base.geometry import wrap_angle
from eidrive_scenario.base.tolerances import EPSILON
from eidrive_scenario.perception.tracking.motion_models import (
    ACCELERATION_DENSITY,
    HEADING_DEVIATION,
    KNOWN_SPEED,
    TURN_DENSITY,
    UNKNOWN_TURN,
)

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


def added_variance(variance: Array | float, step: Array | float) -> Array:
    """Return the variance that `predict` adds to each coordinate of a position in `step` [s], at least 0 [m²].

    variance  of the velocity in each axis before [m²/s²]
    """
    return np.asarray(variance * step**2 + ACCELERATION_DENSITY * step**3 / 3.0)


def is_predictable(covariance: Array, age: Array, max_age: float) -> Bools:
    """Return whether tracks (N,) are predicted as precisely as an object with a reported velocity for `max_age` [s].

    covariance  (N, 4, 4) after the prediction by `age` (N,) [s]
    """
    age = np.abs(age)
    variance = 0.5 * (covariance[:, 2, 2] + covariance[:, 3, 3]) - ACCELERATION_DENSITY * age
    limit = added_variance(KNOWN_SPEED**2, max_age)
    return np.asarray(added_variance(variance, age) <= limit + EPSILON)


def predict(mean: Array, covariance: Array, step: Array, turn: Array, turning: Bools) -> tuple[Array, Array]:
    """Return states (N, 4) x y vx vy and covariances (N, 4, 4), predicted by `step` (N,) [s].

    The model is white noise acceleration with a coordinated turn of known rate `turn` (N,) [rad/s] (Bar-Shalom, Li and
    Kirubarajan, Estimation with applications to tracking and navigation, 2001, sections 6.3.2 and 11.7.1). A step can
    be negative if a clock is fast; the uncertainty grows by the same amount.

    turning  (N,) whether the equations of a turn are evaluated, which differ from the others by rounding if the rate is
             0
    """
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


SIGNIFICANT = 2.0
"""Minimum turn rate in standard deviations; smaller rates are assumed to be 0."""
FORGETTING = 0.8
"""Factor of the accumulated votes for the front at each report."""
AGREEMENT = 0.5
"""Minimum length of the mean of the unit vectors of doubled angles. Two axes of equal weight are then less than 60°
apart; the mean of contradicting axes would be a box across all of them."""


def initiate_heading(yaw: Array) -> tuple[Array, Array]:
    """Return initial headings (N, 2), yaw and yaw rate, and covariances (N, 3): yaw, cross term, yaw rate."""
    heading, covariance = np.zeros((len(yaw), 2)), np.empty((len(yaw), 3))
    heading[:, 0] = yaw
    covariance[:] = HEADING_DEVIATION**2, 0.0, UNKNOWN_TURN**2
    return heading, covariance


def predict_heading(heading: Array, covariance: Array, step: Array) -> tuple[Array, Array]:
    """Return headings and covariances predicted by `step` (N,) [s]: constant yaw rate with white noise."""
    noise = TURN_DENSITY * np.abs(step)
    later = np.empty_like(covariance)
    own, both, rate = covariance[:, 0], covariance[:, 1], covariance[:, 2]
    later[:, 0] = own + step * (2.0 * both + step * (rate + noise / 3.0))
    later[:, 1] = both + step * (rate + 0.5 * noise)
    later[:, 2] = rate + noise
    moved = heading.copy()
    moved[:, 0] += step * heading[:, 1]
    return moved, later


def significant_turn_rate(heading: Array, covariance: Array) -> Array:
    """Return the turn rates (N,) [rad/s]; 0 if they are not significant."""
    rate = heading[:, 1]
    return np.where(rate * rate > SIGNIFICANT**2 * covariance[:, 2], rate, 0.0)


def update_heading(heading: Array, covariance: Array, facing: Array, yaw: Array) -> tuple[Array, Array, Array]:
    """Return heading, covariance and `facing` (N,) after a measurement of the yaw of a box (N,).

    A box determines its axis. The front is determined by votes of the reports and can change.
    """
    off = wrap_angle(yaw - heading[:, 0])
    against = np.abs(off) > math.pi / 2.0
    off = np.where(against, off - np.copysign(math.pi, off), off)
    gains = covariance[:, :2] / (covariance[:, :1] + HEADING_DEVIATION**2)
    corrected = heading + gains * off[:, None]
    after = np.empty_like(covariance)
    after[:, :2] = covariance[:, :2] * (1.0 - gains[:, :1])
    after[:, 2] = covariance[:, 2] - gains[:, 1] * covariance[:, 1]
    votes = FORGETTING * facing + np.where(against, -1.0, 1.0)
    corrected[:, 0] = wrap_angle(np.where(votes < 0.0, corrected[:, 0] + math.pi, corrected[:, 0]))
    return corrected, after, np.abs(votes)


def fuse_headings(yaw: Array, weights: Array, errors: Array, starts: NDArray[np.intp], velocity: Array) -> Array:
    """Return one heading in (-pi, pi] for each group (G,) of consecutive headings (K,) that begins at `starts` (G,).

    The axis is the weighted circular mean of doubled angles, which is independent of the front of each report; of axes
    that contradict each other, it is that of the smallest position error. The front is that of the larger weight; for
    equal weights, that of the direction of `velocity` (G, 2), NaN if unknown.

    weights, errors  (K,) weight and trace of the covariance of the position [m²] of each report, NaN if unknown
    """
    counts = np.diff(starts, append=len(yaw))
    if len(counts) == len(yaw):
        return yaw
    # Doubled angles make a heading and its reverse equal; the length of their mean shows how far the axes agree.
    x = np.add.reduceat(weights * np.cos(2.0 * yaw), starts)
    y = np.add.reduceat(weights * np.sin(2.0 * yaw), starts)
    total = np.add.reduceat(weights, starts)
    axis = 0.5 * np.arctan2(y, x)
    for group in np.flatnonzero(np.hypot(x, y) < AGREEMENT * total).tolist():
        members = slice(starts[group], starts[group] + counts[group])
        error = np.nan_to_num(errors[members], nan=np.inf)
        axis[group] = yaw[members][np.lexsort((-weights[members], error))[0]]
    votes = np.add.reduceat(weights * np.sign(np.cos(yaw - np.repeat(axis, counts))), starts)
    ahead = velocity[:, 0] * np.cos(axis) + velocity[:, 1] * np.sin(axis)
    split = (np.abs(votes) < 1e-9 * total) & np.isfinite(ahead)
    front = np.where(split, ahead, votes)
    return np.where(counts > 1, wrap_angle(np.where(front < 0.0, axis + math.pi, axis)), yaw[starts])
