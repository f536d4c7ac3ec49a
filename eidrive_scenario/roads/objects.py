"""Road objects in world coordinates: poses, dimensions and outlines."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.tolerances import EPSILON
from eidrive_scenario.roads.model.location import Pose
from eidrive_scenario.roads.model.road_map import Corner, Repeat, RoadObject
from eidrive_scenario.roads.network import RoadNetwork

LONGEST_PART = 5.0
"""Maximum length of a part of an object that repeats without gaps, such as a barrier [m]."""


class PlacedObject(NamedTuple):
    """One object in the world: pose of its base; length, width and height [m], 0 if the map omits them.

    z_offset  height of its base above the road [m]
    shift     distance along s and t by which a repetition moves the outlines of the object [m]; None for a part of an
              object that repeats without gaps: it has the cross section of its width and height
    """

    object: RoadObject
    pose: Pose
    length: float
    width: float
    height: float
    z_offset: float
    shift: tuple[float, float] | None = (0.0, 0.0)


def placed_objects(network: RoadNetwork) -> Iterator[PlacedObject]:
    """Yield all objects, with one item for each repetition."""
    for road_object in network.objects:
        if road_object.repeats:
            yield from _repeated(network, road_object)
        else:
            width = 2.0 * road_object.radius or road_object.width
            length = 2.0 * road_object.radius or road_object.length
            pose = _pose(network, road_object, road_object.s, road_object.t, road_object.z_offset)
            yield PlacedObject(road_object, pose, length, width, road_object.height, road_object.z_offset)


def crosswalks(network: RoadNetwork) -> tuple[Array, ...]:
    """Return the outlines of all crosswalks as polygons (M, 3)."""
    return tuple(
        outline
        for placed in placed_objects(network)
        if placed.object.type == "crosswalk"
        for outline in outlines(network, placed)
    )


def outlines(network: RoadNetwork, placed: PlacedObject) -> list[Array]:
    """Return the outlines of an object on the ground as polygons (M, 3), by default from its length and width."""
    if placed.object.outlines and placed.shift is not None:
        return [_corners(network, placed, outline) for outline in placed.object.outlines]
    if placed.length <= 0.0 or placed.width <= 0.0:
        return []
    x, y = 0.5 * placed.length, 0.5 * placed.width
    rectangle = tuple(Corner(False, a * x, b * y, 0.0, 0.0) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1)))
    return [_corners(network, placed, rectangle)]


def lines(network: RoadNetwork, placed: PlacedObject) -> list[Array]:
    """Return the linear features of an object on the ground as lines (M, 3)."""
    return [] if placed.shift is None else [_corners(network, placed, line) for line in placed.object.lines]


def _corners(network: RoadNetwork, placed: PlacedObject, outline: tuple[Corner, ...]) -> Array:
    pose, road, (ds, dt) = placed.pose, placed.object.road, placed.shift or (0.0, 0.0)
    cos, sin = math.cos(pose.h), math.sin(pose.h)
    pitch, roll = placed.object.pitch, placed.object.roll
    cp, sp, cr, sr = math.cos(pitch), math.sin(pitch), math.cos(roll), math.sin(roll)
    points = []
    for corner in outline:
        if corner.on_road:
            s = min(max(corner.x + ds, 0.0), network.roads[road].length)
            corner_pose = network.road_pose_at(road, s, corner.y + dt)
            x, y, z, *_ = corner_pose
            points.append((x, y, z + corner.z))
            continue
        left, up = cr * corner.y - sr * corner.z, sr * corner.y + cr * corner.z
        ahead, up = cp * corner.x + sp * up, cp * up - sp * corner.x
        points.append((pose.x + cos * ahead - sin * left, pose.y + sin * ahead + cos * left, pose.z + up))
    return np.array(points)


def _pose(network: RoadNetwork, road_object: RoadObject, s: float, t: float, z_offset: float) -> Pose:
    length = network.roads[road_object.road].length
    pose = network.road_pose_at(road_object.road, min(max(s, 0.0), length), t)
    return pose._replace(z=pose.z + z_offset).turned(road_object.heading)


def _repeated(network: RoadNetwork, road_object: RoadObject) -> Iterator[PlacedObject]:
    for repeat in road_object.repeats:
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
            ends = repeat.width, repeat.height, repeat.size, repeat.radius
            sizes = [a + (b - a) * share for a, b in ends]
            if any(size <= 0.0 < max(pair) for size, pair in zip(sizes, ends, strict=True)):
                continue  # It tapers to nothing there.
            width, height, length, radius = sizes
            length, width = 2.0 * radius or length or road_object.length, 2.0 * radius or width or road_object.width
            pose = _pose_in_repetition(network, road_object, repeat, ds)
            shift = repeat.s + ds - road_object.s, repeat.t[0] + (repeat.t[1] - repeat.t[0]) * share - road_object.t
            if gapless:
                # Parts meet at their ends also on bends, and where t changes.
                start, end = (_pose_in_repetition(network, road_object, repeat, x * part) for x in (i, i + 1))
                dx, dy = end.x - start.x, end.y - start.y
                length = math.hypot(dx, dy)
                pose = pose._replace(x=start.x + 0.5 * dx, y=start.y + 0.5 * dy, h=math.atan2(dy, dx))
            height = height or road_object.height
            z_offset = repeat.z_offset[0] + (repeat.z_offset[1] - repeat.z_offset[0]) * share
            yield PlacedObject(road_object, pose, length, width, height, z_offset, None if gapless else shift)


def _pose_in_repetition(network: RoadNetwork, road_object: RoadObject, repeat: Repeat, ds: float) -> Pose:
    """Return the pose of a repeated object `ds` after the start of the repetition [m]."""

    def pose_at(ds: float) -> Pose:
        share = ds / repeat.length if repeat.length > 0.0 else 0.0
        t, z = (a + (b - a) * share for a, b in (repeat.t, repeat.z_offset))
        return _pose(network, road_object, repeat.s + ds, t, z)

    pose = pose_at(ds)
    if not repeat.detached or repeat.length <= 0.0:
        return pose
    ends, share = (pose_at(0.0), pose_at(repeat.length)), ds / repeat.length
    x, y, z = (a + (b - a) * share for a, b in zip(*(end[:3] for end in ends), strict=True))
    return pose._replace(x=x, y=y, z=z)
