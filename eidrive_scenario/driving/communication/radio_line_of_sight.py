"""Line of sight between antennas: positions of antennas, and blocking bodies between them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import partial
from types import MappingProxyType

import numpy as np

from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.v2x.radio_environment import LOS, NLOS, NLOSV, LineOfSightStates, RadioEnvironment
from eidrive_scenario.world import World
from eidrive_scenario.world.actor import ActorSpec
from eidrive_scenario.world.view import NOTHING, WorldView

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


def radio_environment(
    world: World, view: WorldView, stations: Sequence[tuple[ActorSpec, float | None]], roads: RoadNetwork | None
) -> RadioEnvironment:
    """Return the antennas of stations, each with the height of its antenna or None, and their lines of sight."""
    antennas = {spec.name: antenna_position(view, spec, height) for spec, height in stations}
    grounds = {}
    if roads is not None and not roads.is_level:
        grounds = {spec.name: ground_height(view, spec, roads) for spec, _ in stations}
    return RadioEnvironment(antennas, partial(line_of_sight_states, world, antennas, grounds=grounds), grounds)


def ground_height(view: WorldView, spec: ActorSpec, roads: RoadNetwork | None) -> float:
    """Return the height of the ground below a station in the world frame [m].

    A vehicle stands on the ground. Other stations may be mounted above it: the ground is the road, if one is near.
    """
    x, y, z, *_ = view.states[view.rows[spec.name]]
    if roads is None or spec.has_wheels:
        return z
    ground = roads.locate_at(x, y, z=z)
    return z if ground is None else roads.road_pose_at(ground.road, ground.s, ground.t).z


def line_of_sight_states(
    world: World,
    places: dict[str, Place],
    pairs: Sequence[tuple[str, str]],
    grounds: Mapping[str, float] = MappingProxyType({}),
) -> LineOfSightStates:
    """Return the line-of-sight state of these pairs of antennas; the bodies of the pair do not block.

    An actor in between gives NLOSv, a building or the ground NLOS. Actors behind that are not counted. Heights of
    blocking actors are above the line between the grounds below the two antennas.
    """
    count = len(pairs)
    view = world.view()
    if count <= _FEW:
        met = world.first_hit([places[first] for first, _ in pairs], [places[second] for _, second in pairs])
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
    lines, rows = lines[blocks], rows[blocks]
    tops = view.centers[rows, 2] + view.size[rows, 2] / 2.0
    if grounds:
        below = np.array([grounds.get(name, 0.0) for name in places])
        begin, end = points[first[lines]], points[second[lines]]
        # Share of the line in plan view at the place nearest to the body.
        step, offset = end[:, :2] - begin[:, :2], view.centers[rows, :2] - begin[:, :2]
        length = np.maximum(np.einsum("ni,ni->n", step, step), 1e-9)
        share = np.clip(np.einsum("ni,ni->n", offset, step) / length, 0.0, 1.0)
        tops -= below[first[lines]] * (1.0 - share) + below[second[lines]] * share
    blocking: dict[int, list[str]] = {}
    for line, row, top in zip(lines.tolist(), rows.tolist(), tops.tolist(), strict=True):
        names = blocking.setdefault(line, [])
        if len(names) < _MOST_BODIES:
            names.append(view.names[row])
            heights[line] = max(heights[line], top)
    states = np.full(count, LOS)
    states[[*blocking]] = NLOSV
    states[crossed.scenery < 1.0] = NLOS
    return LineOfSightStates(states, heights, {line: tuple(names) for line, names in blocking.items()})
