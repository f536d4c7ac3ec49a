"""Poses of bounding boxes in world and vehicle coordinates; center lines and edges of lanes in the world."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.geometry import equidistant
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.roads.model.polynomials import Polynomials
from eidrive_scenario.roads.model.road_map import Lane, LaneSection, Road, RoadMark
from eidrive_scenario.roads.surfaces import mark_dashes


def angles(turn: Array) -> tuple[float, float, float]:
    """Return yaw, pitch and roll of a rotation matrix (3, 3), the inverse of `rotation_matrix` [rad]."""
    (xx, _, _), (yx, _, _), (zx, zy, zz) = turn.tolist()
    return math.atan2(yx, xx), math.asin(min(max(-zx, -1.0), 1.0)), math.atan2(zy, zz)


SPACING = 2.0
"""Maximum distance between the points of a line [m]."""
DEVIATION = 0.05
"""Maximum distance of the true line from that between two points [m], as OSI demands of lanes and their boundaries."""
SHARES = (0.25, 0.5, 0.75)
"""Shares of an interval at which the deviation is measured: an S crosses its chord in the middle."""
HALVINGS = 3
"""Maximum number of times that an interval is halved, to bound the points; 0.25 m suffice on the maps of CARLA."""
_MAX_POINTS = 400_000
"""Maximum number of points of all lines of a map before halving, which increases the distance on large maps."""
_MARKS: Mapping[str, str] = {
    "none": "NO_LINE",
    "broken": "DASHED_LINE",
    "broken broken": "DASHED_LINE",
    "botts dots": "BOTTS_DOTS",
    "curb": "CURB",
    "grass": "GRASS_EDGE",
    "edge": "ROAD_EDGE",
}
"""Types of edges by road mark; all others are solid lines."""
_COLORS = frozenset({"white", "yellow", "red", "blue", "green", "violet", "orange"})

Line = list[list[float]]
"""Points x, y, z [m]."""


@dataclass(frozen=True)
class LaneEdge:
    """Outer edge of a lane with one road mark, from one s to another [m]; types are those of OSI lane boundaries."""

    start: float
    end: float
    type: str
    color: str
    mark: RoadMark | None = None


def point_spacing(roads: RoadNetwork) -> float:
    """Return the distance between the points of lines, so that a large map has a limited number of points [m]."""
    length = sum(
        2.0 * section.length * len(section.lanes) for road in roads.roads.values() for section in road.sections
    )
    return max(SPACING, length / _MAX_POINTS)


def lane_edges(section: LaneSection, lane: Lane | None) -> Iterator[LaneEdge]:
    """Yield the outer edges of a lane in the order of s, one per road mark."""
    if lane is None:
        return
    marks = [mark for mark in lane.road_marks if mark.s_offset < section.length]
    starts = [section.s + max(mark.s_offset, 0.0) for mark in marks]
    if not marks or starts[0] > section.s:
        yield LaneEdge(section.s, starts[0] if marks else section.end, "NO_LINE", "none")
    for mark, start, end in zip(marks, starts, [*starts, section.end][1:], strict=True):
        if end > start:
            color = mark.color if mark.color in _COLORS else "white"
            yield LaneEdge(start, end, _MARKS.get(mark.type, "SOLID_LINE"), color, mark)


def center_line(roads: RoadNetwork, road: Road, section: LaneSection, lane: Lane, spacing: float) -> Line:
    """Return the center line of a lane in the direction of s, with the height of the lane above the road."""
    stations, points = _line(roads, road, section, lane, lane.center, (section.s, section.end), spacing)
    return [[x, y, z + _height(lane, s - section.s)] for s, (x, y, z) in zip(stations, points, strict=True)]


def edge_line(roads: RoadNetwork, road: Road, section: LaneSection, lane: Lane, edge: LaneEdge, spacing: float) -> Line:
    """Return an outer edge of a lane on the surface of the road, in the direction of s."""
    return _line(roads, road, section, lane, lane.outer, (edge.start, edge.end), spacing)[1]


def dashed_edge_line(
    roads: RoadNetwork, road: Road, section: LaneSection, lane: Lane, edge: LaneEdge, spacing: float
) -> tuple[Line, list[str]]:
    """Return an edge with additional points at the starts and ends of the dashes of a broken mark.

    The names are those of OSI for the points of the dashes and gaps, without names for other marks.
    """
    if edge.mark is None or edge.type != "DASHED_LINE":
        return edge_line(roads, road, section, lane, edge, spacing), []
    dashes = mark_dashes(lane, edge.mark, edge.start, edge.end)
    ends = (edge.start, edge.end)
    stations, line = _line(roads, road, section, lane, lane.outer, ends, spacing, dashes.ravel())
    names = np.full(len(stations), "GAP", dtype="<U8")
    for low, high in np.searchsorted(stations, dashes).tolist():
        names[low:high] = "CONTINUE"
        names[low], names[high] = "START", "END"
    return line, names.tolist()


def _line(
    roads: RoadNetwork,
    road: Road,
    section: LaneSection,
    lane: Lane,
    distance: Polynomials,
    ends: tuple[float, float],
    spacing: float,
    among: Array | None = None,
) -> tuple[list[float], Line]:
    """Return s and points of a line at a distance from the lane offset, with points at the s `among` them (K,).

    Intervals of `spacing` are halved where the line is farther than `DEVIATION` from the chord.
    """

    def points(stations: Array) -> Array:
        aside = [lane.side * distance.value(s - section.s) + road.lane_offset_in(section, s)[0] for s in stations]
        poses = roads.road_pose(road.id, stations, aside)
        return np.column_stack([poses.x, poses.y, poses.z])

    stations = np.array(equidistant(*ends, spacing))
    if among is not None:
        stations = np.unique(np.concatenate([stations, among]))
    line, fresh = points(stations), np.diff(stations) > 0.0
    for _ in range(HALVINGS):
        if not fresh.any():
            break
        start, step = stations[:-1][fresh], np.diff(stations)[fresh]
        first, chord = line[:-1][fresh], np.diff(line, axis=0)[fresh]
        between = [points(start + share * step) for share in SHARES]
        pairs = zip(SHARES, between, strict=True)
        away = np.max([np.linalg.norm(point - first - share * chord, axis=1) for share, point in pairs], axis=0)
        added = away > DEVIATION
        at, middle = np.flatnonzero(fresh)[added] + 1, (start + SHARES[1] * step)[added]
        stations, line = np.insert(stations, at, middle), np.insert(line, at, between[1][added], axis=0)
        halves = np.isin(stations, middle)
        fresh = halves[1:] | halves[:-1]
    return stations.tolist(), line.tolist()


def _height(lane: Lane, along: float) -> float:
    """Return the height of the middle of a lane above the road [m], for example of a sidewalk."""
    index = bisect_right(lane.heights, along, key=lambda height: height.s_offset) - 1
    return 0.5 * (lane.heights[index].inner + lane.heights[index].outer) if index >= 0 else 0.0
