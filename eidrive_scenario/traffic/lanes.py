"""The lanes of a road network as traffic sees them: rows with a length, a direction, ways on and a speed for bends."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.roads import LaneLocation, RoadNetwork

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

FREE = 13.9
"""Desired speed where the map gives no limit [m/s]."""
SAMPLE = 5.0
"""Distance between the places at which a lane's curvature is looked at [m]."""


class TrafficLanes:
    """Lanes by the running numbers of `RoadNetwork.tables`; progress u runs from 0 to `length` in driving direction."""

    def __init__(self, roads: RoadNetwork) -> None:
        self.roads = roads
        self.tables = tables = roads.tables
        section = tables.lane_section
        self.road = tables.section_road[section]
        self.length = tables.section_length[section]
        self.row = dict(tables.lane_keys())
        self.keys = list(self.row)
        self.direction = np.array([roads.driving_direction(key.road, key.lane) for key in self.keys], dtype=np.int64)
        start = tables.section_start[section]
        self._origin = np.where(self.direction > 0, start, start + self.length)
        self.in_junction = np.array([roads.roads[key.road].junction_id is not None for key in self.keys])
        self.lengths: list[float] = self.length.tolist()
        self._bends: dict[int, float] = {}
        self._limits: dict[int, float] = {}

    def s(self, row: Integers, progress: Array) -> Array:
        """s of the road at a progress along lanes."""
        return self._origin[row] + self.direction[row] * progress

    def progress(self, row: Integers, s: Array) -> Array:
        """The progress at which lanes pass an s of their road."""
        return (s - self._origin[row]) * self.direction[row]

    def of(self, location: LaneLocation) -> tuple[int, float]:
        """Row and progress of a place."""
        index = np.array([self.tables.index[location.road]])
        s = np.array([location.s])
        row = self.tables.lane_row(index, s, np.array([location.lane]))
        return int(row[0]), float(self.progress(row, s)[0])

    def following(self, row: int) -> list[int]:
        """The lanes that traffic may enter at the end of a lane, in the order of the map."""
        key = self.keys[row]
        if key not in self.roads.graph:
            return []
        ways = self.roads.graph[key].items()
        return [self.row[other] for other, edge in ways if edge["kind"] == "successor"]

    def stretch(self, row: Integers, progress: Array) -> Array:
        """Metres of path per metre of progress, at the lanes' centre lines."""
        return self.tables.stretch(row, self.s(row, progress))

    def bend_speed(self, row: int, lateral: float) -> float:
        """The speed at which the sharpest bend of a lane asks for a lateral acceleration [m/s]."""
        tightest = self._bends.get(row)
        if tightest is None:
            count = max(math.ceil(self.length[row] / SAMPLE), 1) + 1
            rows = np.full(count, row)
            s = self.s(rows, np.linspace(0.0, self.length[row], count))
            t, _ = self.tables.lane_t(rows, s)
            _, _, _, curvature, _ = self.tables.curves.at(self.road[rows], s)
            tightest = float(np.max(np.abs(curvature) / np.maximum(np.abs(1.0 - curvature * t), 0.05)))
            self._bends[row] = tightest
        return math.sqrt(lateral / tightest) if tightest > 1e-6 else math.inf

    def limit(self, row: int, progress: float) -> float:
        """The speed limit of a lane [m/s]."""
        known = self._limits.get(row)
        if known is not None:
            return known
        key = self.keys[row]
        road = self.roads.roads[key.road]
        s = float(self.s(np.array([row]), np.array([progress]))[0])
        limit = self.roads.speed_limit(key.road, s, key.lane)
        found = FREE if limit is None or math.isinf(limit) else limit
        if len(road.types) < 2 and len(road.sections[key.section].lanes[key.lane].speeds) < 2:
            self._limits[row] = found
        return found
