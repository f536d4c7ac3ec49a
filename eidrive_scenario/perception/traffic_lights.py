"""Traffic lights and stop signs on the path: stop lines, and whether they require a stop."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.geometry import components, segment_distance
from eidrive_scenario.roads import OTHER_LEVEL, LaneKey, RoadNetwork, Signal
from eidrive_scenario.roads.model.road_map import SignalPlace
from eidrive_scenario.roads.model.signal_states import lamp_colors, must_stop, shows_red
from eidrive_scenario.sensing.readings import SignalReading
from eidrive_scenario.sensing.signals import Kind, signal_kind

ON_PATH = 1.75
"""Maximum distance between a path and the lane center at the stop line of the lane [m]."""
AS_NEAR = 0.5
"""Maximum difference of the distances of the end of a path from two connecting roads that may be on any of them [m]."""
APART = 2.0 * ON_PATH
"""Distance from other connecting roads at which a place is only on one of them [m]."""
WAY_POINTS, SAMPLES = 4, 20
"""Numbers of points of the way along a connecting road, and at which its distances from others are measured."""
NEAR_SIDE = 10.0
"""Maximum distance of a light from the entry of its junction, along and across, at which it stands before it [m]."""
SAME_WAY = math.cos(math.radians(45.0))


class StopLine(NamedTuple):
    """Position at which a signal stops the traffic of one lane.

    x, y, z   on the center of the lane [m];  heading  of its traffic [rad]
    way       points from the start of a connecting road to its middle, or to the place farther on that is apart from
              other roads from the same lane: only the routes with this signal pass it, unless they end before it; empty
              if the line alone determines them
    entry     lane at the start of this connecting road; None without one
    """

    signal: str
    kind: Kind
    x: float
    y: float
    z: float
    heading: float
    way: tuple[tuple[float, float], ...]
    entry: LaneKey | None

    @property
    def beyond(self) -> tuple[float, float] | None:
        """Last point of the way, None without one."""
        return self.way[-1] if self.way else None


class SignalAhead(NamedTuple):
    """Signal on the path: the distance to its stop line and the height of that [m], its state, and whether it requires
    a stop.

    `state` is None until the signal has been in sight. A stop sign that has been in sight requires a stop. `is_yellow`
    is True for a light that requires a stop if that is possible, before it shows red.
    """

    signal: str
    kind: Kind
    distance: float
    z: float
    state: str | None
    must_stop: bool
    is_yellow: bool = False


def stop_lines(roads: RoadNetwork, *, with_give_way: bool = False) -> tuple[StopLine, ...]:
    """Return all positions where a traffic light or stop sign of the map stops a lane.

    With `with_give_way` the result includes signs to give way, at which traffic need not stop. Vehicles wait at the
    s coordinate of the signal. For a signal on a connecting road they wait before the junction, and before a light that
    stands right before it, which they could not see any more beside them.
    """
    return tuple(
        line
        for signal in roads.signals.values()
        if (kind := signal_kind(signal)) is not None and (with_give_way or kind != "give way sign")
        for place in (signal.place, *signal.references)
        for line in _lines(roads, signal, kind, place)
    )


class SignalsAhead:
    """Signals along the path of one vehicle, with the state in which they were last in sight."""

    def __init__(self, roads: RoadNetwork | None) -> None:
        self._lines = stop_lines(roads) if roads is not None else ()
        self._colors = {signal.id: lamp_colors(signal) for signal in (roads.signals.values() if roads else ())}
        self._states: dict[str, str] = {}
        self._on_path: list[tuple[float, StopLine]] = []

    def follow(self, path: Array, heights: Array | None = None) -> None:
        """Set the path (M, 2) along which distances count; its heights (M,) [m] select among roads above each other."""
        self._on_path = sorted(places_along(self._lines, path, heights)) if self._lines else []

    def update(self, readings: Iterable[SignalReading]) -> None:
        """Update the states of signals in sight."""
        self._states.update((reading.id, reading.state) for reading in readings)

    def forget(self, signal: str) -> None:
        """Remove the state of a signal."""
        self._states.pop(signal, None)

    def ahead(self, progress: float) -> Iterator[SignalAhead]:
        """Yield the signals whose stop lines are beyond `progress` [m] along the path, the nearest first."""
        for distance, line in self._on_path:
            if distance > progress:
                state = self._states.get(line.signal)
                stop, is_yellow = state is not None, False
                if stop and line.kind == "light":
                    colors = self._colors[line.signal]
                    stop = must_stop(state or "", colors)
                    is_yellow = stop and not shows_red(state or "", colors)
                yield SignalAhead(line.signal, line.kind, distance - progress, line.z, state, stop, is_yellow)


def _lines(roads: RoadNetwork, signal: Signal, kind: Kind, place: SignalPlace) -> Iterator[StopLine]:
    """Yield the stop lines of a signal, or of a reference to it, on the lanes for which it is valid."""
    road = roads.roads.get(place.road)
    if road is None:
        return
    for number in roads.signal_lanes(place):
        direction = roads.driving_direction(road.id, number)
        way: tuple[tuple[float, float], ...] = ()
        entry: LaneKey | None = None
        if road.junction_id is None:
            pose = roads.lane_pose_at(road.id, number, place.s)
        else:
            section = road.section_at(place.s)
            lane = LaneKey(road.id, section.index, number)
            entry = roads.entry_lane(lane)
            if entry is None:
                continue
            begin = section.s if direction > 0 else section.end
            end = _end_of_way(roads, lane, [other for other in roads.alternatives(entry) if other.road != road.id])
            along = roads.lane_pose(road.id, number, np.linspace(begin, end, WAY_POINTS + 1)[1:])
            way = tuple(zip(along.x.tolist(), along.y.tolist(), strict=True))
            pose = roads.lane_pose_at(road.id, entry.lane, 0.0 if direction > 0 else road.length)
        heading = pose.h + (0.0 if direction > 0 else math.pi)
        back = 0.0
        if way:  # a light may stand before the entry of the junction
            light = roads.signal_pose(signal)
            dx, dy = light.x - pose.x, light.y - pose.y
            before = -dx * math.cos(heading) - dy * math.sin(heading)
            aside = abs(dy * math.cos(heading) - dx * math.sin(heading))
            back = before if 0.0 < before < NEAR_SIDE and aside < NEAR_SIDE else 0.0
        x, y = pose.x - back * math.cos(heading), pose.y - back * math.sin(heading)
        yield StopLine(signal.id, kind, x, y, pose.z, heading, way, entry)


def _end_of_way(roads: RoadNetwork, lane: LaneKey, others: Sequence[LaneKey]) -> float:
    """Return the first place in the second half of a lane of a connecting road that is apart from others, or the one
    farthest from them [m along the road]."""
    section = roads.roads[lane.road].sections[lane.section]
    ahead = roads.driving_direction(lane.road, lane.lane) > 0
    places = np.linspace((section.s + section.end) / 2.0, section.end if ahead else section.s, SAMPLES)
    own, apart = roads.lane_pose(lane.road, lane.lane, places), np.full(SAMPLES, math.inf)
    for other in others:
        beside = roads.roads[other.road].sections[other.section]
        along = roads.lane_pose(other.road, other.lane, np.linspace(beside.s, beside.end, 2 * SAMPLES))
        distances = np.hypot(own.x[:, None] - along.x, own.y[:, None] - along.y)
        apart = np.minimum(apart, distances.min(axis=1))
    is_apart = apart >= APART
    return float(places[is_apart.argmax() if is_apart.any() else apart.argmax()])


def places_along(
    lines: Sequence[StopLine], path: Array, heights: Array | None = None
) -> Iterator[tuple[float, StopLine]]:
    """Yield the lines that a path (M, 2) crosses, with the distance along it [m].

    heights  of the path (M,) [m], for roads above each other; None: the roads are level
    """
    step = np.diff(path, axis=0)
    length = np.maximum(np.hypot(step[:, 0], step[:, 1]), 1e-9)
    start = np.concatenate([[0.0], np.cumsum(length)[:-1]])
    ending: list[tuple[float, float, StopLine]] = []
    """Lines at which the path enters the junction in which it ends, with the distance of its end from their ways."""
    for line in lines:
        beyond = [index for index, _ in _passes(path, step, length, *line.beyond)] if line.beyond is not None else []
        passes = [*_passes(path, step, length, line.x, line.y), (len(step), 0.0)]
        for (index, share), (end, _) in pairwise(passes):
            ahead = step[index] / length[index]
            if ahead[0] * math.cos(line.heading) + ahead[1] * math.sin(line.heading) < SAME_WAY:
                continue
            if heights is not None and abs(float(heights[index]) - line.z) > OTHER_LEVEL:
                continue
            distance = float(start[index] + share * length[index])
            if line.beyond is None or any(index <= later < end for later in beyond):
                yield distance, line
            elif end == len(step):
                ending.append((_distance_at_end(path, line), distance, line))
    limit = min(ON_PATH, min((aside for aside, _, _ in ending), default=0.0) + AS_NEAR)
    yield from ((distance, line) for aside, distance, line in ending if aside <= limit)


def _distance_at_end(path: Array, line: StopLine) -> float:
    """Return the distance of the end of a path (M, 2) from the way of a stop line [m]; inf if it ends before the line
    or the line has no way."""
    x, y = path[-1].tolist()
    if not line.way or components(x - line.x, y - line.y, line.heading)[0] <= 0.0:
        return math.inf
    return min(segment_distance(x, y, *a, *b) for a, b in pairwise([(line.x, line.y), *line.way]))


def _passes(path: Array, step: Array, length: Array, x: float, y: float) -> Iterator[tuple[int, float]]:
    """Yield segment and position on it [share] for each passage of a path by a point."""
    dx, dy = x - path[:-1, 0], y - path[:-1, 1]
    share = np.clip((dx * step[:, 0] + dy * step[:, 1]) / length**2, 0.0, 1.0)
    gap = np.hypot(dx - share * step[:, 0], dy - share * step[:, 1])
    changes = np.flatnonzero(np.diff(gap <= ON_PATH, prepend=False, append=False))
    for first, last in changes.reshape(-1, 2).tolist():
        index = first + int(np.argmin(gap[first:last]))
        yield index, float(share[index])
