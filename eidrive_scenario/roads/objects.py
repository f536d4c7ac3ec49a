"""Road objects in world coordinates: poses, dimensions and outlines."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.tolerances import EPSILON
from eidrive_scenario.roads.model.location import Pose
from eidrive_scenario.roads.model.road_map import Corner, RoadObject
from eidrive_scenario.roads.network import RoadNetwork

LONGEST_PART = 5.0
"""Maximum length of a part of an object that repeats without gaps, such as a barrier [m]."""


class PlacedObject(NamedTuple):
    """One object in the world: pose of its base; length, width and height [m], 0 if the map omits them."""

    object: RoadObject
    pose: Pose
    length: float
    width: float
    height: float


def placed_objects(network: RoadNetwork) -> Iterator[PlacedObject]:
    """Yield all objects, with one item for each repetition."""
    for item in network.objects:
        if item.repeats:
            yield from _repeated(network, item)
        else:
            width = 2.0 * item.radius if item.radius else item.width
            length = 2.0 * item.radius if item.radius else item.length
            yield PlacedObject(item, _pose(network, item, item.s, item.t, item.z_offset), length, width, item.height)


def crosswalks(network: RoadNetwork) -> tuple[Array, ...]:
    """Return the outlines of all crosswalks as polygons (M, 3)."""
    return tuple(outline for item in network.objects if item.type == "crosswalk" for outline in outlines(network, item))


def outlines(network: RoadNetwork, item: RoadObject) -> list[Array]:
    """Return the outlines of an object on the ground as polygons (M, 3), by default from its length and width."""
    if item.outlines:
        return [_corners(network, item, outline) for outline in item.outlines if len(outline) >= 3]
    if item.length <= 0.0 or item.width <= 0.0:
        return []
    half_length, half_width = 0.5 * item.length, 0.5 * item.width
    rectangle = ((-1, -1), (1, -1), (1, 1), (-1, 1))
    return [
        _corners(network, item, tuple(Corner(False, half_length * a, half_width * b, 0.0, 0.0) for a, b in rectangle))
    ]


def _corners(network: RoadNetwork, item: RoadObject, outline: tuple[Corner, ...]) -> Array:
    pose = _pose(network, item, item.s, item.t, item.z_offset)
    cos, sin = math.cos(pose.h), math.sin(pose.h)
    rows = []
    for corner in outline:
        if corner.on_road:
            s = min(max(corner.x, 0.0), network.roads[item.road].length)
            corner_pose = network.road_pose_at(item.road, s, corner.y)
            rows.append((corner_pose.x, corner_pose.y, corner_pose.z + corner.z))
        else:
            rows.append(
                (
                    pose.x + cos * corner.x - sin * corner.y,
                    pose.y + sin * corner.x + cos * corner.y,
                    pose.z + corner.z,
                )
            )
    return np.array(rows)


def _pose(network: RoadNetwork, item: RoadObject, s: float, t: float, z_offset: float) -> Pose:
    length = network.roads[item.road].length
    pose = network.road_pose_at(item.road, min(max(s, 0.0), length), t)
    turn = item.heading + (math.pi if item.orientation == "-" else 0.0)
    return pose._replace(z=pose.z + z_offset).turned(turn)


def _repeated(network: RoadNetwork, item: RoadObject) -> Iterator[PlacedObject]:
    for repeat in item.repeats:
        gapless = repeat.distance <= 0.0
        step = min(LONGEST_PART, repeat.length) if gapless else repeat.distance
        if step <= 0.0:
            continue
        ratio = repeat.length / step
        count = max(math.ceil(ratio), 1) if gapless else math.floor(ratio + EPSILON) + 1
        part = repeat.length / count if gapless else step
        for i in range(count):
            ds = (i + 0.5) * part if gapless else i * part
            share = ds / repeat.length if repeat.length > 0.0 else 0.0
            ends = repeat.t, repeat.width, repeat.height, repeat.z_offset, repeat.size, repeat.radius
            t, width, height, z, length, radius = (a + (b - a) * share for a, b in ends)
            length, width = (2.0 * radius, 2.0 * radius) if radius else (length or item.length, width or item.width)
            pose = _pose(network, item, repeat.s + ds, t, z)
            yield PlacedObject(item, pose, part if gapless else length, width, height or item.height)
