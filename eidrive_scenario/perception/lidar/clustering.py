"""Clustering of lidar points into objects."""

from __future__ import annotations

import math

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from eidrive_scenario.arrays import Array, Integers

CELL = 0.1
"""Size of the cells in plan view whose points are merged beforehand [m]."""
NEAREST = 0.5
"""Maximum distance of points that always belong to one cluster [m]."""
COLUMNS = 2.0
"""Maximum number of gaps between neighboring columns of rays within a cluster, at larger distances."""
NEXT_COLUMN = 1.5
"""Maximum angle between points of neighboring columns, in gaps between columns."""
GRAZING = math.radians(10.0)
"""Minimum angle between the ray and the surface through two points of neighboring columns in one cluster."""
DEEPEST = 4.5
"""Maximum difference in range of such points [m]: less than the length of a car."""


def clusters(points: Array, azimuth_step: float, *, grazing: bool = True) -> list[Integers]:
    """Return the rows of each cluster of points (N, 2 or more) in plan view, with the sensor at the origin.

    Euclidean clustering with a k-d tree (Rusu, Semantic 3D object maps, 2010). The distance threshold grows with the
    distance from the sensor, as the gaps between the columns of rays do. With `grazing`, points of neighboring columns
    are also connected by the angle between the ray and the line through the points, for surfaces at grazing incidence
    (Bogoslavskyi and Stachniss, Fast range image-based segmentation of sparse 3D laser scans, IROS 2016).
    """
    if not len(points):
        return []
    plan = points[:, :2]
    _, cell = np.unique(np.floor(plan / CELL).astype(np.int64) @ (1 << 24, 1), return_inverse=True)
    counts = np.bincount(cell)
    x, y = np.bincount(cell, plan[:, 0]) / counts, np.bincount(cell, plan[:, 1]) / counts
    first, second = _connected_pairs(x, y, azimuth_step, grazing)
    links = coo_array((np.ones(len(first), dtype=np.int8), (first, second)), shape=(len(x), len(x)))
    count, of_cell = connected_components(links, directed=False)
    label = of_cell[cell]
    order = np.argsort(label, kind="stable")
    ends = np.searchsorted(label[order], np.arange(count + 1))
    return [order[ends[number] : ends[number + 1]].astype(np.int64) for number in range(count)]


def _connected_pairs(x: Array, y: Array, azimuth_step: float, grazing: bool) -> tuple[Integers, Integers]:
    """Return the pairs of cells that are connected."""
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
