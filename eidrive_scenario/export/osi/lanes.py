"""Lanes and lane boundaries of a GroundTruth message, from the OpenDRIVE map of the run."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from eidrive_scenario.export.osi.identifiers import Identifiers
from eidrive_scenario.export.osi.schemas import Osi
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.roads.model.location import LaneKey
from eidrive_scenario.roads.model.road_map import DRIVABLE, Lane, LaneSection, Road
from eidrive_scenario.world.view import WorldView

SPACING = 2.0
"""Distance between points of center lines and boundaries [m]."""
_MAX_POINTS = 400_000
"""Maximum number of points of all lines."""
_SUBTYPES: Mapping[str, str] = {
    "biking": "BIKING",
    "sidewalk": "SIDEWALK",
    "walking": "SIDEWALK",
    "parking": "PARKING",
    "stop": "STOP",
    "restricted": "RESTRICTED",
    "border": "BORDER",
    "shoulder": "SHOULDER",
    "exit": "EXIT",
    "entry": "ENTRY",
    "onRamp": "ONRAMP",
    "offRamp": "OFFRAMP",
    "connectingRamp": "CONNECTINGRAMP",
}
"""Subtypes by the type of the OpenDRIVE lane; NORMAL for other drivable lanes, OTHER for the rest."""
_MARKS: Mapping[str, str] = {
    "none": "NO_LINE",
    "broken": "DASHED_LINE",
    "broken broken": "DASHED_LINE",
    "botts dots": "BOTTS_DOTS",
    "curb": "CURB",
    "grass": "GRASS_EDGE",
    "edge": "ROAD_EDGE",
}
"""Types of boundaries by road mark; all others are solid lines."""
_COLORS = frozenset({"white", "yellow", "red", "blue", "green", "violet", "orange"})


class _Edge(NamedTuple):
    """Boundary on the outer edge of a lane from one s to another [m]."""

    start: float
    end: float
    type: str
    color: str


class LaneMap:
    """Lanes of a map, and the lanes of actors. Without a map there are none."""

    def __init__(self, osi: Osi, roads: RoadNetwork | None, ids: Identifiers) -> None:
        self._osi = osi
        self._roads = roads
        self._ids = ids

    def add(self, message: Any) -> None:
        """Add all lanes and boundaries."""
        if self._roads is None:
            return
        spacing = self._spacing(self._roads)
        ways = _successors(self._roads)
        for road in self._roads.roads.values():
            for section in road.sections:
                if section.length <= 0.0:
                    continue
                for lane in section.lanes.values():
                    self._add_boundaries(message, road, section, lane, spacing)
                    if lane.id:
                        self._add_lane(message, road, section, lane, spacing, ways)

    def assigned(self, view: WorldView) -> dict[int, int]:
        """Return the identifiers of the lanes on which actors are, by row."""
        if self._roads is None or not view.names or not self._roads.roads:
            return {}
        centers = view.centers
        found = self._roads.locate(centers[:, 0], centers[:, 1], view.position[:, 2])
        assigned = {}
        for row in np.flatnonzero(found.found & (found.outside <= 0.0)).tolist():
            place = found.location(row)
            if place is not None and place.lane:
                section = self._roads.roads[place.road].section_at(place.s)
                assigned[row] = self._ids.of("lane", place.road, section.index, place.lane)
        return assigned

    @staticmethod
    def _spacing(roads: RoadNetwork) -> float:
        length = sum(
            2.0 * section.length * len(section.lanes) for road in roads.roads.values() for section in road.sections
        )
        return max(SPACING, length / _MAX_POINTS)

    def _add_lane(
        self, message: Any, road: Road, section: LaneSection, lane: Lane, spacing: float, ways: _Ways
    ) -> None:
        kinds = self._osi.lane.Classification
        found = message.lane.add()
        found.id.value = self._lane(road, section, lane.id)
        data = found.classification
        drivable = lane.type in DRIVABLE
        data.type = kinds.Type.Value("TYPE_DRIVING" if drivable else "TYPE_NONDRIVING")
        subtype = _SUBTYPES.get(lane.type, "NORMAL" if drivable else "OTHER")
        data.subtype = kinds.Subtype.Value(f"SUBTYPE_{subtype}")
        stations = _stations(section.s, section.end, spacing)
        middle = [lane.side * lane.center.value(s - section.s) + road.lane_offset.value(s) for s in stations]
        for s, (x, y, z) in zip(stations, self._line(road, stations, middle), strict=True):
            data.centerline.add(x=x, y=y, z=z + _height(lane, s - section.s))
        ahead = road.directions.get(lane.id, 1) == 1
        data.centerline_is_driving_direction = ahead
        left, right = _neighbor(lane.id, 1), _neighbor(lane.id, -1)
        for number, target in ((left, data.left_adjacent_lane_id), (right, data.right_adjacent_lane_id)):
            if number in section.lanes:
                target.add().value = self._lane(road, section, number)
        # In the direction of s, the left edge of a right lane is the outer edge of the lane left of it
        inner, outer = lane.id - lane.side, lane.id
        for number, target in (
            (inner if lane.id < 0 else outer, data.left_lane_boundary_id),
            (outer if lane.id < 0 else inner, data.right_lane_boundary_id),
        ):
            for index, _ in enumerate(_edges(section, section.lanes.get(number))):
                target.add().value = self._ids.of("boundary", road.id, section.index, number, index)
        key = LaneKey(road.id, section.index, lane.id)
        after, before = ways.after.get(key, ()), ways.before.get(key, ())
        for other in after if ahead else before:
            data.lane_pairing.add().successor_lane_id.value = self._ids.of("lane", *other)
        for other in before if ahead else after:
            data.lane_pairing.add().antecessor_lane_id.value = self._ids.of("lane", *other)
        found.source_reference.add(
            type="net.asam.opendrive", identifier=[f"road_id:{road.id}", f"lane_id:{lane.id}", f"s:{section.s:g}"]
        )

    def _add_boundaries(self, message: Any, road: Road, section: LaneSection, lane: Lane, spacing: float) -> None:
        kinds = self._osi.lane_boundary.Classification
        for index, edge in enumerate(_edges(section, lane)):
            found = message.lane_boundary.add()
            found.id.value = self._ids.of("boundary", road.id, section.index, lane.id, index)
            stations = _stations(edge.start, edge.end, spacing)
            edges = [lane.side * lane.outer.value(s - section.s) + road.lane_offset.value(s) for s in stations]
            for x, y, z in self._line(road, stations, edges):
                position = found.boundary_line.add().position
                position.x, position.y, position.z = x, y, z
            found.classification.type = kinds.Type.Value(f"TYPE_{edge.type}")
            color = "NONE" if edge.type == "NO_LINE" else edge.color.upper()
            found.classification.color = kinds.Color.Value(f"COLOR_{color}")

    def _lane(self, road: Road, section: LaneSection, number: int) -> int:
        return self._ids.of("lane", road.id, section.index, number)

    def _line(self, road: Road, stations: list[float], aside: list[float]) -> list[list[float]]:
        """Return points x, y, z at road coordinates s and t."""
        assert self._roads is not None
        poses = self._roads.road_pose(road.id, stations, aside)
        points: list[list[float]] = np.column_stack([poses.x, poses.y, poses.z]).tolist()
        return points


class _Ways(NamedTuple):
    """Lanes after and before each lane in driving direction."""

    after: Mapping[LaneKey, list[LaneKey]]
    before: Mapping[LaneKey, list[LaneKey]]


def _successors(roads: RoadNetwork) -> _Ways:
    after: dict[LaneKey, list[LaneKey]] = {}
    before: dict[LaneKey, list[LaneKey]] = {}
    for one, other, data in roads.graph.edges(data=True):
        if data["kind"] == "successor":
            after.setdefault(one, []).append(other)
            before.setdefault(other, []).append(one)
    return _Ways(after, before)


def _neighbor(number: int, step: int) -> int:
    """Return the next lane id to the left (+1) or right (-1) without lane 0."""
    return number + step or step


def _edges(section: LaneSection, lane: Lane | None) -> Iterator[_Edge]:
    """Yield the boundaries on the outer edge of a lane, one per road mark."""
    if lane is None:
        return
    marks = [mark for mark in lane.road_marks if mark.s_offset < section.length]
    starts = [section.s + max(mark.s_offset, 0.0) for mark in marks]
    if not marks or starts[0] > section.s:
        yield _Edge(section.s, starts[0] if marks else section.end, "NO_LINE", "none")
    for mark, start, end in zip(marks, starts, [*starts[1:], section.end], strict=True):
        if end > start:
            color = mark.color if mark.color in _COLORS else "white"
            yield _Edge(start, end, _MARKS.get(mark.type, "SOLID_LINE"), color)


def _height(lane: Lane, along: float) -> float:
    """Return the height of the middle of a lane above the road [m], for example of a sidewalk."""
    index = bisect_right(lane.heights, along, key=lambda entry: entry.s_offset) - 1
    return 0.5 * (lane.heights[index].inner + lane.heights[index].outer) if index >= 0 else 0.0


def _stations(start: float, end: float, spacing: float) -> list[float]:
    found: list[float] = np.linspace(start, end, max(2, math.ceil((end - start) / spacing) + 1)).tolist()
    return found
