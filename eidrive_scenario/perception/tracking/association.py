"""Association of detections with tracks, and the existence probability of tracks, shared by tracking and fusion.

The recursions of the existence probability are those of the integrated probabilistic data association filter (Musicki,
Evans and Stankovic, Integrated probabilistic data association, IEEE Transactions on Automatic Control 39(6), 1994), for
one detection that is assigned beforehand. r is the probability of existence, p that of a detection if the object
exists:

    prediction     r' = r exp(-T / lifetime)
    no detection   r' = r (1 - p) / (1 - r p)
    a detection    r' = r L / (1 - r + r L),  L = 1 - p + p g / c
    birth          r  = s

g is the density of the innovation [1/m²], c that of false detections [1/m² per scan], and s the confidence of the
detector, taken as the probability that an unassigned detection is an object. A new object appears with density b [1/m²
per scan], so s / (1 - s) = p b / c, and L = 1 - p + (g / b) s / (1 - s).
"""

from __future__ import annotations

import math

import numpy as np

from eidrive_scenario.base.arrays import Array, Bools
from eidrive_scenario.base.assignment import assign_matrix
from eidrive_scenario.perception.tracking.motion_models import Estimates

UNASSIGNED_GATE = -2.0 * math.log(1e-6)
"""Maximum squared Mahalanobis distance of pairs of tracks without a partner within the gate.

One true pair in a hundred is outside a gate of 99 %, which would split objects many times per second.
"""
UNKNOWN_DEVIATION = 0.5
"""Standard deviation of positions for which the detector states no covariance [m]."""
LEAST_DEVIATION = 0.05
"""Standard deviation that is added to positions with a smaller one, such as 0, and to singular covariances [m]."""
SINGULAR = 1e-5
"""Share of the determinant of a covariance in the product of its variances up to which it counts as singular."""


def associate(
    tracks: Estimates, confirmed: Bools, apart: Bools, boxes: Array, noise: Array, gate: float
) -> tuple[list[int], list[int]]:
    """Return the rows of associated tracks and boxes; confirmed tracks are assigned before others.

    A new object may be faster than usual: unconfirmed tracks without a box in the gate are assigned one outside it, up
    to odds of one in a million.

    tracks  (N,) predicted;  confirmed  (N,);  boxes (M, 7), and noise (M, 2, 2) of their positions
    apart   (N, M) whether track and box are on two levels
    gate    maximum squared Mahalanobis distance
    """
    if not len(confirmed) or not len(boxes):
        return [], []
    offset = boxes[None, :, :2] - tracks.state[:, None, :2]
    spread = tracks.covariance[:, None, :2, :2] + noise[None]
    distance, size = squared_mahalanobis(offset, spread)
    # Minus twice the log-likelihood: its normalization prevents that an uncertain track wins by its wide gate.
    cost, inside = distance + np.log(size), (distance <= gate) & ~apart
    alone = ~(inside.any(axis=0) | inside.any(axis=1, keepdims=True))
    nearby = (distance <= UNASSIGNED_GATE) & ~apart & alone
    rows: list[int] = []
    columns: list[int] = []
    for group, fits in ((confirmed, inside), (~confirmed, inside), (~confirmed, nearby)):
        candidates = np.flatnonzero(group)
        free = np.setdiff1d(np.arange(len(boxes)), columns) if columns else np.arange(len(boxes))
        for row, column in assign_matrix(cost[candidates][:, free], fits[candidates][:, free]):
            rows.append(int(candidates[row]))
            columns.append(int(free[column]))
    return rows, columns


def squared_mahalanobis(offset: Array, covariance: Array) -> tuple[Array, Array]:
    """Return the squared Mahalanobis distances (...) of offsets (..., 2), and the determinants (...) of their
    covariances (..., 2, 2).

    The closed inverse of 2 x 2 matrices is used, because a solver would iterate over them.
    """
    x, y = offset[..., 0], offset[..., 1]
    xx, xy, yy = covariance[..., 0, 0], covariance[..., 0, 1], covariance[..., 1, 1]
    determinant = xx * yy - xy * xy
    return (yy * x * x - 2.0 * xy * x * y + xx * y * y) / determinant, determinant


def make_plausible(covariance: Array) -> Bools:
    """Replace unknown position covariances in (N, D, D), and raise implausibly small ones.

    Return whether each was unknown (N,).
    """
    xx, xy, yy = covariance[:, 0, 0], covariance[:, 0, 1], covariance[:, 1, 1]
    unknown: Bools = ~np.isfinite(xx + yy + xy)
    if unknown.any():
        covariance[unknown, :2, :2] = UNKNOWN_DEVIATION**2 * np.eye(2)
    least = LEAST_DEVIATION**2
    is_singular = xy * xy >= (1.0 - SINGULAR) * xx * yy
    more = np.where(is_singular | (np.minimum(xx, yy) < least), least, 0.0)
    xx += more
    yy += more
    return unknown


DETECTION_PROBABILITY = 0.9
"""Default probability that an object in full view is detected. The networks detect 89 % of the vehicles that are not
low in the image, dark, occluded or cut off (docs/perception.md)."""
BIRTH_DENSITY = 0.01
"""Default density of new objects [1/m² per scan]: one in the area of about two parked cars in ten scans. Small values
give a second detection nearby a high weight; the density of a detection that is exact to 1 m is 0.16 / m²."""
LIFETIME = 10.0
"""Default mean time that an object remains [s]: a survival probability of 0.99 per scan of 0.1 s, in the usual range of
0.98 to 0.999."""
LEAST, MOST = 1e-4, 1.0 - 1e-4
"""Minimum and maximum confidence that a single detection contributes."""


def survived(existence: Array, step: float | Array, lifetime: float = LIFETIME) -> Array:
    """Return the probabilities (N,) after `step` [s] without a scan."""
    return np.asarray(existence * np.exp(-np.abs(step) / lifetime))


def missed(existence: Array, detection: float | Array = DETECTION_PROBABILITY) -> Array:
    """Return the probabilities (N,) after a scan without detection, for these detection probabilities."""
    return np.asarray(existence * (1.0 - detection) / np.maximum(1.0 - existence * detection, 1e-12))


def detected(existence: Array, ratio: Array) -> Array:
    """Return the probabilities (N,) after detections with these likelihood ratios."""
    return np.asarray(existence * ratio / (1.0 - existence + existence * ratio))


def likelihood_ratio(
    squared: Array,
    determinant: Array,
    confidence: Array,
    detection: float = DETECTION_PROBABILITY,
    birth: float = BIRTH_DENSITY,
) -> Array:
    """Return the likelihood ratios L (N,) of two-dimensional detections.

    squared      (N,) squared Mahalanobis distances of the innovations;  determinant  (N,) of their covariances [m⁴]
    confidence   (N,) of the detector
    """
    sure = np.minimum(np.maximum(confidence, LEAST), MOST)
    density = np.exp(-0.5 * squared) / (2.0 * math.pi * np.sqrt(determinant))
    return np.asarray(1.0 - detection + density / birth * sure / (1.0 - sure))
