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

_FEW = 16
"""Maximum number of rays that are first tested for any hit, which is faster."""
_MOST_BODIES = 16
"""Maximum number of blocking actors per line; further actors do not change the path loss."""


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

    An actor in between gives NLOSv, a building or the ground NLOS. Actors behind that are not counted.
    """
    count = len(pairs)
    view = world.view()
    if count <= _FEW:
        met = world.first_hit(*_ends(places, pairs))
        if all(row in (NOTHING, view.rows.get(second)) for row, (_, second) in zip(met, pairs, strict=True)):
            return LineOfSightStates(np.full(count, LOS), np.full(count, -np.inf), {})
    row_of, points = {name: row for row, name in enumerate(places)}, np.array([*places.values()])
    first, second = (np.fromiter([row_of[pair[end]] for pair in pairs], np.int64, count) for end in (0, 1))
    hidden = view.hidden_rows()
    crossed = world.crossings(points[first], points[second], _MOST_BODIES + 2 + len(hidden))
    lines, rows = crossed.lines, crossed.rows
    own = np.array([view.rows.get(name, NOTHING) for name in places])
    behind = crossed.shares >= crossed.scenery[lines]
    blocks = ~behind & ~np.isin(rows, hidden) & (rows != own[first][lines]) & (rows != own[second][lines])
    heights = np.full(count, -np.inf)
    tops = view.centers[:, 2] + view.size[:, 2] / 2.0
    found: dict[int, list[str]] = {}
    for line, row in zip(lines[blocks].tolist(), rows[blocks].tolist(), strict=True):
        names = found.setdefault(line, [])
        if len(names) < _MOST_BODIES:
            names.append(view.names[row])
            heights[line] = max(heights[line], tops[row])
    states = np.full(count, LOS)
    states[[*found]] = NLOSV
    states[crossed.scenery < 1.0] = NLOS
    return LineOfSightStates(states, heights, {line: tuple(names) for line, names in found.items()})


def _ends(places: dict[str, Place], pairs: Sequence[tuple[str, str]]) -> tuple[list[Place], list[Place]]:
    return [places[first] for first, _ in pairs], [places[second] for _, second in pairs]
