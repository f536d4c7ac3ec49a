"""Segmentation of lidar points: points of the air and of the ground, and clusters of the others."""

from __future__ import annotations

import math

import numpy as np

from eidrive_scenario.base.arrays import Array, Bools, Integers
from eidrive_scenario.base.kernels import kernel
from eidrive_scenario.base.randomness import generator

FAINT, FAINT_NEAR = 0.03, 2.5e-4
"""Intensity, and intensity over the square of the distance [1/m²], below which a point may be of the air. Fog with a
visibility of 90 m returns less than 1.1e-4 to all but one ray in a thousand, in proportion to its density; 98 % of the
returns from beyond 10 m are below 0.03."""
AIR, CLOSE, SEVERAL = 25.0, 5.0, 5
"""Maximum distance of points of the air [m], and distance within which there are several of them if there are any [m]:
the nearest fog and drops return most, and surfaces so near are not that faint."""


def is_of_surface(points: Array, intensity: Array) -> Bools:
    """Return which points (N, 3) in the frame of the sensor are of surfaces, and not of fog, rain or snow.

    Returns of the air are near and faint (Park, Kim and Kim, Fast and accurate desnowing algorithm for LiDAR point
    clouds, IEEE Access 8, 2020), but so are some of dark surfaces at grazing incidence. Therefore they are omitted only
    if the air surrounds the sensor. If no intensity (N,) is measured, and all are 0, all points are of surfaces.
    """
    distance = np.linalg.norm(points, axis=1)
    faint: Bools = (intensity < np.minimum(FAINT_NEAR * distance**2, FAINT)) & (distance < AIR)
    if np.count_nonzero(faint & (distance < CLOSE)) < SEVERAL or not intensity.any():
        return np.ones(len(points), dtype=bool)
    return ~faint


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
    lowest = np.full(SECTORS * bins, -1)
    _find_lowest(np.ascontiguousarray(points[:, 2]), cell, lowest)
    low = lowest[lowest >= 0]
    near = low[distance[low] < NEAR]
    slope = _plane(points[near, :2], points[near, 2] - foot)
    plane: Array = foot + points[:, :2] @ slope
    offset, where = np.full((SECTORS, bins), np.inf), np.zeros((SECTORS, bins))
    offset.ravel()[cell[low]] = points[low, 2] - plane[low]
    where.ravel()[cell[low]] = distance[low]
    _follow_ground(offset, where, sector, distance, plane)
    return plane


@kernel("void(f8[::1], i8[::1], i8[::1])")
def _find_lowest(z: Array, cell: Integers, lowest: Integers) -> None:
    """Find the row of the lowest point of each cell; of several, the first one."""
    for row, number in enumerate(cell):
        if lowest[number] < 0 or z[row] < z[lowest[number]]:
            lowest[number] = row


@kernel("void(f8[:,::1], f8[:,::1], i8[::1], f8[::1], f8[::1])")
def _follow_ground(offset: Array, where: Array, sector: Integers, distance: Array, plane: Array) -> None:
    """Add the offsets of the ground from the plane below points (N,), interpolated along the sector of each.

    offset, where  (SECTORS, B) offset of the lowest point of each bin from the plane, and its distance; reused
    """
    sectors, bins = offset.shape
    knots = np.zeros(sectors, dtype=np.int64)
    for number in range(sectors):
        # Outward along the sector: a point is ground if it is hardly higher or lower than the last one that is.
        last = at = 0.0
        for index in range(bins):
            rise, reach = offset[number, index], where[number, index]
            if abs(rise - last) <= BEND * (reach - at) + ROUGHNESS:
                last, at = rise, reach
                offset[number, knots[number]], where[number, knots[number]] = rise, reach
                knots[number] += 1
    for point, number in enumerate(sector):
        x, x0, y0, knot = distance[point], 0.0, 0.0, 0
        while knot < knots[number] and where[number, knot] <= x:
            x0, y0 = where[number, knot], offset[number, knot]
            knot += 1
        if knot < knots[number]:
            y0 += (offset[number, knot] - y0) / (where[number, knot] - x0) * (x - x0)
        plane[point] += y0


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
NEAREST = 0.8
"""Maximum distance of points that always belong to one cluster [m]: windows, which return nothing, leave such gaps."""
NEAREST_PART = 0.5
"""The same for the parts of an object, or of several that are close to each other [m]."""
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

    Euclidean clustering (Rusu, Semantic 3D object maps, 2010). The distance threshold grows with the
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
    distance = np.hypot(x, y)
    reach = np.maximum(NEAREST if grazing else NEAREST_PART, COLUMNS * azimuth_step * distance)
    of_cell = np.arange(len(x))
    _connect(x, y, distance, reach, azimuth_step, grazing, of_cell)
    label = np.unique(of_cell, return_inverse=True)[1][cell]
    return np.split(np.argsort(label, kind="stable"), np.cumsum(np.bincount(label))[:-1])


@kernel("void(f8[::1], f8[::1], f8[::1], f8[::1], f8, b1, i8[::1])")
def _connect(
    x: Array, y: Array, distance: Array, reach: Array, azimuth_step: float, grazing: bool, label: Integers
) -> None:
    """Find the first cell of the cluster of each cell; cells are in order of the columns of their grid."""
    farthest = math.hypot(reach.max(), DEEPEST) if grazing else reach.max()
    for second in range(len(x)):
        for first in range(second - 1, -1, -1):
            if x[second] - x[first] > farthest + CELL:
                break
            gap = math.hypot(x[second] - x[first], y[second] - y[first])
            if gap > farthest:
                continue
            connected = gap <= min(reach[first], reach[second])
            ahead, behind = min(distance[first], distance[second]), max(distance[first], distance[second])
            if grazing and not connected and behind - ahead <= DEEPEST:
                between = abs(
                    math.atan2(x[first] * y[second] - y[first] * x[second], x[first] * x[second] + y[first] * y[second])
                )
                steep = math.atan2(ahead * math.sin(between), behind - ahead * math.cos(between)) >= GRAZING
                connected = steep and between <= NEXT_COLUMN * azimuth_step
            if connected:
                low, high = _root(label, first), _root(label, second)
                label[max(low, high)] = min(low, high)
    for cell in range(len(x)):
        label[cell] = label[label[cell]]


@kernel("i8(i8[::1], i8)")
def _root(label: Integers, cell: int) -> int:
    """Return the first cell of a cluster, and shorten the path to it."""
    while label[cell] != cell:
        label[cell] = label[label[cell]]
        cell = label[cell]
    return cell
