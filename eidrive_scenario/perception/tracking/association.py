"""Which detections of one instant belong to which tracks: gated global nearest neighbors."""

from __future__ import annotations

import numpy as np
from scipy.optimize import linear_sum_assignment

from eidrive_scenario.arrays import Array, Bools
from eidrive_scenario.perception.tracking.motion_models import Estimates

UNKNOWN_DEVIATION = 0.5
"""Of positions for which the detector gives no covariance [m]."""
LEAST_DEVIATION = 0.05
"""Of positions for which it gives a smaller one, none at all for instance [m]."""
OUTSIDE = 1e6
"""Cost of a pair beyond the gate; larger than any sum of costs within."""


def associate(
    tracks: Estimates, confirmed: Bools, boxes: Array, noise: Array, gate: float
) -> tuple[list[int], list[int]]:
    """Rows of tracks and of boxes that belong together; confirmed tracks choose before others.

    tracks  (N,) predicted;  confirmed  (N,);  boxes (M, 7), and noise (M, 2, 2) of their positions
    gate    largest squared Mahalanobis distance
    """
    if not len(confirmed) or not len(boxes):
        return [], []
    offset = boxes[None, :, :2] - tracks.state[:, None, :2]
    spread = tracks.covariance[:, None, :2, :2] + noise[None]
    a, b, d = spread[..., 0, 0], spread[..., 0, 1], spread[..., 1, 1]
    x, y = offset[..., 0], offset[..., 1]
    size = a * d - b * b
    distance = (d * x * x - 2.0 * b * x * y + a * y * y) / size
    # Minus twice the log of the likelihood, so that a track of which little is known does not win by its width.
    cost = np.where(distance <= gate, distance + np.log(size), OUTSIDE)
    rows: list[int] = []
    columns: list[int] = []
    for group in (np.flatnonzero(confirmed), np.flatnonzero(~confirmed)):
        free = np.setdiff1d(np.arange(len(boxes)), columns) if columns else np.arange(len(boxes))
        for row, column in _assigned(cost[group][:, free]):
            rows.append(int(group[row]))
            columns.append(int(free[column]))
    return rows, columns


def position_noise(covariance: Array) -> Array:
    """(N, 2, 2) of the positions measured, where the detector says nothing or too little of it."""
    unknown = np.asarray(np.any(~np.isfinite(covariance), axis=(1, 2)))
    noise = np.where(unknown[:, None, None], UNKNOWN_DEVIATION**2 * np.eye(2), covariance)
    thin = (noise[:, 0, 0] < LEAST_DEVIATION**2) | (noise[:, 1, 1] < LEAST_DEVIATION**2)
    return np.where(thin[:, None, None], noise + LEAST_DEVIATION**2 * np.eye(2), noise)


def _assigned(cost: Array) -> list[tuple[int, int]]:
    """Pairs of rows and columns with the least sum of costs, as many as there are within the gate."""
    if not cost.size:
        return []
    inside = cost < OUTSIDE
    rows, columns = np.nonzero(inside)
    if len(set(rows.tolist())) < len(rows) or len(set(columns.tolist())) < len(columns):
        rows, columns = linear_sum_assignment(cost)
    return [(row, column) for row, column in zip(rows.tolist(), columns.tolist(), strict=True) if inside[row, column]]
