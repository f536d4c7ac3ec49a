"""Crossings of stop lines of traffic lights and stop signs by a point of an actor."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.geometry import segment_distance
from eidrive_scenario.base.tolerances import EPSILON
from eidrive_scenario.perception.traffic_lights import ON_PATH, SAME_WAY, StopLine, places_along, stop_lines
from eidrive_scenario.roads import OTHER_LEVEL, RoadNetwork
from eidrive_scenario.sensing.signals import Kind

NEAR = 30.0
"""Distance from a point within which stop lines are considered [m]; a step extends it by its length."""
PAST = 10.0
"""Distance driven beyond the point on a route with a signal after which another route has been chosen [m]."""

Point = tuple[float, float]


class Crossing(NamedTuple):
    """Crossing of the stop line of a signal, at a time [s]."""

    signal: str
    time: float


class _Pending(NamedTuple):
    """Crossing of a line that is valid for one route of several: remaining distance to decide it [m]."""

    line: StopLine
    time: float
    left: float


class StopLineCrossings:
    """Crossings of the stop lines of one kind of signal, in the direction of their traffic.

    A line at the entry of a junction that is valid for one connecting road only counts once the point reaches the end
    of its way along that road, with the time at which it crossed the line. It does not count if the point leaves the
    junction backwards over the line.
    """

    def __init__(self, roads: RoadNetwork, kind: Kind) -> None:
        self.lines = tuple(line for line in stop_lines(roads) if line.kind == kind)
        self._positions = np.array([(line.x, line.y) for line in self.lines]).reshape(-1, 2)
        self._pending: list[_Pending] = []
        self._roads = roads
        self._on_route: list[StopLine] = []
        """Lines with a connecting road on the newest route that the actor has not taken yet."""

    def set_route(self, route: Array) -> None:
        """Set the points (M, 3) of the newest route of the actor [m]."""
        segments = list(pairwise(route[:, :2].tolist()))
        self._on_route = [
            line
            for _, line in places_along(self.lines, route[:, :2], route[:, 2])
            # A route that ends before the end of the way does not determine this road
            if line.beyond is not None
            and min(segment_distance(*line.beyond, *begin, *end) for begin, end in segments) <= ON_PATH
        ]

    def interrupt(self) -> None:
        """Forget undecided crossings, after an absence or a teleport."""
        self._pending.clear()

    def near(self, point: Point, reach: float = NEAR, z: float | None = None) -> list[StopLine]:
        """Return the stop lines within a distance of a point in x and y, on the level of a height `z` [m] or on all."""
        if not self.lines:
            return []
        rows = np.flatnonzero(np.abs(self._positions - point).max(axis=1) <= reach)
        lines = [self.lines[row] for row in rows.tolist()]
        return [line for line in lines if z is None or abs(line.z - z) <= OTHER_LEVEL]

    def crossings(
        self, before: Point, now: Point, heading: float, time: float, z: float | None = None
    ) -> list[Crossing]:
        """Return the crossings that are certain now, at most one per signal.

        before, now  position of the point in the previous frame and in this one
        heading, z   of the actor [rad], and its height [m], which selects among lines above each other
        """
        crossings = self._decide(before, now)
        for line in self.near(now, NEAR + math.dist(before, now), z):
            if not crosses(line, before, now, heading):
                continue
            if line.beyond is None:
                crossings.append(Crossing(line.signal, time))
            else:
                left = math.dist(now, line.beyond) + PAST
                self._pending.append(_Pending(line, time, left))
        return list({crossing.signal: crossing for crossing in reversed(crossings)}.values())

    def decide_at_line(self, time: float, is_illegal: Callable[[Crossing], bool]) -> Crossing | None:
        """Return a crossing of this time [s] that is illegal on all connecting roads that the actor may take, or None.

        They are those of its route, otherwise all that continue its lane. A connecting road without a signal is legal.
        The undecided crossings of all these roads are then decided.
        """
        newest = [pending for pending in self._pending if pending.time == time]
        lanes = [pending.line.entry for pending in newest if pending.line.entry is not None]
        entries = {entry for lane in lanes for entry in self._roads.alternatives(lane)}
        if not entries:
            return None
        possible = entries & {line.entry for line in self._on_route} or entries
        illegal = {
            pending.line.entry: crossing
            for pending in self._pending
            if pending.line.entry in possible and is_illegal(crossing := Crossing(pending.line.signal, pending.time))
        }
        if len(illegal) < len(possible):
            return None
        self._pending = [each for each in self._pending if each not in newest and each.line.entry not in entries]
        return max(illegal.values(), key=lambda crossing: crossing.time)

    def _decide(self, before: Point, now: Point) -> list[Crossing]:
        """Return the crossings whose route has become certain; drop those of other routes."""
        crossings: list[Crossing] = []
        kept: list[_Pending] = []
        for pending in self._pending:
            assert pending.line.beyond is not None
            left = pending.left - math.dist(before, now)
            if segment_distance(*pending.line.beyond, *before, *now) <= ON_PATH:
                crossings.append(Crossing(pending.line.signal, pending.time))
            elif left > 0.0 and not crosses(pending.line, now, before, pending.line.heading):
                kept.append(pending._replace(left=left))
        decided = {crossing.signal for crossing in crossings}
        self._on_route = [
            line for line in self._on_route if line.beyond and segment_distance(*line.beyond, *before, *now) > ON_PATH
        ]
        self._pending = [pending for pending in kept if pending.line.signal not in decided]
        return crossings


def crosses(line: StopLine, before: Point, now: Point, heading: float) -> bool:
    """Whether a point passes a stop line within half a lane of its center, in the direction of its traffic.

    A point on the line is before it.
    """
    first, last = along(line, before), along(line, now)
    if not first <= EPSILON < last or math.cos(heading - line.heading) < SAME_WAY:
        return False
    share = (EPSILON - first) / (last - first)
    x, y = before[0] + share * (now[0] - before[0]), before[1] + share * (now[1] - before[1])
    return math.hypot(x - line.x, y - line.y) <= ON_PATH


def along(line: StopLine, point: Point) -> float:
    """Return the distance of a point beyond a stop line, negative before it [m]."""
    return (point[0] - line.x) * math.cos(line.heading) + (point[1] - line.y) * math.sin(line.heading)


def beside(line: StopLine, point: Point) -> float:
    """Return the lateral distance of a point from the center of the lane at a stop line [m]."""
    return abs((point[1] - line.y) * math.cos(line.heading) - (point[0] - line.x) * math.sin(line.heading))
