"""Lanes and lane boundaries of a GroundTruth message, from the OpenDRIVE map of the run."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product
from typing import Any

from eidrive_scenario.evaluation.actor_tracking import LaneTracker
from eidrive_scenario.export.geometry import LaneEdge, Line, center_line, dashed_edge_line, lane_edges, point_spacing
from eidrive_scenario.export.osi.schemas import Identifiers, Osi
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.roads.model.location import LaneKey
from eidrive_scenario.roads.model.road_map import DRIVABLE, Lane, LaneSection, Road
from eidrive_scenario.world.view import WorldView

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


class LaneMap:
    """Lanes of a map, and the lanes of actors. Without a map there are none."""

    def __init__(self, osi: Osi, roads: RoadNetwork | None, ids: Identifiers) -> None:
        self._osi = osi
        self._roads = roads
        self._ids = ids
        self._actors: dict[str, LaneTracker] = {}

    def add(self, message: Any) -> None:
        """Add all lanes and boundaries."""
        if self._roads is None:
            return
        spacing = point_spacing(self._roads)
        for road in self._roads.roads.values():
            for section in road.sections:
                if section.length <= 0.0:
                    continue
                for lane in section.lanes.values():
                    for index, edge in enumerate(lane_edges(section, lane)):
                        line, dashes = dashed_edge_line(self._roads, road, section, lane, edge, spacing)
                        number = self._ids.of("boundary", road.id, section.index, lane.id, index)
                        self._add_boundary(message, edge, line, dashes, number)
                    if lane.id:
                        line = center_line(self._roads, road, section, lane, spacing)
                        self._add_lane(message, road, section, lane, line)

    def assigned(self, view: WorldView) -> dict[int, int]:
        """Return the identifiers of the lanes on which actors are, by row."""
        assigned: dict[int, int] = {}
        if self._roads is None:
            return assigned
        for name, row in view.rows.items():
            location = self._actors.setdefault(name, LaneTracker(self._roads)).under_center(view, row)
            if location is not None and location.lane:
                section = self._roads.roads[location.road].section_at(location.s)
                assigned[row] = self._ids.of("lane", location.road, section.index, location.lane)
        return assigned

    def _add_lane(self, message: Any, road: Road, section: LaneSection, lane: Lane, line: Line) -> None:
        kinds = self._osi.lane.Classification
        lane_message = message.lane.add()
        lane_message.id.value = self._lane(road, section, lane.id)
        classification = lane_message.classification
        drivable = lane.type in DRIVABLE
        classification.type = kinds.Type.Value("TYPE_DRIVING" if drivable else "TYPE_NONDRIVING")
        subtype = _SUBTYPES.get(lane.type, "NORMAL" if drivable else "OTHER")
        classification.subtype = kinds.Subtype.Value(f"SUBTYPE_{subtype}")
        for x, y, z in line:
            classification.centerline.add(x=x, y=y, z=z)
        ahead = road.directions.get(lane.id, 1) == 1
        classification.centerline_is_driving_direction = ahead
        for number, target in (
            (_neighbor(lane.id, 1), classification.left_adjacent_lane_id),
            (_neighbor(lane.id, -1), classification.right_adjacent_lane_id),
        ):
            if number in section.lanes:
                target.add().value = self._lane(road, section, number)
        # In the direction of s, the left edge of a right lane is the outer edge of the lane left of it
        inner, outer = lane.id - lane.side, lane.id
        for number, target in (
            (inner if lane.id < 0 else outer, classification.left_lane_boundary_id),
            (outer if lane.id < 0 else inner, classification.right_lane_boundary_id),
        ):
            for index, _ in enumerate(lane_edges(section, section.lanes.get(number))):
                target.add().value = self._ids.of("boundary", road.id, section.index, number, index)
        assert self._roads is not None
        graph, key = self._roads.graph, LaneKey(road.id, section.index, lane.id)
        after, before = (
            [other for other, link in links.get(key, {}).items() if link["kind"] == "successor"]
            for links in (graph.adj, graph.pred)
        )
        start, end = (before, after) if ahead else (after, before)
        # One pair for each way over the lane. One without neighbors has none
        for antecessor, successor in product(start or (None,), end or (None,)) if start or end else ():
            pairing = classification.lane_pairing.add()
            if antecessor is not None:
                pairing.antecessor_lane_id.value = self._ids.of("lane", *antecessor)
            if successor is not None:
                pairing.successor_lane_id.value = self._ids.of("lane", *successor)
        lane_message.source_reference.add(type="net.asam.opendrive", identifier=[road.id, str(section.s), str(lane.id)])

    def _add_boundary(self, message: Any, edge: LaneEdge, line: Line, dashes: list[str], number: int) -> None:
        kinds = self._osi.lane_boundary.Classification
        boundary = message.lane_boundary.add()
        boundary.id.value = number
        for x, y, z in line:
            position = boundary.boundary_line.add().position
            position.x, position.y, position.z = x, y, z
        for point, name in zip(boundary.boundary_line, dashes, strict=False):
            point.dash = self._osi.lane_boundary.BoundaryPoint.Dash.Value(f"DASH_{name}")
        if edge.mark is not None and edge.type in ("SOLID_LINE", "DASHED_LINE") and edge.mark.width > 0.0:
            # Further points have the width of the first one
            boundary.boundary_line[0].width = edge.mark.width
        boundary.classification.type = kinds.Type.Value(f"TYPE_{edge.type}")
        color = "NONE" if edge.type == "NO_LINE" else edge.color.upper()
        boundary.classification.color = kinds.Color.Value(f"COLOR_{color}")

    def _lane(self, road: Road, section: LaneSection, number: int) -> int:
        return self._ids.of("lane", road.id, section.index, number)


def _neighbor(number: int, step: int) -> int:
    """Return the next lane id to the left (+1) or right (-1) without lane 0."""
    return number + step or step
