"""Tracking of one actor from frame to frame: its steps without absences and teleports, and the lanes under it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from eidrive_scenario.base.geometry import is_teleport
from eidrive_scenario.roads import Lane, LaneKey, LaneLocation, RoadNetwork
from eidrive_scenario.world.view import WorldView


class Step(NamedTuple):
    """Motion since the previous frame: duration [s] and distance of the center of the body [m]."""

    duration: float
    distance: float


class Continuity:
    """Steps of one actor between successive frames."""

    def __init__(self) -> None:
        self._last: tuple[float, float, float, float] | None = None
        """Time, center and speed in the previous frame; None if the actor was absent."""

    def step(self, view: WorldView, row: int | None) -> Step | None:
        """Return the motion since the previous frame; None after an absence or a teleport.

        row  of the actor; None if it is absent
        """
        before = self._last
        if row is None:
            self._last = None
            return None
        x, y, *_ = view.plain_boxes[row]
        speed = abs(float(view.speed[row]))
        self._last = view.time, x, y, speed
        if before is None:
            return None
        duration, distance = view.time - before[0], math.hypot(x - before[1], y - before[2])
        return None if is_teleport(distance, max(speed, before[3]), duration) else Step(duration, distance)


AGAINST = math.cos(math.radians(120.0))
"""Cosine of the angle between the heading of an actor and the direction of a lane beyond which the lane is an opposite
one; 120° as in ScenarioRunner's criterion of wrong lanes."""
GAP = 0.5
"""Maximum distance beyond the end of a road within which a center is on it [m]: roads of maps may have gaps."""
Point = tuple[float, float, float]

SIDEWALKS = frozenset({"sidewalk", "walking"})
"""Lane types for pedestrians."""


class LaneTracker:
    """Lanes under one actor. The previous lane has priority, so that an actor remains on its connecting road."""

    def __init__(self, roads: RoadNetwork) -> None:
        self.roads = roads
        self._hint: LaneLocation | None = None

    def center(self, view: WorldView, row: int) -> LaneLocation | None:
        """Return the lane at the center of an actor, also beyond the end of its road; None beside all lanes."""
        x, y, *_, yaw = view.plain_boxes[row]
        location = self.roads.locate_pose(x, y, yaw, view.states[row].z, self._hint)
        self._hint = location
        return location if location is not None and self.roads.on_road(location) else None

    def under_center(self, view: WorldView, row: int) -> LaneLocation | None:
        """Return the lane under the center of an actor; None beside all lanes and beyond the end of the road."""
        location = self.center(view, row)
        if location is None:
            return None
        (x, y, *_), pose = view.plain_boxes[row], self.roads.pose(location)
        return location if math.hypot(pose.x - x, pose.y - y) <= GAP else None

    def forget(self) -> None:
        """Forget the previous lane, after a teleport."""
        self._hint = None

    def lane(self, location: LaneLocation) -> Lane:
        """Return the lane of a location."""
        return self.roads.lane(location)

    def key(self, location: LaneLocation) -> LaneKey:
        """Return the lane of a location as a node of the lane graph."""
        return LaneKey(location.road, self.roads.road(location.road).section_at(location.s).index, location.lane)

    def rows_at(self, points: Sequence[Point]) -> list[set[int]]:
        """Return the rows in `roads.tables` of all lanes under each point."""
        x, y, z = np.array(points, dtype=float).reshape(-1, 3).T
        rows, _, indices = self.roads.overlapped_lanes(x, y, z)
        lanes: list[set[int]] = [set() for _ in points]
        for row, index in zip(rows.tolist(), indices.tolist(), strict=True):
            if self.roads.tables.lane_id[row]:
                lanes[index].add(row)
        return lanes

    def are_against(self, points: Sequence[Point], yaw: float) -> list[bool]:
        """Return whether each point is in lanes whose traffic drives against a heading [rad], outside of junctions."""
        x, y, z = np.array(points, dtype=float).reshape(-1, 3).T
        rows, s, indices = self.roads.overlapped_lanes(x, y, z)
        tables = self.roads.tables
        heading = tables.lane_poses(rows, s, np.zeros(len(s))).h
        against = [False] * len(points)
        for row, index, direction in zip(rows.tolist(), indices.tolist(), heading.tolist(), strict=True):
            lane, road = tables.lanes[row], self.roads.roads[tables.ids[tables.section_road[tables.lane_section[row]]]]
            if lane.id and lane.drivable and road.junction_id is None:
                sense = self.roads.driving_direction(road.id, lane.id)
                against[index] |= sense * math.cos(direction - yaw) < AGAINST
        return against

    def types_at(self, points: Sequence[Point]) -> list[set[str]]:
        """Return the types of all lanes under each point; "driving" for every type for cars."""
        lanes = self.roads.tables.lanes
        return [
            {"driving" if lanes[row].drivable else lanes[row].type for row in rows} for rows in self.rows_at(points)
        ]


def corners(view: WorldView, row: int) -> list[Point]:
    """Return the corners of the body of an actor on the ground: front left, rear left, rear right, front right."""
    x, y, _, length, width, _, yaw = view.plain_boxes[row]
    cos, sin, z = math.cos(yaw), math.sin(yaw), view.states[row].z
    ahead, left = length / 2.0, width / 2.0
    return [
        (x + cos * p - sin * q, y + sin * p + cos * q, z)
        for p, q in ((ahead, left), (-ahead, left), (-ahead, -left), (ahead, -left))
    ]
