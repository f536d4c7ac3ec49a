"""Rays through the world, to see by and to measure with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from eidrive_scenario.arrays import Array, Integers
from eidrive_scenario.world.physics.bullet import bullet

Point = tuple[float, float, float]

GROUND, NOTHING = -1, -2
"""Rows of a ray that ended at the ground or a building, and of one that met nothing."""

_BATCH = 16_000
_STEP_IN = 0.01
"""How far a ray is moved into a body that it may pass [m]. From a millimeter inside, pybullet sees the body again; from
a centimeter in 0.3 % of directions, those along its surface, which then go in twice as far each time."""
_STEPS = 12
"""So often for each body that may be passed: 40 m after the last."""


@dataclass(frozen=True)
class RayHits:
    """What rays met first.

    rows      (M,) row of the actor in the view; GROUND (-1) for the ground and buildings, NOTHING (-2)
    fraction  (M,) share of the way from origin to target, 1 where nothing was met
    position  (M, 3) where [m], the target where nothing was met
    normal    (M, 3) of the surface, zero where nothing was met
    """

    rows: Integers
    fraction: Array
    position: Array
    normal: Array


def cast_rays(client: int, origins: Array, targets: Array, row_of_handle: Integers, passed: Integers) -> RayHits:
    """Cast rays (M, 3) to (M, 3); those bodies whose rows are in `passed` are looked through.

    The last entry of `row_of_handle`, which is that of the handle -1, is NOTHING.
    """
    handles, fraction, normal = _cast(client, origins, targets)
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
            handles, further, normal[again] = _cast(client, begin, targets[again])
            before, rows[again] = rows[again], row_of_handle[handles]
            step[again] = np.where(rows[again] == before, 2.0 * step[again], _STEP_IN)
            fraction[again] = np.where(handles < 0, 1.0, start + further * (1.0 - start))
    position = origins + fraction[:, None] * (targets - origins)
    return RayHits(rows, fraction, position, normal)


def first_met(client: int, origins: Sequence[Point], targets: Sequence[Point], row_of_handle: list[int]) -> list[int]:
    """Return the rows that rays meet first, as of `cast_rays` but without arrays: for a few rays, one batch at most."""
    hits = bullet.rayTestBatch(origins, targets, numThreads=1, physicsClientId=client)
    return [row_of_handle[hit[0]] for hit in hits]


def _cast(client: int, origins: Array, targets: Array) -> tuple[Integers, Array, Array]:
    count = len(origins)
    handles, fraction, normal = np.empty(count, dtype=np.int64), np.empty(count), np.empty((count, 3))
    for start in range(0, count, _BATCH):
        part = slice(start, start + _BATCH)
        hits = bullet.rayTestBatch(origins[part], targets[part], numThreads=1, physicsClientId=client)
        handles[part] = [hit[0] for hit in hits]
        fraction[part] = [hit[2] for hit in hits]
        normal[part] = [hit[4] for hit in hits]
    return handles, fraction, normal
