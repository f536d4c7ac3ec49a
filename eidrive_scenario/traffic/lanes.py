"""Lanes of a road network for traffic, by their running numbers: length, direction, successors and speed in bends."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from eidrive_scenario.base.arrays import Array, Bools, Integers
from eidrive_scenario.roads import LaneLocation, RoadNetwork
from eidrive_scenario.roads.model.location import LaneKey
from eidrive_scenario.traffic.cars import PLANNED

FREE = 13.9
"""Default desired speed on lanes without a limit [m/s]."""
SAMPLE = 5.0
"""Distance between the samples of the curvature of a lane [m]."""
NARROWEST = 2.2
"""Minimum width of a lane for cars [m]."""
WALKABLE = frozenset(("sidewalk", "walking"))
"""Lane types for pedestrians."""


class TrafficLanes:
    """Lanes by the running numbers of `RoadNetwork.tables`; progress u runs from 0 to `length` in driving direction.

    left, right                neighbor of the same direction to which a marking permits a change, -1 if there is none
    beside_left, beside_right  neighbor of the same direction with any marking
    following                  successors with the same kind of users, in the order of the map
    onward, backward           first successor and first predecessor, -1 if there is none
    ends_at                    progress at which a lane ends, merges or narrows beside another lane, else inf
    """

    def __init__(self, roads: RoadNetwork) -> None:
        self.roads = roads
        self.tables = tables = roads.tables
        section = tables.lane_section
        self.road = tables.section_road[section]
        self.length = tables.section_length[section]
        self.keys, self.row_of = tables.lane_keys, tables.row_of
        self.direction = np.array([roads.driving_direction(key.road, key.lane) for key in self.keys], dtype=np.int64)
        start = tables.section_start[section]
        self._origin = np.where(self.direction > 0, start, start + self.length)
        self.in_junction = np.array([roads.roads[key.road].junction_id is not None for key in self.keys])
        self.lengths: list[float] = self.length.tolist()
        self.walkable = np.array([lane.type in WALKABLE for lane in tables.lanes])
        self.left_hand = np.array([roads.roads[key.road].rule == "LHT" for key in self.keys])
        self.onward = np.full(len(self.keys), -1)
        self.backward = np.full(len(self.keys), -1)
        self.following: list[list[int]] = []
        self._link()
        self.left, self.right, self.beside_left, self.beside_right = (np.full(len(self.keys), -1) for _ in range(4))
        self._solid: dict[tuple[int, int], list[tuple[float, float]]] = {}
        """Begin and end [m] of the stretches where a marking forbids changes from a lane to a neighbor."""
        self._join_neighbors()
        self.ends_at = np.full(len(self.keys), np.inf)
        self._find_ends()
        self._tightest = np.full(len(self.keys), np.nan)
        self._limit = np.full(len(self.keys), np.nan)
        """Speed limits: NaN if not determined yet, -1 if the map gives none."""
        pairs = zip(self.keys, tables.lanes, strict=True)
        self._varying = np.array([len(roads.roads[key.road].types) > 1 or len(lane.speeds) > 1 for key, lane in pairs])
        """Whether the limit of a lane may change along it."""

    def _link(self) -> None:
        """Store successors by the graph: driving lanes lead to driving lanes, sidewalks to sidewalks."""
        graph, drivable = self.roads.graph, self.tables.lane_drivable
        for lane, key in enumerate(self.keys):
            ways = graph[key].items() if key in graph else ()
            successors = [
                other
                for way, edge in ways
                if edge["kind"] == "successor"
                and (drivable[lane], self.walkable[lane]) == (drivable[other := self.row_of(way)], self.walkable[other])
            ]
            self.following.append(successors)
            if successors:
                self.onward[lane] = successors[0]
            for other in successors:
                if self.backward[other] < 0:
                    self.backward[other] = lane

    def _join_neighbors(self) -> None:
        for road in self.tables.roads:
            if road.junction_id is not None:
                continue
            for section in road.sections:
                # A lane without a width separates no others.
                numbers = [number for number, lane in section.lanes.items() if number and not lane.width.is_zero]
                neighbors = [self.row_of(LaneKey(road.id, section.index, number)) for number in numbers]
                for left, right in pairwise(neighbors):
                    same = self.direction[left] == self.direction[right]
                    if not (same and self.tables.lane_drivable[left] and self.tables.lane_drivable[right]):
                        continue
                    to_right, to_left = self._forbidden(left, right)
                    if self.direction[left] < 0:
                        left, right, to_right, to_left = right, left, to_left, to_right
                    self.beside_right[left], self.beside_left[right] = right, left
                    changes = (left, right, self.right, to_right), (right, left, self.left, to_left)
                    for lane, other, side, solid in changes:
                        if sum(end - begin for begin, end in solid) < self.lengths[lane]:
                            side[lane] = other
                            self._solid[lane, other] = solid

    def _forbidden(self, left: int, right: int) -> tuple[list[tuple[float, float]], list[tuple[float, float]]]:
        """Return the stretches where a marking forbids changes from lane `left` to lane `right` at its right, and back.

        It is the marking on the outer edge of the lane nearer to lane 0. `increase` permits changes to the higher id.
        """
        numbers = self.keys[left].lane, self.keys[right].lane
        between = self.tables.roads[self.road[left]].sections[self.keys[left].section].lanes
        edge = 0 if numbers[0] > 0 > numbers[1] else min(numbers, key=abs)
        marks, length = between[edge].road_marks, self.lengths[left]
        to_right: list[tuple[float, float]] = []
        to_left: list[tuple[float, float]] = []
        for mark, end in zip(marks, [*(mark.s_offset for mark in marks[1:]), length], strict=False):
            ends = min(max(mark.s_offset, 0.0), length), min(max(end, 0.0), length)
            stretch = ends if self.direction[left] > 0 else (length - ends[1], length - ends[0])
            to_right += [stretch] if mark.lane_change in ("increase", "none") else []
            to_left += [stretch] if mark.lane_change in ("decrease", "none") else []
        return to_right, to_left

    def may_cross(self, lane: Integers, other: Integers, progress: Array, length: Array) -> Bools:
        """Return whether markings permit changes from lanes to neighbors (N,) everywhere over a length (N,) [m]."""
        cases = zip(lane.tolist(), other.tolist(), progress.tolist(), (progress + length).tolist(), strict=True)
        permitted = [
            not any(begin < last and first < end for begin, end in self._solid[before, after])
            for before, after, first, last in cases
        ]
        return np.array(permitted, dtype=bool)

    def _find_ends(self) -> None:
        """Store the ends of lanes beside others: where they become too narrow, where they merge into the successor of a
        wider lane, and where only the other lane has a successor. Cars leave them before.
        """
        width = self.width(np.arange(len(self.keys)), self.length)
        for lane in np.flatnonzero(self.tables.lane_drivable & ~self.in_junction):
            way = self.onward[lane]
            beside = [int(other) for other in (self.beside_left[lane], self.beside_right[lane]) if other >= 0]
            progress = np.linspace(0.0, self.length[lane], max(math.ceil(self.length[lane] / SAMPLE), 1) + 1)
            wide = self.width(np.full(len(progress), lane), progress) >= NARROWEST
            narrows = progress[np.logical_or.accumulate(wide) & ~wide]
            if beside and narrows.size:
                self.ends_at[lane] = narrows[0]
            elif any(
                (way < 0 <= self.onward[other]) or (0 <= way == self.onward[other] and width[lane] < width[other])
                for other in beside
            ):
                self.ends_at[lane] = self.length[lane]

    def s(self, lane: Integers, progress: Array) -> Array:
        """Return s of the road at a progress along lanes."""
        return self._origin[lane] + self.direction[lane] * progress

    def progress(self, lane: Integers, s: Array) -> Array:
        """Return the progress at which lanes pass an s of their road."""
        return (s - self._origin[lane]) * self.direction[lane]

    def width(self, lane: Integers, progress: Array) -> Array:
        """Return the width of lanes at a progress [m]."""
        ds = self.s(lane, progress) - self.tables.section_start[self.tables.lane_section[lane]]
        return self.tables.width.value(lane, ds)

    def apart(self, lane: Integers, other: Integers, progress: Array) -> Array:
        """Return the distance of the center of `other` from that of `lane` [m], left of the driving direction positive.

        Both are lanes of one section.
        """
        s = self.s(lane, progress)
        return (self.tables.lane_t(other, s)[0] - self.tables.lane_t(lane, s)[0]) * self.direction[lane]

    def of(self, location: LaneLocation) -> tuple[int, float]:
        """Return lane and progress of a location."""
        index = np.array([self.tables.index[location.road]])
        s = np.array([location.s])
        lane = self.tables.lane_row(index, s, np.array([location.lane]))
        return int(lane[0]), float(self.progress(lane, s)[0])

    def chain(self, lane: Integers, depth: int) -> Integers:
        """Return consecutive lanes (N, depth) from lanes (N,) on along first branches; -1 beyond an end."""
        chain = np.full((len(lane), depth), -1)
        chain[:, 0] = lane
        for d in range(1, depth):
            before = chain[:, d - 1]
            chain[:, d] = np.where(before >= 0, self.onward[before], -1)
        return chain

    def to_junction(self, lane: Integers, progress: Array) -> Array:
        """Return the distances (N,) to the next junction along first branches [m], inf beyond `PLANNED` lanes."""
        chain = self.chain(lane, PLANNED + 1)
        lengths = np.where(chain >= 0, self.length[chain], 0.0)
        begins = np.cumsum(lengths, axis=1) - lengths - progress[:, None]
        return np.asarray(np.where((chain >= 0) & self.in_junction[chain] & (begins > 0.0), begins, np.inf).min(axis=1))

    def stretch(self, lane: Integers, progress: Array) -> Array:
        """Return the path length per meter of progress at the center lines of lanes."""
        return self.tables.stretch(lane, self.s(lane, progress))

    def tightest(self, lane: Integers) -> Array:
        """Return the maximum curvature of lanes [1/m] of lanes in an array of any shape."""
        curvatures = self._tightest[lane]
        if np.isnan(curvatures).any():
            for fresh in np.unique(lane[np.isnan(curvatures)]).tolist():
                count = max(math.ceil(self.length[fresh] / SAMPLE), 1) + 1
                same = np.full(count, fresh)
                s = self.s(same, np.linspace(0.0, self.length[fresh], count))
                t, _ = self.tables.lane_t(same, s)
                _, _, _, curvature, _ = self.tables.curves.at(self.road[same], s)
                self._tightest[fresh] = np.max(np.abs(curvature) / np.maximum(np.abs(1.0 - curvature * t), 0.05))
            curvatures = self._tightest[lane]
        return curvatures

    def limits(self, lane: Integers, progress: Array) -> Array:
        """Return the speed limits at positions (N,) [m/s]; NaN if the map gives none, inf for `no limit`."""
        limits = self._limit[lane]
        for n in np.flatnonzero(np.isnan(limits) | self._varying[lane]):
            key = self.keys[lane[n]]
            s = float(self.s(lane[n], progress[n]))
            limit = self.roads.speed_limit(key.road, min(max(s, 0.0), self.roads.roads[key.road].length), key.lane)
            limits[n] = -1.0 if limit is None else limit
            if not self._varying[lane[n]]:
                self._limit[lane[n]] = limits[n]
        return np.where(limits < 0.0, np.nan, limits)
