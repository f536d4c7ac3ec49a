"""Segmentation of lidar points: points of the ground, and clusters of the others."""

from __future__ import annotations

import math

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from eidrive_scenario.base.arrays import Array, Integers
from eidrive_scenario.base.randomness import generator

SECTORS = 24
"""Number of sectors around the sensor."""
BIN = 2.0
"""Bin size along the range [m]."""
NEAR = 30.0
"""Maximum distance of points for the fit of the plane [m]."""
TRIALS = 60
"""Number of RANSAC trials. With half of the points on the ground, the probability that no pair of 60 has both points
there is 0.75^60 = 3e-8."""
STEEPEST = 0.25
"""Maximum slope of the plane."""
ON_PLANE = 0.12
"""Maximum distance of supporting points from the plane [m]."""
BEND = 0.02
"""Maximum slope of the ground relative to the plane."""
ROUGHNESS = 0.1
"""Maximum step of the ground relative to the plane [m]."""
CLEARANCE = 0.25
"""Height above the ground from which points are not ground [m]."""


def ground_height(points: Array, foot: float) -> Array:
    """Return the height (N,) of the ground below each of the points (N, 3) of a level frame [m].

    First, a plane through `foot`, the height of the ground below the sensor, is fitted by RANSAC (Fischler and Bolles
    1981) to the lowest points of the bins of each sector. Then the lowest points are followed outwards in each sector,
    because roads are not planar. A point that deviates from the ground before it by more than the slope of roads is not
    ground.

    The method follows Himmelsbach, von Hundelshausen and Wünsche, Fast segmentation of 3D point clouds for ground
    vehicles, IV 2010, with lowest points instead of lines. Sectors are centered on the x axis of the frame, so that a
    mirrored scene has mirrored sectors.
    """
    if not len(points):
        return np.empty(0)
    distance = np.hypot(points[:, 0], points[:, 1])
    turn = np.arctan2(points[:, 1], points[:, 0]) * (SECTORS / (2.0 * math.pi))
    sector = np.rint(turn).astype(np.int64) % SECTORS
    bins = int(distance.max() / BIN) + 1
    cell = sector * bins + (distance / BIN).astype(np.int64)
    low = _lowest(points[:, 2], cell)
    near = low[distance[low] < NEAR]
    slope = _plane(points[near, :2], points[near, 2] - foot)
    plane = foot + points[:, :2] @ slope
    offset, where = np.full((SECTORS, bins), np.inf), np.zeros((SECTORS, bins))
    offset.ravel()[cell[low]] = points[low, 2] - plane[low]
    where.ravel()[cell[low]] = distance[low]
    # Outward along each sector: a point is ground if it is hardly higher or lower than the last one that is.
    is_ground = np.zeros(offset.shape, dtype=bool)
    last, at = np.zeros(SECTORS), np.zeros(SECTORS)
    for number in range(bins):
        fits = np.abs(offset[:, number] - last) <= BEND * (where[:, number] - at) + ROUGHNESS
        is_ground[:, number] = fits
        last, at = np.where(fits, offset[:, number], last), np.where(fits, where[:, number], at)
    order = np.argsort(sector, kind="stable")
    bounds = np.searchsorted(sector[order], np.arange(SECTORS + 1))
    for number in range(SECTORS):
        mine = order[bounds[number] : bounds[number + 1]]
        known = is_ground[number]
        if mine.size and known.any():
            along = np.concatenate([[0.0], where[number, known]])
            plane[mine] += np.interp(distance[mine], along, np.concatenate([[0.0], offset[number, known]]))
    return plane


def _lowest(z: Array, cell: Integers) -> Integers:
    """Return the row of the lowest point of each cell, in order of the cells; of several, the first one."""
    count = int(cell.max()) + 1
    height = np.full(count, np.inf)
    np.minimum.at(height, cell, z)
    rows = np.flatnonzero(z == height[cell])[::-1]
    row = np.full(count, -1)
    row[cell[rows]] = rows
    return row[row >= 0]


def _plane(plan: Array, rise: Array) -> Array:
    """Return the slopes (2,) of the plane through the origin that most points (K, 2) with heights (K,) support."""
    if len(plan) < 2:
        return np.zeros(2)
    pairs = generator(0, "ground plane").integers(0, len(plan), size=(TRIALS, 2))
    a, b = plan[pairs[:, 0]], plan[pairs[:, 1]]
    area = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    usable = np.abs(area) > 1.0
    za, zb = rise[pairs[:, 0]], rise[pairs[:, 1]]
    slopes = np.stack([za * b[:, 1] - zb * a[:, 1], zb * a[:, 0] - za * b[:, 0]], axis=1)
    slopes[usable] /= area[usable, None]
    slopes = slopes[usable & (np.hypot(slopes[:, 0], slopes[:, 1]) <= STEEPEST)]
    slopes = np.concatenate([np.zeros((1, 2)), slopes])
    support = np.count_nonzero(np.abs(rise - slopes @ plan.T) <= ON_PLANE, axis=1)
    best: Array = slopes[int(np.argmax(support))]
    for _ in range(2):
        on = np.abs(rise - plan @ best) <= ON_PLANE
        if np.count_nonzero(on) < 3:
            break
        best = np.asarray(np.linalg.lstsq(plan[on], rise[on], rcond=None)[0], dtype=np.float64)
    return best


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
