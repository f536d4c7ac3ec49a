"""Data association of detections and tracks: gated global nearest neighbors."""

from __future__ import annotations

import numpy as np

from eidrive_scenario.arrays import Array, Bools
from eidrive_scenario.assignment import assign_matrix
from eidrive_scenario.perception.tracking.motion_models import Estimates

UNKNOWN_DEVIATION = 0.5
"""Standard deviation of positions for which the detector states no covariance [m]."""
LEAST_DEVIATION = 0.05
"""Standard deviation that is added to positions with a smaller one, such as 0 [m]."""


def associate(
    tracks: Estimates, confirmed: Bools, boxes: Array, noise: Array, gate: float
) -> tuple[list[int], list[int]]:
    """Return the rows of associated tracks and boxes; confirmed tracks are assigned before others.

    tracks  (N,) predicted;  confirmed  (N,);  boxes (M, 7), and noise (M, 2, 2) of their positions
    gate    maximum squared Mahalanobis distance
    """
    if not len(confirmed) or not len(boxes):
        return [], []
    offset = boxes[None, :, :2] - tracks.state[:, None, :2]
    spread = tracks.covariance[:, None, :2, :2] + noise[None]
    a, b, d = spread[..., 0, 0], spread[..., 0, 1], spread[..., 1, 1]
    x, y = offset[..., 0], offset[..., 1]
    size = a * d - b * b
    distance = (d * x * x - 2.0 * b * x * y + a * y * y) / size
    # Minus twice the log-likelihood: its normalization prevents that an uncertain track wins by its wide gate.
    cost, inside = distance + np.log(size), distance <= gate
    rows: list[int] = []
    columns: list[int] = []
    for group in (np.flatnonzero(confirmed), np.flatnonzero(~confirmed)):
        free = np.setdiff1d(np.arange(len(boxes)), columns) if columns else np.arange(len(boxes))
        for row, column in assign_matrix(cost[group][:, free], inside[group][:, free]):
            rows.append(int(group[row]))
            columns.append(int(free[column]))
    return rows, columns


def position_noise(covariance: Array) -> Array:
    """Return position covariances (N, 2, 2), with defaults for missing and too small ones."""
    noise = covariance.copy()
    make_plausible(noise)
    return noise


def make_plausible(covariance: Array) -> Bools:
    """Replace unknown position covariances in (N, D, D), and raise implausibly small ones.

    Return whether each was unknown (N,).
    """
    xx, yy = covariance[:, 0, 0], covariance[:, 1, 1]
    unknown: Bools = ~np.isfinite(xx + yy + covariance[:, 0, 1])
    if unknown.any():
        covariance[unknown, :2, :2] = UNKNOWN_DEVIATION**2 * np.eye(2)
    least = LEAST_DEVIATION**2
    more = np.where(np.minimum(xx, yy) < least, least, 0.0)
    xx += more
    yy += more
    return unknown
