"""Ray casts through the world, and what lines between points cross."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from operator import itemgetter

import msgspec
import numpy as np
from numpy.typing import ArrayLike

from eidrive_scenario.base.arrays import Array, Integers
from eidrive_scenario.base.geometry import rotation_matrix
from eidrive_scenario.world.physics.bullet import STATIC, TERRAIN, bullet
from eidrive_scenario.world.physics.scenery import Scenery
from eidrive_scenario.world.view import RayHits, WorldView

_HANDLE, _FRACTION, _NORMAL = itemgetter(0), itemgetter(2), itemgetter(4)
_BATCH = 16_000
_STEP_IN = 0.01
"""Distance by which a ray continues inside a skipped body [m].

From a millimeter inside, pybullet hits the body again; from a centimeter in 0.3 % of directions, along the surface. The
distance is doubled each time.
"""
_STEPS = 12
"""Maximum number of continuations per skipped body: 40 m after the last."""


def cast_rays(
    client: int, origins: ArrayLike, targets: ArrayLike, row_of_handle: Integers, passed: Sequence[int]
) -> RayHits:
    """Cast rays (M, 3) to (M, 3), or from or to one point. Bodies whose rows are in `passed` are skipped.

    The last entry of `row_of_handle`, for handle -1, is NOTHING.
    """
    ends = (np.reshape(np.asarray(points, dtype=float), (-1, 3)) for points in (origins, targets))
    origins, targets = (np.ascontiguousarray(points) for points in np.broadcast_arrays(*ends))
    handles, fraction, normal = cast(client, origins, targets)
    rows = row_of_handle[handles]
    if len(passed):
        length = np.linalg.norm(targets - origins, axis=1)
        step = np.full(len(rows), _STEP_IN)
        for _ in range(_STEPS * len(passed)):
            # Rays that hit a skipped body continue a step behind the hit; fractions stay those of the whole ray.
            again = np.flatnonzero(np.isin(rows, passed))
            if not len(again):
                break
            start = np.minimum(fraction[again] + step[again] / np.maximum(length[again], step[again]), 1.0)
            begin = origins[again] + start[:, None] * (targets[again] - origins[again])
            handles, further, normal[again] = cast(client, begin, targets[again])
            before, rows[again] = rows[again], row_of_handle[handles]
            step[again] = np.where(rows[again] == before, 2.0 * step[again], _STEP_IN)
            fraction[again] = np.where(handles < 0, 1.0, start + further * (1.0 - start))
    position = origins + fraction[:, None] * (targets - origins)
    return RayHits(rows, fraction, position, normal)


def first_hits(
    client: int, origins: Sequence[Sequence[float]], targets: Sequence[Sequence[float]], row_of_handle: list[int]
) -> list[int]:
    """Return the rows of the first hits as `cast_rays` does, without arrays; for at most one batch of rays."""
    hits = bullet.rayTestBatch(origins, targets, numThreads=1, physicsClientId=client)
    return [row_of_handle[hit[0]] for hit in hits]


def cast(client: int, origins: Array, targets: Array, groups: int = -1) -> tuple[Integers, Array, Array]:
    """Return handle, share of the distance (M,) and normal (M, 3) of the first hits of rays on bodies of some groups.

    groups  sum of groups of the collision filter
    """
    count = len(origins)
    handles, fraction, normal = np.empty(count, dtype=np.int64), np.empty(count), np.empty((count, 3))
    for start in range(0, count, _BATCH):
        part = slice(start, start + _BATCH)
        hits = bullet.rayTestBatch(
            origins[part], targets[part], numThreads=1, collisionFilterMask=groups, physicsClientId=client
        )
        handles[part] = np.fromiter(map(_HANDLE, hits), np.int64, len(hits))
        fraction[part] = np.fromiter(map(_FRACTION, hits), float, len(hits))
        normals = np.fromiter(chain.from_iterable(map(_NORMAL, hits)), float, 3 * len(hits))
        normal[part] = normals.reshape(-1, 3)
    return handles, fraction, normal


TOUCH = 1e-6
"""Depth up to which a line touches a box and does not cross it [m]."""
_MARGIN = 0.1
"""Distance by which circles around objects are enlarged [m]."""
_ELEMENTS = 16_000
"""Number of pairs of a line and a circle that are compared at once."""
_MOST_CANDIDATES = 1_000_000
"""Number of pairs of a line and an actor that are compared before further lines, which bounds the memory."""
_MOST_ELEMENTS = 4_000_000
"""Number of pairs of a line and a static object above which rays are cast instead of comparing them."""


class Crossings(msgspec.Struct, frozen=True):
    """Crossings of M lines.

    lines    (K,) indices of lines that cross an actor, in ascending order
    rows     (K,) rows of these actors in the view, in the order along each line
    shares   (K,) share of the length at which the line enters the actor, 0 if it begins inside
    scenery  (M,) share of the length at which the line meets the ground or a static object, 1 if it does not
    """

    lines: Integers
    rows: Integers
    shares: Array
    scenery: Array


def find_crossings(client: int, scenery: Scenery, view: WorldView, begins: Array, ends: Array, most: int) -> Crossings:
    """Return what the lines from points (M, 3) to points (M, 3) cross. A line that touches an actor does not cross it.

    most  number of actors after which the others on a line are left out

    Static objects are found by pybullet, and actors from their boxes: a ray of pybullet also hits boxes that it passes
    at a distance of up to a millimeter.
    """
    rotation = rotation_matrix(*view.kinematics[:, 3:6].T)
    centers, half = view.position + (rotation @ view.offset[:, :, None])[:, :, 0], view.size / 2.0
    x, y, z = centers.T
    reach_x, reach_y, reach_z = (np.abs(rotation) @ half[:, :, None])[:, :, 0].T
    circles = np.stack([x, y, np.hypot(reach_x, reach_y), z + reach_z])
    parts = []
    step = max(_MOST_CANDIDATES // max(len(view.names), 1), 1)
    for first in range(0, max(len(begins), 1), step):
        start, end = begins[first : first + step], ends[first : first + step]
        lines, rows = _near(start, end, circles)
        # In the frames of the boxes
        to_body = rotation[rows].transpose(0, 2, 1)
        begin = (to_body @ (start[lines] - centers[rows])[:, :, None])[:, :, 0]
        way = (to_body @ (end[lines] - start[lines])[:, :, None])[:, :, 0]
        enters, leaves = _crossing_shares(begin, way, half[rows] - TOUCH)
        crossed = np.flatnonzero((enters < leaves) & (enters < 1.0) & (leaves > 0.0))
        lines, rows, shares = lines[crossed], rows[crossed], np.maximum(enters[crossed], 0.0)
        order = np.lexsort((rows, shares, lines))
        order = order[np.arange(len(order)) - np.searchsorted(lines[order], lines[order]) < most]
        parts.append((lines[order] + first, rows[order], shares[order]))
    lines, rows, shares = map(np.concatenate, zip(*parts, strict=True))
    return Crossings(lines, rows, shares, _scenery_shares(client, scenery, begins, ends))


def _scenery_shares(client: int, scenery: Scenery, begins: Array, ends: Array) -> Array:
    """Return the shares (M,) of `Crossings.scenery`. Rays are cast for lines that may meet something."""
    shares = np.ones(len(begins))
    tested = np.arange(len(begins))
    above = min(begins[:, 2].min(initial=1.0), ends[:, 2].min(initial=1.0)) > 0.0
    if scenery.level and above:
        circles = scenery.circles
        if circles.shape[1] * len(begins) <= _MOST_ELEMENTS:
            tested = np.unique(_near(begins, ends, circles)[0])
    if len(tested):
        shares[tested] = cast(client, begins[tested], ends[tested], STATIC | TERRAIN)[1]
    return shares


def _near(begins: Array, ends: Array, circles: Array) -> tuple[Integers, Integers]:
    """Return pairs of indices of lines and circles (4, K) where the line passes a circle in plan view below its top.

    circles  center x, y, radius, and top of the object in the circle [m]
    """
    high = np.flatnonzero(circles[3] > np.minimum(begins[:, 2], ends[:, 2]).min(initial=np.inf))
    lines, indices = [np.zeros(0, dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
    way = ends - begins
    square = np.maximum(way[:, 0] ** 2 + way[:, 1] ** 2, _MARGIN * _MARGIN)
    (x, y, z), (dx, dy, rise) = begins.T, way.T
    step = max(_ELEMENTS // max(len(begins), 1), 1)
    for start in range(0, len(high), step):
        some = high[start : start + step]
        center_x, center_y, radius, top = circles[:, some, None]
        px, py, reach = center_x - x, center_y - y, radius + _MARGIN
        # The point of the line that is nearest to the center, then the part of the line inside the circle
        share = ((px * dx + py * dy) / square).clip(0.0, 1.0)
        circle, line = np.nonzero((px - share * dx) ** 2 + (py - share * dy) ** 2 <= reach * reach)
        half, share = reach[circle, 0] / np.sqrt(square[line]), share[circle, line]
        first, last = np.maximum(share - half, 0.0), np.minimum(share + half, 1.0)
        below = z[line] + np.minimum(rise[line] * first, rise[line] * last) < top[circle, 0]
        lines.append(line[below])
        indices.append(some[circle[below]])
    return np.concatenate(lines), np.concatenate(indices)


def _crossing_shares(begin: Array, way: Array, half: Array) -> tuple[Array, Array]:
    """Return the shares (K,) at which lines enter and leave boxes around the origin, in the frames of the boxes.

    begin, way, half  (K, 3) starts, vectors to the ends, and half the sizes of the boxes [m]
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        low, high = (-half - begin) / way, (half - begin) / way
    inside = np.abs(begin) < half
    parallel = way == 0.0
    low[parallel], high[parallel] = np.where(inside, -np.inf, np.inf)[parallel], np.inf
    return np.minimum(low, high).max(axis=1), np.maximum(low, high).min(axis=1)
