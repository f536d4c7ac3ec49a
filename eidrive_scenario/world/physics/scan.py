"""Objects in the directions of many rays from one point, in plan view."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.arrays import Array

_BINS = 720
"""Number of directions in plan view in which objects are searched."""
MARGIN = 0.1
"""Minimum distance of an object from free space, or from a ray that does not meet it [m]."""


def may_meet(apex: Array, targets: Array, circles: Array) -> NDArray[np.bool_]:
    """Return whether rays from a point (3,) above the plane z = 0 to targets (M, 3) may meet an object.

    circles  (4, K) circles around the objects in plan view: center x, y and radius, and the top of the object [m]

    A ray meets nothing above the tops of all objects in its direction, and nothing that is behind its end or the point
    at which it meets the plane.
    """
    near, top = _nearest_and_highest(apex, circles)
    x, y, rise = (targets - apex).T
    length = np.hypot(x, y)
    direction = ((np.arctan2(y, x) + math.pi) * (_BINS / (2.0 * math.pi))).astype(np.int64).clip(0, _BINS - 1)
    near, top = near[direction], top[direction]
    # Height of the ray at the nearest object in its direction
    height = apex[2] + rise * np.minimum(near / np.maximum(length, 1e-9), 1.0)
    met: NDArray[np.bool_] = (near <= length + MARGIN) & (height >= -MARGIN) & ((rise <= 0.0) | (height <= top))
    met |= length < MARGIN
    return met


def _nearest_and_highest(apex: Array, circles: Array) -> tuple[Array, Array]:
    """Return the distance of the nearest object in each direction, infinite without one, and the top of the highest."""
    x, y, radius, top = circles
    x, y, radius, top = x - apex[0], y - apex[1], radius + MARGIN, top + MARGIN
    away = np.hypot(x, y)
    half = np.where(away > radius, np.arcsin(np.minimum(radius / np.maximum(away, radius), 1.0)), math.pi)
    center, scale = np.arctan2(y, x) + math.pi, _BINS / (2.0 * math.pi)
    first = np.floor((center - half) * scale).astype(np.int64) - 1
    count = np.minimum(np.floor((center + half) * scale).astype(np.int64) + 2 - first, _BINS)
    of = np.arange(len(count)).repeat(count)
    bins = (first[of] + np.arange(len(of)) - (count.cumsum() - count)[of]) % _BINS
    near, high = np.full(_BINS, np.inf), np.full(_BINS, -np.inf)
    np.minimum.at(near, bins, np.maximum(away - radius, 0.0)[of])
    np.maximum.at(high, bins, top[of])
    return near, high
