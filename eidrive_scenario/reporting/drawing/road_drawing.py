"""Drawing of roads from above: lanes as polygons, road marks as lines."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.geometry import equidistant, footprint
from eidrive_scenario.errors import Diagnostic, InputError
from eidrive_scenario.recording.recording import Recording
from eidrive_scenario.recording.run_files import ROAD_FILE
from eidrive_scenario.reporting.drawing.top_view import RoadDrawing, Window
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.roads.geometry.poses import lateral_axis
from eidrive_scenario.roads.model.road_map import Lane, LaneSection, Road
from eidrive_scenario.world.road_objects import Building, buildings

CLEARANCE = 3.0
"""Minimum height of a road above another one that it covers [m]."""
_CELL = 5.0
"""Size of the squares in which heights are compared [m]."""
_FARTHEST = 1e9
"""Maximum coordinate of roads of which parts are found [m]."""
_MARGIN = 5.0
"""Length of a road before and after a part above another one that is drawn above it, too [m]."""


class Strip(NamedTuple):
    """Part of a lane section.

    stations  s coordinates (N,) in ascending order [m]
    heights   of the road (N,) [m]
    points    of the edges of all lanes (K, N, 2) [m]
    """

    stations: Array
    heights: Array
    points: Array


def bridge_spans(strips: Sequence[Strip]) -> Iterator[tuple[int, float, float]]:
    """Yield the parts of strips that are above another strip, or another part of it: index, first and last s [m].

    Strips with numbers that are not finite, or beyond the maximum coordinate, are omitted.
    """
    usual = [
        (index, strip)
        for index, strip in enumerate(strips)
        if strip.points.size and np.isfinite(strip.heights).all() and (np.abs(strip.points) <= _FARTHEST).all()
    ]
    levels = [level for _, strip in usual for level in (float(strip.heights.min()), float(strip.heights.max()))]
    if not usual or max(levels) - min(levels) < CLEARANCE:
        return
    heights = np.concatenate([np.tile(strip.heights, len(strip.points)) for _, strip in usual])
    # The lowest height in each square of the plane, and the points that are above it
    squares = np.floor(np.concatenate([strip.points.reshape(-1, 2) for _, strip in usual]) / _CELL).astype(np.int64)
    rows = squares[:, 1] - squares[:, 1].min()
    occupied, square_of_point = np.unique(squares[:, 0] * (rows.max() + 1) + rows, return_inverse=True)
    ground = np.full(len(occupied), np.inf)
    np.minimum.at(ground, square_of_point, heights)
    above = heights - ground[square_of_point] >= CLEARANCE
    ends = np.cumsum([strip.points.size // 2 for _, strip in usual])
    for (index, strip), of_strip in zip(usual, np.split(above, ends[:-1]), strict=True):
        covers = of_strip.reshape(strip.points.shape[:2]).any(axis=0)
        changes = np.flatnonzero(np.diff(covers, prepend=False, append=False)).tolist()
        for first, end in zip(changes[::2], changes[1::2], strict=True):
            yield (
                index,
                max(float(strip.stations[0]), float(strip.stations[first]) - _MARGIN),
                min(float(strip.stations[-1]), float(strip.stations[end - 1]) + _MARGIN),
            )


SPACING = 1.0
"""Distance between computed points of lane edges [m], before the simplification of straight parts."""
MAX_SPACING = 50.0
"""Maximum of that distance on a large map [m]."""
_MAX_POINTS = 1_500_000
"""Maximum number of computed points."""
_LARGEST_ROAD_FILE = 64 * 2**20
"""Maximum size of a road file of a recording that is drawn [bytes]."""
TOLERANCE = 0.02
"""Maximum deviation of a drawn line from the edge [m]."""

_LOWEST = ("none", "shoulder", "border", "sidewalk", "median")


def road_drawing(roads: Iterable[Road], window: Window | None = None) -> RoadDrawing:
    """Return lanes and road marks of these roads, limited to an optional `window`.

    Driving lanes come last, so that they cover the shoulders of crossing roads in a junction. Parts of roads that pass
    above others are repeated in `above`. Edges of a large map have a larger point spacing. Raise InputError if the map
    exceeds the maximum spacing.
    """
    roads = list(roads)
    spacing = _spacing(roads)
    parts = [
        _Part(road, section, stations)
        for road in roads
        for section in road.sections
        if section.length > 0.0
        for stations in _simple_parts(road, section, equidistant(section.s, section.end, spacing))
    ]
    edges = [part.edges() for part in parts]
    ground = _drawn(zip(parts, edges, strict=True), window, spacing)
    raised: dict[int, list[tuple[_Part, Sequence[_Edges]]]] = {}
    strips = [part.strip(part_edges) for part, part_edges in zip(parts, edges, strict=True)]
    for index, start, end in bridge_spans(strips):
        over = parts[index]._replace(stations=equidistant(start, end, spacing))
        height = over.road.elevation.value((start + end) / 2.0)
        raised.setdefault(math.floor(height / CLEARANCE), []).append((over, over.edges()))
    return replace(ground, above=tuple(_drawn(raised[level], window, spacing) for level in sorted(raised)))


class _Edges(NamedTuple):
    """Lane and its inner and outer edge (N, 2) [m]."""

    lane: Lane
    inner: Array
    outer: Array


class _Part(NamedTuple):
    """Part of a lane section between the first and the last of some s coordinates [m]."""

    road: Road
    section: LaneSection
    stations: list[float]

    def edges(self) -> list[_Edges]:
        """Return the edges of all lanes except the center lane."""
        return [
            _Edges(
                lane,
                _edge(self.road, self.section, lane, self.stations, outer=False),
                _edge(self.road, self.section, lane, self.stations, outer=True),
            )
            for lane in self.section.lanes.values()
            if lane.id != 0
        ]

    def strip(self, edges: Sequence[_Edges]) -> Strip:
        """Return heights and edges of the part, with the middle of each lane."""
        lines = [line for _, inner, outer in edges for line in (inner, (inner + outer) / 2.0, outer)]
        points = np.array(lines) if lines else np.empty((0, len(self.stations), 2))
        heights = np.array([self.road.elevation.value(s) for s in self.stations])
        return Strip(np.array(self.stations), heights, points)


def _drawn(parts: Iterable[tuple[_Part, Sequence[_Edges]]], window: Window | None, spacing: float) -> RoadDrawing:
    """Return lanes and road marks of parts of roads."""
    lanes: list[tuple[str, Array]] = []
    markings: list[tuple[str, str, Array]] = []
    for part, edges in parts:
        for lane, inner, outer in edges:
            polygon = np.concatenate([simplify_line(inner), simplify_line(outer)[::-1]])
            if window is None or window.reaches(polygon):
                lanes.append((lane.type, polygon))
        for lane in part.section.lanes.values():
            marks = _marks(part, lane, spacing)
            markings.extend(mark for mark in marks if window is None or window.reaches(mark[2]))
    lanes.sort(key=lambda entry: _LOWEST.index(entry[0]) if entry[0] in _LOWEST else len(_LOWEST))
    return RoadDrawing(tuple(lanes), tuple(markings))


def recorded_network(recording: Recording) -> RoadNetwork | None:
    """Return the road network in the attachments of a recording, None without one. Raise InputError."""
    text = recording.attachments.get(ROAD_FILE)
    if text is None:
        return None
    if len(text) > _LARGEST_ROAD_FILE:
        raise _too_large(f"{recording.path}/{ROAD_FILE}")
    try:
        return _parse(text)
    except InputError as error:
        source = f"{recording.path}/{ROAD_FILE}"
        raise type(error)([replace(diagnostic, source=source) for diagnostic in error.diagnostics]) from error


@lru_cache(maxsize=1)  # recordings of a batch often have the same roads
def _parse(text: bytes) -> RoadNetwork:
    return RoadNetwork.parse(text, ROAD_FILE)


def network_drawing(network: RoadNetwork | None) -> RoadDrawing:
    """Return the roads of a network with houses; an empty drawing without a network. Errors as for `road_drawing`."""
    if network is None:
        return RoadDrawing()
    houses = tuple((house_outline(house), house.size[2]) for house in buildings(network))
    return replace(road_drawing(network.roads.values()), houses=houses)


def house_outline(house: Building) -> Array:
    """Return the outline (4, 2) of a building [m]."""
    return footprint(np.array([*house.center, *house.size, house.yaw]))


def simplify_line(points: Array, tolerance: float = TOLERANCE) -> Array:
    """Return the points (N, 2) without points within `tolerance` of the line between kept neighbors [m]
    (Douglas and Peucker 1973)."""
    keep = np.zeros(len(points), dtype=bool)
    keep[[0, -1]] = True
    open_spans = [(0, len(points) - 1)]
    while open_spans:
        first, last = open_spans.pop()
        if last - first < 2:
            continue
        along = points[last] - points[first]
        length = float(np.hypot(*along))
        between = points[first + 1 : last] - points[first]
        if length > 0.0:
            deviation = np.abs(along[0] * between[:, 1] - along[1] * between[:, 0]) / length
        else:
            deviation = np.hypot(between[:, 0], between[:, 1])
        farthest = int(deviation.argmax())
        if deviation[farthest] > tolerance:
            middle = first + 1 + farthest
            keep[middle] = True
            open_spans += [(first, middle), (middle, last)]
    return points[keep]


def _spacing(roads: Sequence[Road]) -> float:
    """Return the point spacing that limits the number of points [m]."""
    length = sum(
        section.length * sum(2 + len(lane.road_marks) for lane in section.lanes.values())
        for road in roads
        for section in road.sections
    )
    spacing = max(SPACING, length / _MAX_POINTS)
    if not spacing <= MAX_SPACING:
        raise _too_large("")
    return spacing


def _too_large(source: str) -> InputError:
    return InputError(Diagnostic("the road network is too large for a drawing", "", source))


def _simple_parts(road: Road, section: LaneSection, stations: list[float]) -> list[list[float]]:
    """Return the s coordinates in parts whose polygons do not overlap themselves; neighbors share a station.

    In each part the road turns by at most about 180°, as a helical ramp would overlap itself. Tight curves are separate
    parts: inside of them, the lanes before and after the curve overlap. The fill would have holes there.
    """
    points = [road.reference.at(s) for s in stations]
    headings = np.unwrap([point.h for point in points]).tolist()
    tight = [_is_tight(road, section, s, point.curvature) for s, point in zip(stations, points, strict=True)]
    parts: list[list[float]] = [[stations[0]]]
    start = headings[0]
    for index in range(1, len(stations)):
        s = stations[index]
        parts[-1].append(s)
        if s < stations[-1] and (abs(headings[index] - start) > math.pi or tight[index] != tight[index - 1]):
            parts.append([s])
            start = headings[index]
    return parts


def _is_tight(road: Road, section: LaneSection, s: float, curvature: float) -> bool:
    """Return whether the outermost lane on the inside of a curve reaches beyond its center."""
    if curvature == 0.0 or not section.lanes:
        return False
    lane = section.lanes[max(section.lanes) if curvature > 0.0 else min(section.lanes)]
    return (road.lane_offset.value(s) + lane.side * lane.outer.value(s - section.s)) * curvature > 1.0


def _edge(road: Road, section: LaneSection, lane: Lane, stations: list[float], *, outer: bool) -> Array:
    """Return points (N, 2) of the inner or outer edge of a lane; both are the center line for lane 0.

    On the inside of a curve no edge is beyond the center of the curve, where it would run backwards: a polygon with
    such an edge overlaps itself, and its fill has holes.
    """
    width = lane.outer if outer else lane.inner
    points = []
    for s in stations:
        x, y, heading, curvature, _ = road.reference.at(s)
        t = road.lane_offset_in(section, s)[0] + lane.side * width.value(s - section.s)
        if t * curvature > 1.0:
            t = 1.0 / curvature
        ahead, left, _ = lateral_axis(road.elevation.value_and_slope(s)[1], road.superelevation.value(s))
        sin, cos = t * math.sin(heading), t * math.cos(heading)
        points.append((x + ahead * cos - left * sin, y + ahead * sin + left * cos))
    return np.array(points)


def _marks(part: _Part, lane: Lane, spacing: float) -> Iterator[tuple[str, str, Array]]:
    """Yield the road marks on the outer edge of a lane."""
    road, section = part.road, part.section
    for index, mark in enumerate(lane.road_marks):
        after = lane.road_marks[index + 1].s_offset if index + 1 < len(lane.road_marks) else section.length
        start = max(section.s + mark.s_offset, part.stations[0])
        end = min(section.s + min(after, section.length), part.stations[-1])
        if mark.type in ("none", "curb", "grass") or end - start < 1e-6:
            continue
        stations = equidistant(start, end, spacing)
        yield mark.type, mark.color, simplify_line(_edge(road, section, lane, stations, outer=True))
