"""Lanes of the map, paths of planners, and messages between stations as scenes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from eidrive_scenario.arrays import Array
from eidrive_scenario.driving.step import Plan
from eidrive_scenario.export.foxglove.boxes import add_entity
from eidrive_scenario.export.foxglove.schemas import Color, Foxglove, set_color, set_rotation, set_stamp
from eidrive_scenario.export.lane_lines import Line, edge_line, lane_edges, point_spacing
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.roads import RoadNetwork

LINK_LIFETIME = 0.15
"""Time for which the line of a message is shown [s]. It exceeds the period of 10 Hz messages to avoid flicker."""
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
    update = foxglove.scene()
    if plan is None or len(plan.points) < 2:
        deletion = update.deletions.add(type=foxglove.deletion.ALL)
        set_stamp(deletion.timestamp, time)
        return update
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
    found = roads.locate(points[:, 0], points[:, 1], heights)
    for road in np.unique(found.road[found.found]):
        rows = (found.found & (found.road == road)).nonzero()[0]
        place = found.location(int(rows[0]))
        if place is not None:
            heights[rows] = roads.road_pose(place.road, found.s[rows], found.t[rows]).z
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
    line = entity.lines.add(type=kind, thickness=_THICKNESS)
    set_rotation(line.pose.orientation, 0.0)
    set_color(line.color, color)
    for x, y, z in _dashes(points) if dashed else points:
        line.points.add(x=x, y=y, z=z)


def _dashes(points: Sequence[Sequence[float]]) -> list[Sequence[float]]:
    return [point for start in range(0, len(points) - 1, 2) for point in (points[start], points[start + 1])]
