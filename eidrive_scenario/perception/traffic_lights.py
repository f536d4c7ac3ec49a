"""Traffic lights and stop signs on the way: where to stop for them, and whether they tell to."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from typing import Literal, NamedTuple

import numpy as np

from eidrive_scenario.arrays import Array
from eidrive_scenario.roads import RoadNetwork, Signal
from eidrive_scenario.roads.model.road_map import SignalPlace
from eidrive_scenario.roads.model.signal_states import lamp_colors, must_stop
from eidrive_scenario.sensing.readings import SignalReading
from eidrive_scenario.sensing.signals import is_stop_sign

Kind = Literal["light", "stop sign"]

ON_PATH = 1.75
"""A stop line belongs to a path that passes the middle of its lane at most this far aside [m]."""
SAME_WAY = math.cos(math.radians(45.0))


class StopLine(NamedTuple):
    """Where a signal stops the traffic of one lane.

    x, y      on the middle of the lane [m];  heading  of its traffic [rad]
    beyond    a point that only the ways to which the signal applies pass, where the line alone does not tell
    """

    signal: str
    kind: Kind
    x: float
    y: float
    heading: float
    beyond: tuple[float, float] | None


class SignalAhead(NamedTuple):
    """A signal on the way: the way to its stop line [m], what it shows, and whether that tells to stop.

    `state` is None where nobody has seen it yet. A stop sign always tells to stop.
    """

    signal: str
    kind: Kind
    distance: float
    state: str | None
    must_stop: bool


def stop_lines(roads: RoadNetwork) -> tuple[StopLine, ...]:
    """Every place where a traffic light or stop sign of the map stops a lane.

    Vehicles wait at the signal's s. For one on a connecting road they wait before the junction.
    """
    return tuple(
        line
        for signal in roads.signals.values()
        if signal.dynamic or is_stop_sign(signal)
        for place in (signal.place, *signal.references)
        for line in _lines(roads, signal, place)
    )


class SignalsAhead:
    """The signals along the path of one vehicle. What they show is known from when they were seen last."""

    def __init__(self, roads: RoadNetwork | None) -> None:
        self._lines = stop_lines(roads) if roads is not None else ()
        self._colors = {signal.id: lamp_colors(signal) for signal in (roads.signals.values() if roads else ())}
        self._states: dict[str, str] = {}
        self._on_way: list[tuple[float, StopLine]] = []

    def follow(self, path: Array) -> None:
        """A path (M, 2) is followed from now on; distances count along it."""
        self._on_way = sorted(_along(self._lines, path)) if self._lines else []

    def see(self, readings: Iterable[SignalReading]) -> None:
        """Signals in sight now."""
        self._states.update((reading.id, reading.state) for reading in readings)

    def ahead(self, progress: float) -> Iterator[SignalAhead]:
        """The signals whose stop lines lie beyond `progress` [m] along the path, the nearest first."""
        for place, line in self._on_way:
            if place > progress:
                state = self._states.get(line.signal)
                stop = state is not None
                if stop and line.kind == "light":
                    stop = must_stop(state or "", self._colors[line.signal])
                yield SignalAhead(line.signal, line.kind, place - progress, state, stop)


def _lines(roads: RoadNetwork, signal: Signal, place: SignalPlace) -> Iterator[StopLine]:
    """The stop lines of a signal, or of a reference to it, on the lanes for which it is valid."""
    road = roads.roads.get(place.road)
    if road is None:
        return
    kind: Kind = "light" if signal.dynamic else "stop sign"
    for number, lane in road.section_at(place.s).lanes.items():
        direction = roads.driving_direction(road.id, number) if number else 0
        against = {"+": 1, "-": -1}.get(place.orientation, 0) == -direction
        valid = not place.validity or any(min(pair) <= number <= max(pair) for pair in place.validity)
        if not number or against or not valid or not lane.drivable:
            continue
        beyond = None
        s = place.s
        if road.junction_id is not None:
            middle = roads.lane_pose_at(road.id, number, road.length / 2.0)
            beyond = (middle.x, middle.y)
            s = 0.0 if direction > 0 else road.length
        pose = roads.lane_pose_at(road.id, number, s)
        yield StopLine(signal.id, kind, pose.x, pose.y, pose.h + (0.0 if direction > 0 else math.pi), beyond)


def _along(lines: Sequence[StopLine], path: Array) -> Iterator[tuple[float, StopLine]]:
    """The lines that a path (M, 2) crosses, and where along it [m]."""
    step = np.diff(path, axis=0)
    length = np.maximum(np.hypot(step[:, 0], step[:, 1]), 1e-9)
    start = np.concatenate([[0.0], np.cumsum(length)[:-1]])
    for line in lines:
        beyond = [index for index, _ in _passes(path, step, length, *line.beyond)] if line.beyond is not None else []
        passes = [*_passes(path, step, length, line.x, line.y), (len(step), 0.0)]
        for (index, share), (end, _) in pairwise(passes):
            ahead = step[index] / length[index]
            if ahead[0] * math.cos(line.heading) + ahead[1] * math.sin(line.heading) < SAME_WAY:
                continue
            if line.beyond is not None and not any(index <= later < end for later in beyond):
                continue
            yield float(start[index] + share * length[index]), line


def _passes(path: Array, step: Array, length: Array, x: float, y: float) -> Iterator[tuple[int, float]]:
    """Where a path comes by a point, each time: the segment nearest to it, and the place on that [share]."""
    dx, dy = x - path[:-1, 0], y - path[:-1, 1]
    share = np.clip((dx * step[:, 0] + dy * step[:, 1]) / length**2, 0.0, 1.0)
    gap = np.hypot(dx - share * step[:, 0], dy - share * step[:, 1])
    changes = np.flatnonzero(np.diff(gap <= ON_PATH, prepend=False, append=False))
    for first, last in changes.reshape(-1, 2).tolist():
        index = first + int(np.argmin(gap[first:last]))
        yield index, float(share[index])
