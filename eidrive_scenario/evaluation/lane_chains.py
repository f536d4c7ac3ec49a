"""Lanes ahead of an actor up to a fork, with distances along their centers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from eidrive_scenario.arrays import Array
from eidrive_scenario.roads import LaneKey, LaneLocation, RoadNetwork
from eidrive_scenario.roads.geometry.poses import lane_t

SPACING = 1.0
"""Distance of the sample points of a lane along the reference line [m]."""


class RoadOfChain(NamedTuple):
    """Road of a chain of lanes.

    start      distance of its start from that of the first road, along the reference lines [m]
    direction  direction in s, 1 or -1
    length     of the road [m]
    lanes      lane of the chain by section index
    """

    start: float
    direction: int
    length: float
    lanes: Mapping[int, int]

    def along(self, s: float) -> float:
        """Return the distance of s from the start of the first road, along the reference lines [m]."""
        return self.start + (s if self.direction > 0 else self.length - s)


class LaneChain(NamedTuple):
    """Lanes ahead up to a fork, from the start of the first road on.

    roads      roads by number, in order
    length     of the roads along their reference lines [m]
    along      (N,) distances of sample points along the reference lines [m]
    distances  (N,) distances of the sample points along the centers of the lanes [m]
    points     (N, 2) centers of the lanes [m]
    """

    roads: Mapping[str, RoadOfChain]
    length: float
    along: Array
    distances: Array
    points: Array

    def distance(self, along: float) -> float:
        """Return the distance along the centers of the lanes of a distance along the reference lines [m]."""
        return float(np.interp(along, self.along, self.distances))


class LaneChains:
    """Chains of lanes of a road network, of about `reach` meters beyond the first road, computed when needed."""

    def __init__(self, roads: RoadNetwork, reach: float) -> None:
        self._roads = roads
        self._reach = reach
        self._chains: dict[tuple[LaneKey, int], LaneChain] = {}

    def chain(self, place: LaneLocation, direction: int) -> LaneChain:
        """Return the chain of the lane of an actor that moves in a direction of s."""
        road = self._roads.roads[place.road]
        key = LaneKey(place.road, road.section_at(place.s).index, place.lane)
        known = self._chains.get((key, direction))
        if known is None:
            known = self._chains[key, direction] = self._build(key, direction)
        return known

    def center(self, chain: RoadOfChain, number: str, s: float) -> float:
        """Return t of the center of the chain on one of its roads [m]; beyond its lanes that of the end of the last."""
        road = self._roads.roads[number]
        section = road.section_at(s)
        if section.index not in chain.lanes:
            section = road.sections[min(chain.lanes, key=lambda known: abs(known - section.index))]
            s = min(max(s, section.s), section.end)
        return lane_t(road, section, section.lanes[chain.lanes[section.index]], s)[0]

    def _build(self, key: LaneKey, direction: int) -> LaneChain:
        first = self._roads.roads[key.road]
        lanes = {key.road: {key.section: key.lane}}
        places = {key.road: (0.0, direction, first.length)}
        behind: LaneKey | None = key
        while behind is not None:  # the lanes before the actor on its road
            behind = self._next_section(behind, -direction)
            if behind is not None:
                lanes[key.road][behind.section] = behind.lane
        length, way, last = first.length, direction, key
        while length - first.length <= self._reach:
            following = self._next_section(last, way)
            if following is None:
                ways = list(self._roads.links.beyond(last, way))
                if len(ways) != 1 or ways[0][0].road in places:
                    break
                following, way = ways[0]
                road = self._roads.roads[following.road]
                places[following.road], lanes[following.road] = (length, way, road.length), {}
                length += road.length
            lanes[following.road][following.section] = following.lane
            last = following
        roads = {number: RoadOfChain(*place, lanes[number]) for number, place in places.items()}
        return LaneChain(roads, length, *self._sample(roads))

    def _next_section(self, key: LaneKey, direction: int) -> LaneKey | None:
        """Return the lane in the next section of the road: of several, the one with the nearest center."""
        here = [lane for lane, _ in self._roads.links.beyond(key, direction) if lane.road == key.road]
        here = [lane for lane in here if lane.section == key.section + direction]
        if len(here) <= 1:
            return here[0] if here else None
        section = self._roads.roads[key.road].sections[key.section]
        s = section.end if direction > 0 else section.s
        tables = self._roads.tables
        rows = np.array([tables.row_of(lane) for lane in (key, *here)])
        centers, _ = tables.lane_t(rows, np.full(len(rows), s))
        return here[int(np.abs(centers[1:] - centers[0]).argmin())]

    def _sample(self, roads: Mapping[str, RoadOfChain]) -> tuple[Array, Array, Array]:
        """Return distances along the reference lines and along the lanes (N,), and points (N, 2)."""
        tables = self._roads.tables
        along, rows, places = [], [], []
        for number, road in roads.items():
            count = max(int(np.ceil(road.length / SPACING)), 1)
            s = np.linspace(0.0, road.length, count + 1)[:: road.direction]
            along.append(road.start + np.linspace(0.0, road.length, count + 1))
            sections = self._roads.roads[number].sections
            keys = [LaneKey(number, section.index, self._lane_of(number, section.index, road)) for section in sections]
            borders = np.array([section.s for section in sections[1:]])
            rows.append(np.array([tables.row_of(key) for key in keys])[np.searchsorted(borders, s, side="right")])
            places.append(s)
        at_row, at_s = np.concatenate(rows), np.concatenate(places)
        poses = tables.lane_poses(at_row, at_s, np.zeros(len(at_s)))
        points = np.column_stack([poses.x, poses.y])
        steps = np.hypot(*np.diff(points, axis=0).T)
        ahead = np.diff(np.concatenate(along))
        # Between roads and sections, centers of lanes may be apart.
        steps = np.where((ahead <= 0.0) | (np.diff(at_row) != 0), ahead, steps)
        return np.concatenate(along), np.concatenate([[0.0], np.cumsum(steps)]), points

    def _lane_of(self, number: str, index: int, road: RoadOfChain) -> int:
        """Return the lane of the chain in a section, or the one nearest to its lanes in number."""
        if index in road.lanes:
            return road.lanes[index]
        near = road.lanes[min(road.lanes, key=lambda known: abs(known - index))]
        numbers = [lane for lane in self._roads.roads[number].sections[index].lanes if lane]
        same = [lane for lane in numbers if (lane > 0) == (near > 0)] or numbers
        return min(same, key=lambda lane: abs(lane - near))
