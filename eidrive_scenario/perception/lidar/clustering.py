"""Which points belong together."""

from __future__ import annotations

import math

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from eidrive_scenario.arrays import Array, Integers

CELL = 0.1
"""Points of one cell of this size seen from above are joined beforehand [m]."""
NEAREST = 0.5
"""Points within this distance always belong together [m]."""
COLUMNS = 2.0
"""Farther away they do within so many gaps between two neighboring columns of rays."""
NEXT_COLUMN = 1.5
GRAZING = math.radians(10.0)
"""Points of neighboring columns belong together where a surface through both meets the ray at this angle or more."""
DEEPEST = 4.5
"""But not if one lies this much behind the other: less than the length of a car [m]."""


def clusters(points: Array, azimuth_step: float, *, grazing: bool = True) -> list[Integers]:
    """The rows of each cluster of points (N, 2 or more) seen from above, the sensor at the origin.

    Euclidean clustering by a k-d tree (Rusu, Semantic 3D object maps, 2010) with a reach that grows with the distance
    from the sensor, as the gaps between its columns of rays do. With `grazing`, neighboring columns are also joined by
    the angle between the ray and what joins their points, for surfaces that the rays graze (Bogoslavskyi and Stachniss,
    Fast range image-based segmentation of sparse 3D laser scans, IROS 2016).
    """
    if not len(points):
        return []
    plan = points[:, :2]
    _, cell = np.unique(np.floor(plan / CELL).astype(np.int64) @ (1 << 24, 1), return_inverse=True)
    counts = np.bincount(cell)
    x, y = np.bincount(cell, plan[:, 0]) / counts, np.bincount(cell, plan[:, 1]) / counts
    first, second = _joined(x, y, azimuth_step, grazing)
    links = coo_array((np.ones(len(first), dtype=np.int8), (first, second)), shape=(len(x), len(x)))
    count, of_cell = connected_components(links, directed=False)
    label = of_cell[cell]
    order = np.argsort(label, kind="stable")
    ends = np.searchsorted(label[order], np.arange(count + 1))
    return [order[ends[number] : ends[number + 1]].astype(np.int64) for number in range(count)]


def _joined(x: Array, y: Array, azimuth_step: float, grazing: bool) -> tuple[Integers, Integers]:
    """Pairs of places that belong together."""
    distance = np.hypot(x, y)
    reach = np.maximum(NEAREST, COLUMNS * azimuth_step * distance)
    farthest = math.hypot(float(reach.max()), DEEPEST) if grazing else float(reach.max())
    pairs = cKDTree(np.stack([x, y], axis=1)).query_pairs(farthest, output_type="ndarray")
    a, b = pairs[:, 0], pairs[:, 1]
    gap = np.hypot(x[a] - x[b], y[a] - y[b])
    near = gap <= np.minimum(reach[a], reach[b])
    if grazing:
        between = np.abs(np.arctan2(x[a] * y[b] - y[a] * x[b], x[a] * x[b] + y[a] * y[b]))
        ahead, behind = np.minimum(distance[a], distance[b]), np.maximum(distance[a], distance[b])
        steep = np.arctan2(ahead * np.sin(between), behind - ahead * np.cos(between)) >= GRAZING
        near |= (between <= NEXT_COLUMN * azimuth_step) & steep & (behind - ahead <= DEEPEST)
    return a[near].astype(np.int64), b[near].astype(np.int64)
