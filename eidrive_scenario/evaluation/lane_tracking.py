"""Lanes under one actor: the lane of its center, and the lanes under points of its body."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from eidrive_scenario.roads import Lane, LaneKey, LaneLocation, RoadNetwork
from eidrive_scenario.world.view import WorldView

Point = tuple[float, float, float]

SIDEWALKS = frozenset({"sidewalk", "walking"})
"""Lane types for pedestrians."""


class LaneTracker:
    """Lanes under one actor. The previous lane has priority, so that an actor remains on its connecting road."""

    def __init__(self, roads: RoadNetwork) -> None:
        self.roads = roads
        self._hint: LaneLocation | None = None

    def center(self, view: WorldView, row: int) -> LaneLocation | None:
        """Return the lane under the center of an actor; None off all lanes."""
        x, y, *_ = view.plain_boxes[row]
        place = self.roads.locate_at(x, y, self._hint, view.states[row].z)
        self._hint = place
        return place if place is not None and self.roads.on_road(place) else None

    def forget(self) -> None:
        """Forget the previous lane, after a teleport."""
        self._hint = None

    def lane(self, place: LaneLocation) -> Lane:
        """Return the lane of a location."""
        return self.roads.road(place.road).section_at(place.s).lanes[place.lane]

    def key(self, place: LaneLocation) -> LaneKey:
        """Return the lane of a location as a node of the lane graph."""
        return LaneKey(place.road, self.roads.road(place.road).section_at(place.s).index, place.lane)

    def rows_at(self, points: Sequence[Point]) -> list[set[int]]:
        """Return the rows in `roads.tables` of all lanes under each point."""
        x, y, z = np.array(points, dtype=float).reshape(-1, 3).T
        rows, _, indices = self.roads.overlapped_lanes(x, y, z)
        found: list[set[int]] = [set() for _ in points]
        for row, index in zip(rows.tolist(), indices.tolist(), strict=True):
            if self.roads.tables.lane_id[row]:
                found[index].add(row)
        return found

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
