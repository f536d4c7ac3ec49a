"""Lane changes that a route requires: where they are possible, and how urgent they are.

A path changes lanes in one place. The vehicle may do so anywhere as long as both lanes lie beside each other: until it
has changed, its reference line continues in the lane before.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import msgspec
import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.driving.planning.behavior.proposals import Wall, change_length, lane_change_name
from eidrive_scenario.driving.planning.behavior.reference import NARROWEST, ReferenceLine

STRIDE = 2
"""Distance of the points of a path at which its lanes are determined, in points."""
SAME_LANE = NARROWEST / 2.0
"""Distance between the centers of one lane at two such points [m], less than between two lanes."""
OFF_CENTER = 0.1
"""Distance of a path from the center of its lane from which on it changes lanes [m]."""
ROOM = 50.0
"""Length that is kept for each later change between the same lanes [m]."""
BEFORE_WALL = 0.5
"""Distance of a place to wait behind that from which the vehicle may change [m]: it stops centimeters before it."""
DISTANCE, TIME = 295.0, 43.0
"""Distance [m] and time [s] before the end of the lane at which a change becomes desired, by LMRS (Schakel 2012)."""


class RouteLane(NamedTuple):
    """Lane before one of the changes of a path, or that after the last one.

    offsets     distances of its center to the left of the points of the path (M,) [m]
    begin, end  indices of the points between which the vehicle may leave it; the last one after the last change
    last        index of the last point at which it and the next lane lie beside each other
    """

    offsets: Array
    begin: int
    end: int
    last: int


class LaneChange(msgspec.Struct, frozen=True):
    """Change from the lane of the reference line to a neighboring one.

    begin, end  distances along the line between which the vehicle may change [m]
    offset      distance of the center of the other lane to the left at the vehicle [m]
    last        distance at which one of both lanes ends [m]; inf if none does before the end of the line
    """

    begin: float
    end: float
    offset: float
    last: float = math.inf

    @property
    def name(self) -> str:
        """Name of the maneuver."""
        return lane_change_name(self.offset)

    def wall(self, front: float, lateral_acceleration: float) -> Wall | None:
        """Return the place at which the vehicle stops if it finds no gap, with enough space to change from there.

        Without so much space it is before the end of the lane; None if the lane does not end, as beside a destination.

        front  distance of the front from the reference point [m]
        """
        space = front + change_length(self.offset, 0.0, lateral_acceleration)
        s, first = self.end - space, self.begin + BEFORE_WALL
        if s < first:
            s = max(self.last - space, first)
        return Wall(s, np.inf, "wait for a gap before the end of the lane") if s < math.inf else None

    def desire(self, s: float, speed: float) -> float:
        """Return how urgent the change is at a distance along the line [m] and a speed [m/s], in [0, 1]."""
        left = self.end - s
        return min(max(1.0 - left / DISTANCE, 1.0 - left / (TIME * max(speed, 1.0)), 0.0), 1.0)


def route_lanes(line: ReferenceLine) -> list[RouteLane]:
    """Return the lanes of a path in their order; none if it changes no lane.

    line  reference line on the path
    """
    crossings = _crossings(line)
    last = len(line.points) - 1
    before = [_followed(line, index, own) for index, own, _ in crossings]
    after = [_followed(line, index + STRIDE, own) for index, _, own in crossings]
    lanes: list[RouteLane] = []
    limit = last
    for number in range(len(crossings) - 1, -1, -1):
        index = crossings[number][0]
        beside = min(before[number].last, after[number].last)
        beside = beside if beside + STRIDE <= last else last
        end = max(min(beside, limit), index)
        on_path = np.flatnonzero(np.abs(before[number].offsets[:index]) < OFF_CENTER)
        begin = max(int(on_path[-1]) if on_path.size else 0, after[number].first)
        earlier = None if number == 0 else (after[number - 1], crossings[number - 1][0])
        lanes.insert(0, RouteLane(_joined(earlier, before[number], index), min(begin, index), end, beside))
        limit = end - round(ROOM / line.spacing)
    return [*lanes, RouteLane(after[-1].offsets, last, last, last)] if crossings else []


def _joined(earlier: tuple[_Lane, int] | None, lane: _Lane, index: int) -> Array:
    """Return the offsets of a lane that is left at an index, up to where the path is in it those of the lane after the
    earlier change, whose index is given: between both the path may follow other roads."""
    if earlier is None:
        return lane.offsets
    before, change = earlier
    centered = np.flatnonzero(np.abs(before.offsets[change:index]) < OFF_CENTER)
    if not centered.size:
        return lane.offsets
    joint = change + int(centered[0])
    return np.concatenate([before.offsets[:joint], lane.offsets[joint:]])


def _crossings(line: ReferenceLine) -> list[tuple[int, float, float]]:
    """Return the last points of a path in each lane that it leaves for a neighboring one of the same direction, with
    the offsets of the centers of the lane there and of the next one behind [m]."""
    crossings = []
    here = line.lanes_of_direction(0)
    for index in range(STRIDE, len(line.points), STRIDE):
        then = line.lanes_of_direction(index)
        changes = then.key != here.key and then.key[:2] == here.key[:2] and abs(then.own - here.own) > SAME_LANE
        if changes and None not in (_nearest(then.centers, here.own), _nearest(here.centers, then.own)):
            crossings.append((index - STRIDE, here.own, then.own))
        here = then
    return crossings


class _Lane(NamedTuple):
    """Lane along a path: offsets of its center at all points (M,) [m], and its first and last point."""

    offsets: Array
    first: int
    last: int


def _followed(line: ReferenceLine, index: int, center: float) -> _Lane:
    """Return the lane whose center is at an offset at one point; beyond its ends the offset stays the same."""
    offsets = {index: center}
    ends = []
    for step, bound in ((-STRIDE, -1), (STRIDE, len(line.points))):
        here, value = index, center
        for there in range(index + step, bound, step):
            onward = _nearest(line.lanes_of_direction(there).centers, value)
            if onward is None:
                break
            here, value = there, onward
            offsets[here] = value
        ends.append(here)
    at_points = sorted(offsets)
    filled = np.interp(np.arange(len(line.points)), at_points, [offsets[point] for point in at_points])
    return _Lane(filled, *ends)


def _nearest(centers: Sequence[float], offset: float) -> float | None:
    """Return the center of the lane at an offset [m]; None without one."""
    nearest = min(centers, key=lambda center: abs(center - offset), default=None)
    return nearest if nearest is not None and abs(nearest - offset) < SAME_LANE else None
