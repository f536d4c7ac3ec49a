"""Headings: filtering over time, fusion on the circle, and disambiguation of front and back."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.arrays import Array
from eidrive_scenario.geometry import wrap_angle
from eidrive_scenario.perception.tracking.motion_models import HEADING_DEVIATION, TURN_DENSITY, UNKNOWN_TURN

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
