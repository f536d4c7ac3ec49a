"""Bodies of road objects and signals: buildings, poles, trees, barriers, posts.

Objects that are painted on the road or have no height are excluded.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from eidrive_scenario.roads import LaneLocation, PlacedObject, Pose, RoadNetwork, Signal, outlines, placed_objects
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

_KINDS: Mapping[str, str] = {
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
_WITHOUT_TYPE = ("none", "-1", "")
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
        if placed.object.type == "building" and placed.object.id not in without:
            yield _building(roads, placed)


def _building(roads: RoadNetwork, placed: PlacedObject) -> Building:
    """Return the box around an object of the road network."""
    entry, pose = placed.object, placed.pose
    length, width, height = placed.length or 1.0, placed.width or 1.0, placed.height or STOREY
    if entry.outlines and not entry.repeats:
        pose, length, width = bounding_box(roads, placed)
        height = max([height, *(corner.height for outline in entry.outlines for corner in outline)])
    center = (pose.x, pose.y, pose.z + height / 2)
    return Building(entry.name or f"building {entry.id}", center, (length, width, height), pose.h)


def road_object_bodies(roads: RoadNetwork, without: Collection[str] = ()) -> Iterator[RoadObjectBody]:
    """Yield the bodies of all objects and signal posts of a road network, except objects with some ids."""
    for placed in placed_objects(roads):
        found = _object_body(roads, placed) if placed.object.id not in without else None
        if found is not None:
            yield found
    for head in signal_heads(roads):
        if head.carried:
            foot = roads.road_pose_at(head.signal.place.road, head.signal.place.s, head.signal.place.t)
            top = head.pose.z + head.height - foot.z
            name = f"signal {head.signal.id}"
            yield RoadObjectBody(name, "post", foot._replace(h=head.pose.h, p=0.0, r=0.0), 0.0, 0.0, top, POST)


def signal_heads(roads: RoadNetwork) -> list[SignalHead]:
    """Return the heads of standing and hanging signals in the order of the map, without painted ones."""
    standing = [signal for signal in roads.signals.values() if not _painted(signal)]
    if not standing:
        return []
    poses = [roads.signal_pose(signal) for signal in standing]
    below = roads.locate([pose.x for pose in poses], [pose.y for pose in poses], [pose.z for pose in poses])
    heads = []
    for row, (signal, pose) in enumerate(zip(standing, poses, strict=True)):
        here = below.location(row)
        over_traffic = here is not None and below.outside[row] <= 0.0 and _drivable(roads, here)
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


def _painted(signal: Signal) -> bool:
    return not signal.dynamic and signal.height < 0.3 and signal.z_offset < 1.0


def _drivable(roads: RoadNetwork, here: LaneLocation) -> bool:
    found = roads.roads[here.road].section_at(here.s).lanes.get(here.lane)
    return found is not None and found.drivable


def _object_body(roads: RoadNetwork, placed: PlacedObject) -> RoadObjectBody | None:
    entry = placed.object
    kind = _KINDS.get(entry.type)
    if kind is None and entry.type in _WITHOUT_TYPE and min(placed.length, placed.width, placed.height) >= STEP:
        kind = "obstacle"
    if kind is None:
        return None
    pose, length, width = placed.pose, placed.length, placed.width
    height = max([placed.height, *(corner.height for outline in entry.outlines for corner in outline)])
    if entry.outlines and not entry.repeats:
        pose, length, width = bounding_box(roads, placed)
    usual = SIZES[kind]
    length, width, height = length or usual[0], width or usual[1], height or usual[2]
    if height < LEAST:
        return None
    name = entry.name or f"{kind} {entry.id}"
    if kind == "tree":
        return RoadObjectBody(name, kind, pose, length, width, height, TRUNK * height)
    if kind == "vegetation":
        return RoadObjectBody(name, kind, pose, length, width, height, solid=False)
    if kind in ("pole", "lamp", "guide post") or entry.radius:
        return RoadObjectBody(name, kind, pose, length, width, height, max(length, width) / 2)
    return RoadObjectBody(name, kind, pose, length, width, height, solid=height >= STEP or pose.z > 0.0)


def bounding_box(roads: RoadNetwork, placed: PlacedObject) -> tuple[Pose, float, float]:
    """Return the box around the outlines of an object: pose of the center of its base, length and width [m]."""
    pose = placed.pose
    cos, sin = math.cos(pose.h), math.sin(pose.h)
    offset = np.concatenate(outlines(roads, placed.object))[:, :2] - (pose.x, pose.y)
    corners = np.stack([cos * offset[:, 0] + sin * offset[:, 1], cos * offset[:, 1] - sin * offset[:, 0]], axis=1)
    low, high = corners.min(axis=0), corners.max(axis=0)
    ahead, aside = ((low + high) / 2).tolist()
    length, width = (high - low).tolist()
    middle = pose._replace(x=pose.x + cos * ahead - sin * aside, y=pose.y + sin * ahead + cos * aside)
    return middle, length, width
