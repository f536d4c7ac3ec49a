"""Scene entities: boxes of actors and perceived objects, lanes of the map, paths of planners, and messages."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.detections import Detections
from eidrive_scenario.base.geometry import rotation_matrix
from eidrive_scenario.driving.step import Plan
from eidrive_scenario.export.foxglove.schemas import UPRIGHT, WORLD, Color, Foxglove, rgba, rotation, stamp, vector
from eidrive_scenario.export.geometry import Line, edge_line, lane_edges, point_spacing
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.reporting.snapshot import LINK_LIFETIME
from eidrive_scenario.roads import RoadNetwork

_COLORS: Mapping[str, Color] = {
    "car": (0.25, 0.55, 0.9, 0.9),
    "van": (0.25, 0.7, 0.85, 0.9),
    "truck": (0.35, 0.4, 0.8, 0.9),
    "bus": (0.55, 0.4, 0.85, 0.9),
    "motorbike": (0.95, 0.7, 0.2, 0.9),
    "bicycle": (0.45, 0.8, 0.3, 0.9),
    "pedestrian": (0.95, 0.35, 0.35, 0.9),
}
"""Color of actors by category."""
_OTHER: Color = (0.6, 0.6, 0.6, 0.9)
_TEXT: Color = (1.0, 1.0, 1.0, 1.0)


class ActorScene:
    """Scene with one entity per actor, which is deleted when the actor leaves the world."""

    def __init__(self, foxglove: Foxglove) -> None:
        self._foxglove = foxglove
        self._shown: dict[str, None] = {}

    def build(self, frame: Frame) -> Any:
        """Return the update of the next frame."""
        view = frame.view
        update = self._foxglove.scene()
        for name in self._shown:
            if name not in view:
                kind = self._foxglove.deletion.MATCHING_ID
                update.deletions.add(timestamp=stamp(view.time), type=kind, id=name)
        self._shown = dict.fromkeys(view.names)
        arms = np.einsum("nij,nj->ni", rotation_matrix(view.yaw, view.pitch, view.roll), view.offset)
        centers = (view.position + arms).tolist()
        for row, (name, category) in enumerate(zip(view.names, view.categories, strict=True)):
            entity = add_entity(update, name, view.time)
            turn = rotation(float(view.yaw[row]), float(view.pitch[row]), float(view.roll[row]))
            _add_cube(entity, centers[row], turn, view.size[row].tolist(), _COLORS.get(category, _OTHER))
            x, y, z = centers[row]
            add_text(entity, name, (x, y, z + 0.5 * float(view.size[row, 2]) + 0.6))
            speed = f"{view.speed[row]:.2f} m/s"
            for key, value in (("category", category), ("speed", speed)):
                entity.metadata.add(key=key, value=value)
        return update


def add_entity(update: Any, name: str, time: float) -> Any:
    """Add an entity in the world frame, which replaces the former one of this name."""
    return update.entities.add(timestamp=stamp(time), id=name, frame_id=WORLD)


def _add_cube(
    entity: Any, center: Sequence[float], turn: Mapping[str, float], size: Sequence[float], color: Color
) -> None:
    entity.cubes.add(pose={"position": vector(center), "orientation": turn}, size=vector(size), color=rgba(color))


def add_text(entity: Any, text: str, position: tuple[float, float, float], size: float = 0.8) -> None:
    """Add a text that faces the viewer; size in the world [m]."""
    pose = {"position": vector(position), "orientation": UPRIGHT}
    entity.texts.add(pose=pose, billboard=True, font_size=size, scale_invariant=False, color=rgba(_TEXT), text=text)


def box_scene(foxglove: Foxglove, lists: Iterable[tuple[str, Detections]], color: Color, time: float) -> Any:
    """Return a scene of perceived boxes with class and confidence, one entity per name with all its lists."""
    update = _cleared_scene(foxglove, time)
    by_name: dict[str, list[Detections]] = {}
    for name, objects in lists:
        by_name.setdefault(name, []).append(objects)
    for name, all_objects in by_name.items():
        entity = add_entity(update, name, time)
        for objects in all_objects:
            _add_boxes(entity, objects, color)
        entity.metadata.add(key="objects", value=str(sum(map(len, all_objects))))
    return update


def _cleared_scene(foxglove: Foxglove, time: float) -> Any:
    """Return a scene that deletes the former entities of its topic."""
    return foxglove.scene(deletions=[{"timestamp": stamp(time), "type": foxglove.deletion.ALL}])


def _add_boxes(entity: Any, objects: Detections, color: Color) -> None:
    """Add the boxes that are finite."""
    rows = zip(objects.boxes.tolist(), objects.classes, objects.confidence.tolist(), strict=True)
    for (x, y, z, length, width, height, yaw), category, confidence in rows:
        if not np.isfinite([x, y, z, length, width, height, yaw]).all():
            continue
        _add_cube(entity, (x, y, z), rotation(yaw), (length, width, height), color)
        add_text(entity, f"{category} {confidence:.2f}", (x, y, z + 0.5 * height + 0.3), 0.5)


_PAINT: Mapping[str, Color] = {"yellow": (0.95, 0.8, 0.2, 1.0)}
_WHITE: Color = (0.95, 0.95, 0.95, 1.0)
_EDGE: Color = (0.45, 0.45, 0.45, 1.0)
"""Color of lane edges without paint."""
_DRIVES: Color = (0.2, 0.85, 0.35, 1.0)
_BRAKES: Color = (0.95, 0.25, 0.2, 1.0)
_ABOVE = 0.3
"""Height of a planned path above the road [m]."""
_THICKNESS = 0.15
"""Thickness of lines [m]."""


def map_scene(foxglove: Foxglove, roads: RoadNetwork, time: float) -> Any:
    """Return a scene with the edges of all lanes, one entity per road."""
    update = foxglove.scene()
    spacing = point_spacing(roads)
    for road in roads.roads.values():
        entity = add_entity(update, f"road {road.id}", time)
        entity.metadata.add(key="name", value=road.name)
        for section in road.sections:
            for lane in section.lanes.values() if section.length > 0.0 else ():
                for edge in lane_edges(section, lane):
                    line = edge_line(roads, road, section, lane, edge, spacing)
                    color = _EDGE if edge.type in ("NO_LINE", "CURB") else _PAINT.get(edge.color, _WHITE)
                    _add_line(foxglove, entity, line, color, dashed=edge.type == "DASHED_LINE")
    return update


def plan_scene(foxglove: Foxglove, plan: Plan | None, roads: RoadNetwork | None, height: float, time: float) -> Any:
    """Return a scene with the path of a plan, green, or red if it brakes; without a plan the path is deleted.

    height  of the reference point of the vehicle [m], on which the path lies where there is no road
    """
    if plan is None or len(plan.points) < 2:
        return _cleared_scene(foxglove, time)
    update = foxglove.scene()
    entity = add_entity(update, "plan", time)
    points = np.column_stack([plan.points[:, :2], _surface_heights(roads, plan.points, height) + _ABOVE])
    _add_line(foxglove, entity, points.tolist(), _DRIVES if plan.braking is None else _BRAKES)
    braking = "" if plan.braking is None else f"{plan.braking:.2f} m/s²"
    for key, value in (("reason", plan.reason), ("braking", braking), ("speed", f"{plan.speeds[0]:.2f} m/s")):
        entity.metadata.add(key=key, value=value)
    return update


def _surface_heights(roads: RoadNetwork | None, points: Array, height: float) -> Array:
    """Return the heights (N,) of the roads below points (N, 2); `height` where there is none [m]."""
    heights = np.full(len(points), height)
    if roads is None or roads.is_level:
        return heights
    locations = roads.locate(points[:, 0], points[:, 1], heights)
    for road in np.unique(locations.road[locations.found]):
        rows = (locations.found & (locations.road == road)).nonzero()[0]
        location = locations.location(int(rows[0]))
        if location is not None:
            heights[rows] = roads.road_pose(location.road, locations.s[rows], locations.t[rows]).z
    return heights


def link_scene(foxglove: Foxglove, frame: Frame) -> Any:
    """Return a scene with a line from sender to receiver for each message, green if it was delivered, else red."""
    view = frame.view
    update = foxglove.scene()
    for event in frame.links:
        if event.sender == event.receiver or event.sender not in view or event.receiver not in view:
            continue
        entity = add_entity(update, f"{event.sender} to {event.receiver}, message {event.number}", view.time)
        entity.lifetime.FromMilliseconds(round(LINK_LIFETIME * 1000))
        ends = view.centers[[view.row(event.sender), view.row(event.receiver)]] + (0.0, 0.0, 1.0)
        _add_line(foxglove, entity, ends.tolist(), _DRIVES if event.outcome == "delivered" else _BRAKES)
        entity.metadata.add(key="outcome", value=event.reason or event.outcome)
        entity.metadata.add(key="message", value=str(event.number))
    return update


def _add_line(foxglove: Foxglove, entity: Any, points: Line, color: Color, *, dashed: bool = False) -> None:
    """Add a line; a dashed one consists of every second part."""
    kind = foxglove.line.LINE_LIST if dashed else foxglove.line.LINE_STRIP
    drawn = points[: len(points) // 2 * 2] if dashed else points
    entity.lines.add(
        type=kind,
        pose={"orientation": UPRIGHT},
        thickness=_THICKNESS,
        points=list(map(vector, drawn)),
        color=rgba(color),
    )
