"""Headings: filtered over time, joined on the circle, front and back told apart."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.arrays import Array
from eidrive_scenario.geometry import wrap_angle
from eidrive_scenario.perception.tracking.motion_models import HEADING_DEVIATION, TURN_DENSITY, UNKNOWN_TURN

SIGNIFICANT = 2.0
"""A turn rate counts as known from so many of its standard deviations on; below, the object is taken to go straight."""
FORGETTING = 0.8
"""Of the votes for one end as the front, from report to report."""


def first_heading(yaw: Array) -> tuple[Array, Array]:
    """Headings (N, 2), yaw and its rate, seen for the first time, and their covariances (N, 3): of yaw, both, rate."""
    heading, covariance = np.zeros((len(yaw), 2)), np.empty((len(yaw), 3))
    heading[:, 0] = yaw
    covariance[:] = HEADING_DEVIATION**2, 0.0, UNKNOWN_TURN**2
    return heading, covariance


def predicted_heading(heading: Array, covariance: Array, step: Array) -> tuple[Array, Array]:
    """The same `step` (N,) seconds later: constant rate, white noise on it."""
    noise = TURN_DENSITY * np.abs(step)
    later = np.empty_like(covariance)
    own, both, rate = covariance[:, 0], covariance[:, 1], covariance[:, 2]
    later[:, 0] = own + step * (2.0 * both + step * (rate + noise / 3.0))
    later[:, 1] = both + step * (rate + 0.5 * noise)
    later[:, 2] = rate + noise
    moved = heading.copy()
    moved[:, 0] += step * heading[:, 1]
    return moved, later


def known_turn(heading: Array, covariance: Array) -> Array:
    """(N,) turn rates [rad/s], 0 where too little is known of them."""
    rate = heading[:, 1]
    return np.where(rate * rate > SIGNIFICANT**2 * covariance[:, 2], rate, 0.0)


def updated_heading(heading: Array, covariance: Array, facing: Array, yaw: Array) -> tuple[Array, Array, Array]:
    """Heading, covariance and `facing` (N,) after a box was measured with this yaw (N,).

    A box tells its axis; which end is the front is a vote of the reports, and may change.
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


def joined_heading(yaw: Array, weights: Array, starts: NDArray[np.intp], velocity: Array) -> Array:
    """(G,) one heading for each group of consecutive headings (K,) that begins at `starts` (G,), in (-pi, pi].

    The axis is the weighted mean on the circle of doubled angles, so that it does not matter which end a report took
    for the front. The front is where the greater weight says it is; where both ends have the same, where the object
    drives to, `velocity` (G, 2), NaN where unknown.
    """
    counts = np.diff(starts, append=len(yaw))
    if len(counts) == len(yaw):
        return yaw
    x = np.add.reduceat(weights * np.cos(2.0 * yaw), starts)
    y = np.add.reduceat(weights * np.sin(2.0 * yaw), starts)
    axis = 0.5 * np.arctan2(y, x)
    votes = np.add.reduceat(weights * np.sign(np.cos(yaw - np.repeat(axis, counts))), starts)
    total = np.add.reduceat(weights, starts)
    ahead = velocity[:, 0] * np.cos(axis) + velocity[:, 1] * np.sin(axis)
    split = (np.abs(votes) < 1e-9 * total) & np.isfinite(ahead)
    front = np.where(split, ahead, votes)
    return np.where(counts > 1, wrap_angle(np.where(front < 0.0, axis + math.pi, axis)), yaw[starts])
