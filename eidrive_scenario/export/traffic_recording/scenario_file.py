"""OpenSCENARIO file that replays a recorded scene: timed trajectories, and stations with the recorded lidars."""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from lxml import etree

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.geometry import rigid_transform, rotation_matrix
from eidrive_scenario.export.geometry import angles
from eidrive_scenario.export.traffic_recording.scene import LidarStation, Track, TrafficScene
from eidrive_scenario.extensions.library import CATALOGS, LIBRARY_FOLDER, SCENARIO_SUFFIX, library_path
from eidrive_scenario.files.encodable import encodable, printable
from eidrive_scenario.files.yaml_text import flow_yaml

STEP = 0.05
"""Default time step of a run [s]: an actor that an action adds is present one step later."""
STANDSTILL = 1e-3
"""Maximum motion of a road user that stands during its whole track [m]."""
MAST_BASE = 0.5
"""Minimum height of the mast of a roadside unit [m]."""
SAME_SIZE = 0.01
"""Difference of sizes up to which a body is that of a catalog [m]. Only then it may be an emergency vehicle."""
_CATEGORY = {"Vehicle": "vehicleCategory", "Pedestrian": "pedestrianCategory"}
Size = tuple[float, float, float]


@cache
def _entries() -> tuple[tuple[etree._Element, Size], ...]:
    """Return the vehicles and pedestrians of the library with their sizes [m]."""
    bodies = []
    for name in ("vehicles", "pedestrians"):
        root = etree.parse(library_path() / CATALOGS / f"{name}{SCENARIO_SUFFIX}").getroot()
        for element in root.iter("Vehicle", "Pedestrian"):
            box = element.find("BoundingBox/Dimensions")
            assert box is not None
            length, width, height = (float(box.get(key, "0")) for key in ("length", "width", "height"))
            bodies.append((element, (length, width, height)))
    return tuple(bodies)


def body_of(category: str, size: Size) -> tuple[etree._Element, Size]:
    """Return the Vehicle or Pedestrian element of a category ("" for any) with this length, width and height [m].

    Axles and center of the nearest entry are scaled with the length. Return the center of the box relative to the
    reference point as well [m].
    """

    def difference(entry: tuple[etree._Element, Size]) -> float:
        return sum(abs(own - given) for own, given in zip(entry[1], size, strict=True))

    candidates = [entry for entry in _entries() if category in ("", entry[0].get(_CATEGORY[str(entry[0].tag)]))]
    candidates = [
        entry for entry in candidates or _entries() if not entry[0].get("role") or difference(entry) < SAME_SIZE
    ]
    entry, (length, *_) = min(candidates, key=difference)
    element = copy.deepcopy(entry)
    element.tail = None
    scale = size[0] / length
    center, dimensions = element.find("BoundingBox/Center"), element.find("BoundingBox/Dimensions")
    assert center is not None
    assert dimensions is not None
    middle = float(center.get("x", "0")) * scale, 0.0, size[2] / 2.0
    for key, value in zip(("x", "y", "z"), middle, strict=True):
        center.set(key, repr(value))
    for key, value in zip(("length", "width", "height"), size, strict=True):
        dimensions.set(key, repr(value))
    for axle in element.iter("FrontAxle", "RearAxle"):
        axle.set("positionX", repr(float(axle.get("positionX", "0")) * scale))
    return element, middle


@dataclass(frozen=True)
class _Actor:
    """Entity of the scenario: its element, the center of its box relative to its reference point, and the poses
    (N, 4, 4) of that point."""

    name: str
    element: etree._Element
    center: Size
    times: Array
    poses: Array

    @property
    def stands(self) -> bool:
        """Whether the actor stays where it is."""
        moved = np.abs(self.poses - self.poses[0]).max() if len(self.poses) > 1 else 0.0
        return bool(moved < STANDSTILL)


def scenario_text(scene: TrafficScene, lidar: dict[str, object]) -> bytes:
    """Return the XML of a scene.

    lidar  settings of the lidar of all stations, without its mount
    """
    root = etree.Element("OpenSCENARIO")
    description = f"recording {printable(encodable(scene.name))}: all road users follow their recorded trajectories"
    _add(
        root,
        "FileHeader",
        revMajor="1",
        revMinor="2",
        date="2026-01-01T00:00:00",
        author="eidrive",
        description=description,
    )
    locations = _add(root, "CatalogLocations")
    if scene.roadside:
        _add(_add(locations, "MiscObjectCatalog"), "Directory", path=f"{LIBRARY_FOLDER}/{CATALOGS}")
    _add(root, "RoadNetwork")
    entities = _add(root, "Entities")
    storyboard = _add(root, "Storyboard")
    start = _add(_add(storyboard, "Init"), "Actions")
    story = etree.Element("Story", name="Recording")
    act = _add(story, "Act", name="Replay")
    stations = {station.name: station for station in scene.mobile}
    for track in scene.tracks:
        actor = _actor(track)
        entity = _add(entities, "ScenarioObject", name=actor.name)
        entity.append(actor.element)
        station = stations.get(track.name)
        if station is not None:
            yaw, pitch, _ = angles(station.lidar[:3, :3])  # a mount has no roll: `roll_warnings`
            _add_stack(entity, track.name, _mount(station.lidar[:3, 3] + actor.center, yaw, pitch), lidar)
        _add_motion(start, act, actor, scene.end, is_station=station is not None)
    for unit in scene.roadside:
        _add_mast(entities, start, unit, lidar)
    if len(act):
        act.append(_trigger("StartTrigger", "Beginning", 0.0))
        storyboard.append(story)
    storyboard.append(_trigger("StopTrigger", "End", scene.end - STEP / 5.0))
    etree.indent(root, "  ")
    text: bytes = etree.tostring(root, xml_declaration=True, encoding="UTF-8")
    return text + b"\n"


def _add(parent: etree._Element, tag: str, **attributes: str) -> etree._Element:
    return etree.SubElement(parent, tag, attributes)


def _actor(track: Track) -> _Actor:
    element, center = body_of(track.category, track.size)
    poses = track.poses.copy()
    poses[:, :3, 3] -= track.poses[:, :3, :3] @ np.array(center)
    return _Actor(track.name, element, center, track.times, poses)


def _mount(position: Sequence[float] | Array, yaw: float, pitch: float) -> dict[str, float]:
    """Return the mount of a lidar in the frame of the reference point of its station [m, degrees]."""
    x, y, z = position
    values = {"x": x, "y": y, "z": z, "yaw": math.degrees(yaw), "pitch": math.degrees(pitch)}
    return {name: round(float(value), 6) + 0.0 for name, value in values.items()}


def _add_stack(entity: etree._Element, name: str, mount: dict[str, float], lidar: dict[str, object]) -> None:
    """Add the controller of a station that detects by its lidar, sends and receives."""
    controller = _add(_add(entity, "ObjectController"), "Controller", name=f"{name}Stack")
    properties = _add(controller, "Properties")
    sensors = {"lidar": {**lidar, "mount": mount}, "truth": {"range": 120.0, "rate": 10.0}}
    values = {
        "module": "eidrive",
        "planner": "none",
        "detector": "lidar",
        "cooperates_with": "all",
        "sensors": flow_yaml(sensors, setting="sensors"),
    }
    for key, value in values.items():
        _add(properties, "Property", name=key, value=value)


def _add_motion(start: etree._Element, act: etree._Element, actor: _Actor, end: float, *, is_station: bool) -> None:
    """Add the actions that let an actor enter, follow its trajectory, and leave."""
    first, last = float(actor.times[0]), float(actor.times[-1])
    enters, leaves = first > STEP / 2.0, last < end - STEP / 2.0
    trajectory = None if actor.stands else _follow(actor)
    private = etree.Element("Private", entityRef=actor.name)
    if not enters:
        _add_teleport(private, actor.poses[0])
    if is_station:  # scripted, while its stack perceives and communicates
        action = _add(_add(private, "PrivateAction"), "ControllerAction")
        _add(action, "ActivateControllerAction", lateral="false", longitudinal="false")
    if not enters and trajectory is not None:
        private.append(trajectory)
    if len(private):
        start.append(private)
    if not enters and not leaves:
        return
    group = _add(act, "ManeuverGroup", name=actor.name, maximumExecutionCount="1")
    _add(_add(group, "Actors", selectTriggeringEntities="false"), "EntityRef", entityRef=actor.name)
    maneuver = _add(group, "Maneuver", name=actor.name)
    if enters:
        event = _add(maneuver, "Event", name=f"{actor.name}Enters", priority="parallel")
        position = _add(_entity_action(event, actor.name, "Add"), "AddEntityAction")
        _position(_add(position, "Position"), actor.poses[0])
        if trajectory is not None:
            _add(event, "Action", name=f"{actor.name}Moves").append(trajectory)
        event.append(_trigger("StartTrigger", f"{actor.name}IsDue", first - 1.2 * STEP))
    if leaves:
        event = _add(maneuver, "Event", name=f"{actor.name}Leaves", priority="parallel")
        _add(_entity_action(event, actor.name, "Delete"), "DeleteEntityAction")
        event.append(_trigger("StartTrigger", f"{actor.name}IsOver", last - 0.2 * STEP))


def _entity_action(event: etree._Element, name: str, verb: str) -> etree._Element:
    action = _add(event, "Action", name=f"{verb}{name}")
    return _add(_add(action, "GlobalAction"), "EntityAction", entityRef=name)


def _follow(actor: _Actor) -> etree._Element:
    private = etree.Element("PrivateAction")
    follow = _add(_add(private, "RoutingAction"), "FollowTrajectoryAction")
    reference = _add(follow, "TrajectoryRef")
    trajectory = _add(reference, "Trajectory", name=f"{actor.name}Way", closed="false")
    line = _add(_add(trajectory, "Shape"), "Polyline")
    for time, pose in zip(actor.times.tolist(), actor.poses, strict=True):
        _position(_add(_add(line, "Vertex", time=f"{time:.6f}"), "Position"), pose)
    timing = _add(follow, "TimeReference")
    _add(timing, "Timing", domainAbsoluteRelative="absolute", offset="0", scale="1")
    _add(follow, "TrajectoryFollowingMode", followingMode="position")
    return private


def _add_teleport(private: etree._Element, pose: Array) -> None:
    _position(_add(_add(_add(private, "PrivateAction"), "TeleportAction"), "Position"), pose)


def _position(parent: etree._Element, pose: Array) -> None:
    yaw, pitch, roll = angles(pose[:3, :3])
    values = dict(zip("xyzhpr", (*pose[:3, 3].tolist(), yaw, pitch, roll), strict=True))
    _add(parent, "WorldPosition", **{key: f"{round(value, 9) + 0.0:.9f}" for key, value in values.items()})


def _add_mast(entities: etree._Element, start: etree._Element, unit: LidarStation, lidar: dict[str, object]) -> None:
    """Add the mast of a roadside unit, with its lidar on the top. The mast has the yaw and the roll of the lidar."""
    _, pitch, _ = angles(unit.lidar[:3, :3])
    height = float(unit.lidar[2, 3])
    mount = rigid_transform(rotation_matrix(0.0, pitch), (0.0, 0.0, height))
    entity = _add(entities, "ScenarioObject", name=unit.name)
    reference = _add(entity, "CatalogReference", catalogName="misc_objects", entryName="rsu")
    mast = max(height, MAST_BASE)
    assignments = _add(reference, "ParameterAssignments")
    _add(assignments, "ParameterAssignment", parameterRef="Height", value=repr(mast))
    _add_stack(entity, unit.name, _mount((0.0, 0.0, height), 0.0, pitch), lidar)
    _add_teleport(_add(start, "Private", entityRef=unit.name), unit.lidar @ np.linalg.inv(mount))


def _trigger(tag: str, name: str, time: float) -> etree._Element:
    trigger = etree.Element(tag)
    condition = _add(_add(trigger, "ConditionGroup"), "Condition", name=name, delay="0", conditionEdge="none")
    value = f"{max(time, 0.0):.6f}"
    _add(_add(condition, "ByValueCondition"), "SimulationTimeCondition", rule="greaterOrEqual", value=value)
    return trigger
