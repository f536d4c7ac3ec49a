"""Line of sight between antennas: positions of antennas, and blocking bodies between them."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from eidrive_scenario.v2x.radio_environment import LOS, NLOS, NLOSV, LineOfSightStates
from eidrive_scenario.world import World
from eidrive_scenario.world.actor import ActorSpec
from eidrive_scenario.world.physics.rays import NOTHING
from eidrive_scenario.world.view import WorldView

Place = tuple[float, float, float]

_BEYOND = 0.02
"""Distance behind a hit at which the ray continues [m]; pybullet rarely reports the same body again from there."""
_FEW = 8
"""Maximum number of rays that are first tested for any hit, which is faster."""
_MOST_BODIES = 16
"""Maximum number of bodies per ray; further bodies do not change the path loss."""


def antenna_position(view: WorldView, spec: ActorSpec, height: float | None) -> Place:
    """Return the antenna position of a station in the world frame [m], above the center of its box.

    height  above the reference point [m]; None: on the roof. Pitch and roll are neglected.
    """
    row = view.rows[spec.name]
    x, y, z, yaw, *_ = view.states[row]
    cos, sin = math.cos(yaw), math.sin(yaw)
    ahead, aside, up = spec.offset
    over = up + spec.size[2] / 2.0 if height is None else height
    return (x + cos * ahead - sin * aside, y + sin * ahead + cos * aside, z + over)


def line_of_sight_states(world: World, places: dict[str, Place], pairs: Sequence[tuple[str, str]]) -> LineOfSightStates:
    """Return the line-of-sight state of these pairs of antennas; the bodies of the pair do not block.

    An actor in between gives NLOSv, a building or the ground NLOS.
    """
    count = len(pairs)
    view = world.view()
    if count <= _FEW:
        met = world.first_hit(*_ends(places, pairs))
        if all(row in (NOTHING, view.rows.get(second)) for row, (_, second) in zip(met, pairs, strict=True)):
            return LineOfSightStates(np.full(count, LOS), np.full(count, -np.inf), {})
    origins, targets = (np.array(points, dtype=float).reshape(-1, 3) for points in _ends(places, pairs))
    states, heights = np.full(count, LOS), np.full(count, -np.inf)
    found: dict[int, list[str]] = {}
    tops = view.centers[:, 2] + view.size[:, 2] / 2.0
    length = np.maximum(np.linalg.norm(targets - origins, axis=1), _BEYOND)
    begun = np.zeros(count)
    open_rays = np.arange(count)
    for _ in range(_MOST_BODIES):
        if not len(open_rays):
            break
        way = targets[open_rays] - origins[open_rays]
        hits = world.raycast(origins[open_rays] + begun[open_rays, None] * way, targets[open_rays])
        going_on = []
        for ray, row, fraction in zip(open_rays.tolist(), hits.rows.tolist(), hits.fraction.tolist(), strict=True):
            if fraction >= 1.0:
                continue
            if row < 0:
                states[ray] = NLOS
                continue
            name = view.names[row]
            if name == pairs[ray][1]:
                continue  # The body of the other station: nothing is between it and its antenna
            if name != pairs[ray][0] and name not in found.get(ray, ()):
                found.setdefault(ray, []).append(name)
                states[ray] = NLOSV
                heights[ray] = max(heights[ray], tops[row])
            begun[ray] += fraction * (1.0 - begun[ray]) + _BEYOND / length[ray]
            if begun[ray] < 1.0:
                going_on.append(ray)
        open_rays = np.array(going_on, dtype=np.int64)
    return LineOfSightStates(states, heights, {ray: tuple(names) for ray, names in found.items()})


def _ends(places: dict[str, Place], pairs: Sequence[tuple[str, str]]) -> tuple[list[Place], list[Place]]:
    return [places[first] for first, _ in pairs], [places[second] for _, second in pairs]
