"""Ray casts through the world."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from operator import itemgetter

import msgspec
import numpy as np
from numpy.typing import ArrayLike, NDArray

from eidrive_scenario.arrays import Array, Integers
from eidrive_scenario.world.physics.bullet import bullet

GROUND, NOTHING = -1, -2
"""Rows of rays that ended at the ground or a building, and of rays without a hit."""

_HANDLE, _FRACTION, _NORMAL = itemgetter(0), itemgetter(2), itemgetter(4)
_BATCH = 16_000
_STEP_IN = 0.01
"""Distance by which a ray continues inside a skipped body [m].

From a millimeter inside, pybullet hits the body again; from a centimeter in 0.3 % of directions, along the surface. The
distance is doubled each time.
"""
_STEPS = 12
"""Maximum number of continuations per skipped body: 40 m after the last."""


class RayHits(msgspec.Struct, frozen=True):
    """First hits of rays.

    rows      (M,) row of the actor in the view; GROUND (-1) for the ground and buildings, NOTHING (-2)
    fraction  (M,) share of the distance from origin to target, 1 without a hit
    position  (M, 3) of the hit [m], the target without a hit
    normal    (M, 3) of the surface, zero without a hit
    """

    rows: Integers
    fraction: Array
    position: Array
    normal: Array


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


def cast_some(
    client: int,
    origins: Array,
    targets: Array,
    row_of_handle: Integers,
    passed: Sequence[int],
    cast: NDArray[np.bool_],
) -> RayHits:
    """Return the same as `cast_rays` if all rays except those in `cast` (M,) meet the plane z = 0 or nothing."""
    some = np.flatnonzero(cast)
    found = cast_rays(client, origins[some], targets[some], row_of_handle, passed)
    if len(some) == len(cast):
        return found
    rows, fraction = np.full(len(cast), NOTHING, dtype=found.rows.dtype), np.ones(len(cast))
    normal = np.zeros((len(cast), 3))
    rows[some], fraction[some], normal[some] = found.rows, found.fraction, found.normal
    down = np.flatnonzero(~cast & (origins[:, 2] > 0.0) & (targets[:, 2] < 0.0))
    rows[down] = GROUND
    fraction[down], normal[down, 2] = plane_hits(origins[down], targets[down])
    return RayHits(rows, fraction, origins + fraction[:, None] * (targets - origins), normal)


def plane_hits(origins: Array, targets: Array) -> tuple[Array, Array]:
    """Return the shares at which rays (M, 3) to (M, 3) meet the plane z = 0, and the z of the normals there.

    All rays begin above the plane and end below it. The results have the rounding of pybullet, which meets a triangle
    around the ray in the plane (`btStaticPlaneShape` and `btTriangleRaycastCallback` of Bullet 3).
    """
    low, high = np.minimum(origins, targets), np.maximum(origins, targets)
    half, center = (high - low) * 0.5, (high + low) * 0.5
    radius = np.sqrt((half[:, 0] * half[:, 0] + half[:, 1] * half[:, 1]) + half[:, 2] * half[:, 2])
    x, y = center[:, 0], center[:, 1]
    normal = ((x + radius) - (x - radius)) * ((y + radius) - (y - radius))
    above, below = normal * origins[:, 2], normal * targets[:, 2]
    return above / (above - below), normal * (1.0 / np.sqrt(normal * normal))


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
