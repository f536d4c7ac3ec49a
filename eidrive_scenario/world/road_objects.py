"""Bodies of road objects and signals: buildings, poles, trees, barriers, posts.

Objects that are painted on the road or have no height are excluded.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.roads import PlacedObject, Pose, RoadNetwork, Signal, lines, outlines, placed_objects
from eidrive_scenario.roads.model.road_map import Corner
from eidrive_scenario.world.actor import Vector3

SIZES: Mapping[str, tuple[float, float, float]] = {
    "tree": (4.0, 4.0, 7.0),
    "vegetation": (1.5, 1.5, 1.2),
    "pole": (0.12, 0.12, 4.0),
    "lamp": (0.16, 0.16, 8.0),
    "guide post": (0.12, 0.12, 1.0),
    "barrier": (2.0, 0.3, 0.9),
    "railing": (2.0, 0.3, 0.3),
    "obstacle": (0.5, 0.5, 0.8),
    "gantry": (0.5, 8.0, 6.0),
    "island": (2.0, 1.0, 0.15),
}
"""Default length, width and height by kind, for maps that omit them [m]."""

KINDS: Mapping[str, str] = {
    "tree": "tree",
    "vegetation": "vegetation",
    "pole": "pole",
    "rail-pole": "guide post",
    "guide-post": "guide post",
    "streetLamp": "lamp",
    "lamppost": "lamp",
    "barrier": "barrier",
    "soundBarrier": "barrier",
    "wall": "barrier",
    "fence": "railing",
    "railing": "railing",
    "obstacle": "obstacle",
    "gantry": "gantry",
    "trafficIsland": "island",
}
"""Kinds by type of OpenDRIVE objects."""
WITHOUT_TYPE = ("none", "-1", "")
STOREY = 3.2
"""Height of a storey [m]: the default height of a building, and the distance of its rows of windows."""
LEAST = 0.1
"""Minimum height of an object; lower ones are paint [m]."""
STEP = 0.2
"""Maximum height of an object that vehicles roll over [m]."""
TRUNK = 0.05
"""Radius of a trunk as a share of the height of the tree."""
POST = 0.05
"""Radius of the post of a signal [m]."""
WALL = 0.3
"""Thickness of the walls of an object with an outline that is far from its box [m]."""
FILLED = 0.8
"""Minimum share of its box that an outline covers to be modeled as that box."""
CONVEX = 4
"""Maximum number of corners of outlines that are always modeled as boxes."""
HEADROOM = 4.5
"""Least height of an object without a type that is a tree if it reaches over a lane [m]: the clearance of roads."""
GRID = np.array([(ahead, aside) for ahead in (-1.0, 0.0, 1.0) for aside in (-1.0, 0.0, 1.0)])
CENTER = 4
"""Points of a box as shares of its half length and half width, and the number of its center."""
CLEARANCE = 2.1
"""Default height of the lower edge of a signal that the map has on the ground [m]."""


class RoadObjectBody(NamedTuple):
    """Body of an object: kind (a key of SIZES, or `post` of a signal), pose of its base, length, width and height [m].

    radius  of a round body; 0 for a box
    solid   whether it blocks vehicles and rays; crowns of trees and bushes block rays only
    """

    name: str
    kind: str
    pose: Pose
    length: float
    width: float
    height: float
    radius: float = 0.0
    solid: bool = True


@dataclass(frozen=True)
class Building:
    """Box on the ground: center [m], length, width, height [m], heading [rad]."""

    name: str
    center: Vector3
    size: Vector3
    yaw: float
    color: Vector3 | None = None

    @property
    def box(self) -> tuple[float, float, float, float, float, float, float]:
        """Box: center of the bottom x, y, z, length, width, height [m], heading [rad]."""
        x, y, z = self.center
        return x, y, z - self.size[2] / 2.0, *self.size, self.yaw


class SignalHead(NamedTuple):
    """Head of a signal: pose of the center of its lower edge, facing the traffic.

    carried  whether a post below carries it
    """

    signal: Signal
    pose: Pose
    width: float
    height: float
    carried: bool


def buildings(roads: RoadNetwork, without: Collection[str] = ()) -> Iterator[Building]:
    """Yield the buildings of a road network as boxes, except objects with some ids."""
    for placed in placed_objects(roads):
        road_object = placed.object
        if road_object.type != "building" or road_object.id in without:
            continue
        height = object_height(placed) or STOREY
        for pose, length, width in footprint(roads, placed):
            center = (pose.x, pose.y, pose.z + height / 2)
            yield Building(
                road_object.name or f"building {road_object.id}", center, (length or 1.0, width or 1.0, height), pose.h
            )


def road_object_bodies(roads: RoadNetwork, without: Collection[str] = ()) -> Iterator[RoadObjectBody]:
    """Yield the bodies of all objects and signal posts of a road network, except objects with some ids."""
    for placed in placed_objects(roads):
        if placed.object.id not in without:
            yield from object_bodies(roads, placed)
    for head in signal_heads(roads):
        if head.carried:
            foot = roads.road_pose_at(head.signal.place.road, head.signal.place.s, head.signal.place.t)
            top = head.pose.z + head.height - foot.z
            name = f"signal {head.signal.id}"
            yield RoadObjectBody(name, "post", foot._replace(h=head.pose.h, p=0.0, r=0.0), 0.0, 0.0, top, POST)


def solid_boxes(roads: RoadNetwork, least_height: float) -> Array:
    """Return boxes (N, 7) around the buildings and solid objects of a map that are higher than `least_height` [m]."""
    boxes = [(*house.center, *house.size, house.yaw) for house in buildings(roads)]
    for body in road_object_bodies(roads):
        if body.solid and body.height > least_height:
            length, width = (2.0 * body.radius,) * 2 if body.radius else (body.length, body.width)
            x, y, z, yaw, *_ = body.pose
            boxes.append((x, y, z + body.height / 2.0, length, width, body.height, yaw))
    return np.array(boxes, dtype=float).reshape(-1, 7)


def signal_heads(roads: RoadNetwork) -> list[SignalHead]:
    """Return the heads of standing and hanging signals in the order of the map, without painted ones."""
    # Low static signals at the height of the road are painted on it.
    standing = [
        signal for signal in roads.signals.values() if signal.dynamic or signal.height >= 0.3 or signal.z_offset >= 1.0
    ]
    if not standing:
        return []
    poses = [roads.signal_pose(signal) for signal in standing]
    below = roads.locate([pose.x for pose in poses], [pose.y for pose in poses], [pose.z for pose in poses])
    heads = []
    for row, (signal, pose) in enumerate(zip(standing, poses, strict=True)):
        here = below.location(row)
        lane = None if here is None else roads.roads[here.road].section_at(here.s).lanes.get(here.lane)
        over_traffic = lane is not None and lane.drivable and below.outside[row] <= 0.0
        heads.append(_head(signal, pose, carried=not over_traffic))
    return heads


def _head(signal: Signal, pose: Pose, carried: bool) -> SignalHead:
    """Return the head with default size if the map omits it or gives that of the whole assembly."""
    lamps = signal.dynamic
    width, height = (0.34, 0.94) if lamps else (0.61, 0.61)
    if 0.1 <= signal.width <= (0.5 if lamps else 1.2):
        width = signal.width
    low, top = pose.z, pose.z + signal.height
    if signal.z_offset >= 1.0:
        height = signal.height if 0.25 <= signal.height <= 1.5 else height
    elif signal.height >= 2.0:
        low = top - height
    else:
        low = pose.z - signal.z_offset + CLEARANCE
        height = signal.height if 0.3 <= signal.height <= 1.3 else height
    ahead = POST + 0.03 + (0.5 * width if lamps else 0.0)
    x, y = pose.x + ahead * math.cos(pose.h), pose.y + ahead * math.sin(pose.h)
    return SignalHead(signal, pose._replace(x=x, y=y, z=low), width, height, carried)


def object_bodies(roads: RoadNetwork, placed: PlacedObject) -> Iterator[RoadObjectBody]:
    """Yield the bodies of an object; none if it is painted on the road, or a building."""
    road_object = placed.object
    kind, height = KINDS.get(road_object.type), object_height(placed)
    if kind is None and (road_object.type not in WITHOUT_TYPE or height < STEP):
        return
    boxes = footprint(roads, placed)
    if kind is None and all(min(length, width) < STEP for _, length, width in boxes):
        return
    kind = kind or "obstacle"
    usual = SIZES[kind]
    height = height or usual[2]
    if height < LEAST:
        return
    name = road_object.name or f"{kind} {road_object.id}"
    for pose, given_length, given_width in boxes:
        length, width = given_length or usual[0], given_width or usual[1]
        is_crown = road_object.type in WITHOUT_TYPE and height > HEADROOM and _overhangs(roads, pose, length, width)
        if kind == "tree" or is_crown:
            yield RoadObjectBody(name, "tree", pose, length, width, height, TRUNK * height)
        elif kind == "vegetation":
            yield RoadObjectBody(name, kind, pose, length, width, height, solid=False)
        elif placed.shift is not None and (kind in ("pole", "lamp", "guide post") or road_object.radius):
            yield RoadObjectBody(name, kind, pose, length, width, height, max(length, width) / 2)
        else:
            is_solid = height >= STEP or _height_above_road(placed) > 0.0
            yield RoadObjectBody(name, kind, pose, length, width, height, solid=is_solid)


def _overhangs(roads: RoadNetwork, pose: Pose, length: float, width: float) -> bool:
    """Return whether a box stands beside the lanes for vehicles and reaches over one, as crowns of trees do."""
    cos, sin = math.cos(pose.h), math.sin(pose.h)
    ahead, aside = 0.5 * length * GRID[:, 0], 0.5 * width * GRID[:, 1]
    x, y = pose.x + cos * ahead - sin * aside, pose.y + sin * ahead + cos * aside
    lanes, _, points = roads.overlapped_lanes(x, y, np.full(len(x), pose.z))
    over = points[roads.tables.lane_drivable[lanes]]
    return over.size > 0 and not (over == CENTER).any()


def object_height(placed: PlacedObject) -> float:
    """Return the maximum height at the corners of an object, which outlines define, or else its height [m]; 0 if the
    map omits them."""
    return max((corner.height for corner in _corners(placed)), default=0.0) or placed.height


def _height_above_road(placed: PlacedObject) -> float:
    """Return the height of the lowest corner of an object above the road, or of its base without corners [m]."""
    heights = (corner.z + (0.0 if corner.on_road else placed.z_offset) for corner in _corners(placed))
    return min(heights, default=placed.z_offset)


def _corners(placed: PlacedObject) -> list[Corner]:
    outlines_and_lines = () if placed.shift is None else (*placed.object.outlines, *placed.object.lines)
    return [corner for corners in outlines_and_lines for corner in corners]


def footprint(roads: RoadNetwork, placed: PlacedObject) -> list[tuple[Pose, float, float]]:
    """Return the boxes on the ground of an object: pose of the center of the base, length and width [m].

    It is the box around its outlines, or a wall along each edge of an outline that covers too little of that box, and a
    wall along each part of a linear feature.
    """
    if placed.shift is None or not (placed.object.outlines or placed.object.lines):
        return [(placed.pose, placed.length, placed.width)]
    walls = [wall for line in lines(roads, placed) for wall in _walls(line)]
    if not placed.object.outlines:
        return walls
    box = bounding_box(roads, placed)
    polygons = outlines(roads, placed)
    if len(polygons) == 1 and len(polygons[0]) > CONVEX and _area(polygons[0]) < FILLED * box[1] * box[2]:
        return [*walls, *_walls(np.concatenate([polygons[0], polygons[0][:1]]))]
    return [*walls, box]


def _area(polygon: Array) -> float:
    x, y = polygon[:, 0], polygon[:, 1]
    return float(abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2.0)


def _walls(line: Array) -> list[tuple[Pose, float, float]]:
    """Return a wall along each part of a line, without parts of length 0: an outline may repeat its first corner."""
    return [wall for wall in map(_wall, line[:-1], line[1:]) if wall[1] > 0.0]


def _wall(start: Array, end: Array) -> tuple[Pose, float, float]:
    (x, y, z), (dx, dy, dz) = ((start + end) / 2.0).tolist(), (end - start).tolist()
    return Pose(x, y, z - abs(dz) / 2.0, math.atan2(dy, dx), 0.0, 0.0), math.hypot(dx, dy), WALL


def bounding_box(roads: RoadNetwork, placed: PlacedObject) -> tuple[Pose, float, float]:
    """Return the box around the outlines of an object: pose of the center of its base, length and width [m]."""
    pose = placed.pose
    cos, sin = math.cos(pose.h), math.sin(pose.h)
    points = np.concatenate(outlines(roads, placed))
    offset = points[:, :2] - (pose.x, pose.y)
    corners = np.stack([cos * offset[:, 0] + sin * offset[:, 1], cos * offset[:, 1] - sin * offset[:, 0]], axis=1)
    low, high = corners.min(axis=0), corners.max(axis=0)
    ahead, aside = ((low + high) / 2).tolist()
    length, width = (high - low).tolist()
    x, y, z = pose.x + cos * ahead - sin * aside, pose.y + sin * ahead + cos * aside, float(points[:, 2].min())
    return pose._replace(x=x, y=y, z=z), length, width
