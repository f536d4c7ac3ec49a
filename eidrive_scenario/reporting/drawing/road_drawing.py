"""Roads as a drawing: lanes as polygons, markings as lines, seen from above."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from eidrive_scenario.arrays import Array
from eidrive_scenario.errors import Diagnostic, InputError
from eidrive_scenario.recording.recording import Recording
from eidrive_scenario.reporting.drawing.top_view import RoadDrawing, Window
from eidrive_scenario.roads.geometry.poses import lateral_axis
from eidrive_scenario.roads.model.road_map import Lane, LaneSection, Road
from eidrive_scenario.roads.reading.document import parse_road_map

SPACING = 1.0
"""Distance of the points at which edges are computed [m]; those that lie on a straight line are dropped again."""
WIDEST_SPACING = 50.0
"""Maximum of that distance on a large map [m]."""
_MOST_POINTS = 1_500_000
"""Maximum number of points that are computed."""
_LARGEST_ROAD_FILE = 64 * 2**20
"""Maximum size of a road in a recording that is drawn [bytes]."""
TOLERANCE = 0.02
"""How far a drawn line may stray from the edge [m]."""
ROAD_FILE = "road.xodr"
"""Name of the road among a recording's attachments."""

_LOWEST = ("none", "shoulder", "border", "sidewalk", "median")


def road_drawing(roads: Iterable[Road], window: Window | None = None) -> RoadDrawing:
    """The lanes and markings of these roads; of those that reach into `window` if one is given.

    Lanes on which cars drive come last, so that they cover the shoulders of roads that cross them in a junction.
    Edges of a large map are computed at wider distances. Raise InputError if it is too large even so.
    """
    roads = list(roads)
    spacing = _spacing(roads)
    lanes: list[tuple[str, Array]] = []
    markings: list[tuple[str, str, Array]] = []
    for road in roads:
        for section in road.sections:
            if section.length <= 0.0:
                continue
            stations = _stations(section.s, section.end, spacing)
            for lane in section.lanes.values():
                if lane.id != 0:
                    inner = _edge(road, section, lane, stations, outer=False)
                    outer = _edge(road, section, lane, stations, outer=True)
                    polygon = np.concatenate([thinned(inner), thinned(outer)[::-1]])
                    if _reaches(polygon, window):
                        lanes.append((lane.type, polygon))
                markings.extend(mark for mark in _marks(road, section, lane, spacing) if _reaches(mark[2], window))
    lanes.sort(key=lambda entry: _LOWEST.index(entry[0]) if entry[0] in _LOWEST else len(_LOWEST))
    return RoadDrawing(tuple(lanes), tuple(markings))


def recorded_roads(recording: Recording) -> RoadDrawing:
    """The roads that a recording carries along; nothing where it carries none."""
    text = recording.attachments.get(ROAD_FILE)
    if text is None:
        return RoadDrawing()
    if len(text) > _LARGEST_ROAD_FILE:
        raise _too_large(f"{recording.path}/{ROAD_FILE}")
    return road_drawing(parse_road_map(text, f"{recording.path}/{ROAD_FILE}").roads.values())


def thinned(points: Array, tolerance: float = TOLERANCE) -> Array:
    """The points (N, 2) without those that lie within `tolerance` of the line between their kept neighbors
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
            stray = np.abs(along[0] * between[:, 1] - along[1] * between[:, 0]) / length
        else:
            stray = np.hypot(between[:, 0], between[:, 1])
        worst = int(stray.argmax())
        if stray[worst] > tolerance:
            middle = first + 1 + worst
            keep[middle] = True
            open_spans += [(first, middle), (middle, last)]
    return points[keep]


def _spacing(roads: Sequence[Road]) -> float:
    """The distance between points [m] that keeps their number within bounds."""
    length = sum(
        section.length * sum(2 + len(lane.road_marks) for lane in section.lanes.values())
        for road in roads
        for section in road.sections
    )
    spacing = max(SPACING, length / _MOST_POINTS)
    if not spacing <= WIDEST_SPACING:
        raise _too_large("")
    return spacing


def _too_large(source: str) -> InputError:
    return InputError(Diagnostic("the road network is too large to be drawn", "", source))


def _stations(start: float, end: float, spacing: float) -> list[float]:
    """Points along a road, its ends included [m]."""
    found: list[float] = np.linspace(start, end, max(2, math.ceil((end - start) / spacing) + 1)).tolist()
    return found


def _edge(road: Road, section: LaneSection, lane: Lane, stations: list[float], *, outer: bool) -> Array:
    """(N, 2) points of a lane's inner or outer edge; lane 0 has its center line for both."""
    width = lane.outer if outer else lane.inner
    points = []
    for s in stations:
        x, y, heading, _, _ = road.reference.at(s)
        t = road.lane_offset.value(s) + lane.side * width.value(s - section.s)
        ahead, left, _ = lateral_axis(road.elevation.value_and_slope(s)[1], road.superelevation.value(s))
        sin, cos = t * math.sin(heading), t * math.cos(heading)
        points.append((x + ahead * cos - left * sin, y + ahead * sin + left * cos))
    return np.array(points)


def _marks(road: Road, section: LaneSection, lane: Lane, spacing: float) -> Iterator[tuple[str, str, Array]]:
    """The painted stretches on the lane's outer edge."""
    for index, mark in enumerate(lane.road_marks):
        after = lane.road_marks[index + 1].s_offset if index + 1 < len(lane.road_marks) else section.length
        start, end = section.s + mark.s_offset, section.s + min(after, section.length)
        if mark.type in ("none", "curb", "grass") or end - start < 1e-6:
            continue
        stations = _stations(start, end, spacing)
        yield mark.type, mark.color, thinned(_edge(road, section, lane, stations, outer=True))


def _reaches(points: Array, window: Window | None) -> bool:
    if window is None:
        return True
    (left, bottom), (right, top) = points.min(axis=0), points.max(axis=0)
    return bool(left <= window.right and right >= window.left and bottom <= window.top and top >= window.bottom)
