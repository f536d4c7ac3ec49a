"""Requests for passages through junctions, and the order in which they are granted."""

from __future__ import annotations

import numpy as np

from eidrive_scenario.arrays import Array
from eidrive_scenario.traffic.cars import Cars
from eidrive_scenario.traffic.crossings import Crossings
from eidrive_scenario.traffic.lanes import TrafficLanes
from eidrive_scenario.traffic.leaders import LOOK_AHEAD, Leaders
from eidrive_scenario.traffic.stop_lines import STOP_LINE

PATIENCE = 20.0
"""Waiting time after which a car has priority over others at a junction [s]."""


class RightOfWay:
    """First come, first served; `begins` (N, D) are the distances from each car to its planned lanes [m]."""

    def __init__(self, lanes: TrafficLanes, crossings: Crossings) -> None:
        self._lanes = lanes
        self._crossings = crossings

    def take(self, cars: Cars, index: int) -> None:
        """Let a car that is in a junction hold its lane."""
        self._crossings.take(int(cars.plan[index, 0]), cars.specs[index].name)
        cars.granted[index, 0] = True

    def forget(self, name: str) -> None:
        """Remove a car."""
        self._crossings.forget(name)

    def waits(self, cars: Cars, begins: Array) -> Leaders:
        """Return the stop lines of junctions that cars may not enter yet."""
        wait = self._distances(cars, begins) - cars.front - STOP_LINE
        return Leaders(np.maximum(wait, 1e-3), np.zeros(len(cars)))

    def grant_right_of_way(
        self, cars: Cars, leaders: Leaders, lights: Leaders, begins: Array, moving: set[int], time: float
    ) -> None:
        """Grant passages through junctions to approaching cars.

        There must be space behind the junction. Lanes in conflict with one of `moving`, which moving foreign actors
        overlap, are not granted, nor are lanes that delay a car with priority. A car that a traffic light stops before
        the junction loses its passage.
        """
        self._follow(cars, lights, begins)
        distance = self._distances(cars, begins)
        v = cars.speed
        close = distance <= v * v / (2.0 * cars.drivers.deceleration) + cars.front + 4.0 * STOP_LINE + v
        gap = leaders.gap + cars.front
        asking = []
        for index in np.flatnonzero(close & (gap > distance)).tolist():
            passage = self._passage(cars, index)
            behind = distance[index] + self._lanes.length[passage].sum() - cars.rear[index]
            if gap[index] > behind + cars.drivers.standstill_gap[index]:
                if np.isnan(cars.asked[index]):
                    cars.asked[index] = time
                asking.append(
                    (float(cars.asked[index]), float(distance[index]), cars.specs[index].name, index, passage)
                )
        kept_free: set[int] = set()
        for since, _, name, index, passage in sorted(asking):
            if all(self._crossings.free(row, name, moving | kept_free) for row in passage):
                for row in passage:
                    self._crossings.take(row, name)
                cars.granted[index] |= np.isin(cars.plan[index], passage)
                cars.asked[index] = np.nan
            elif time - since > PATIENCE:
                kept_free.update(passage)

    def _follow(self, cars: Cars, lights: Leaders, begins: Array) -> None:
        """Update the progress of cars in junctions, and revoke passages that a traffic light blocks."""
        for index in np.flatnonzero(cars.granted[:, 0]).tolist():
            held = self._crossings.holders[int(cars.plan[index, 0])]
            held[cars.specs[index].name] = float(cars.progress[index] + cars.rear[index])
        ahead = cars.granted.any(axis=1) & ~cars.granted[:, 0] & np.isfinite(lights.gap)
        for index in np.flatnonzero(ahead).tolist():
            if lights.gap[index] + cars.front[index] < begins[index, np.argmax(cars.granted[index])]:
                self._crossings.forget(cars.specs[index].name)
                cars.granted[index] = False

    def _distances(self, cars: Cars, begins: Array) -> Array:
        """Return the distances (N,) to the first junction lane that a car may not enter yet [m], else inf."""
        barred = (cars.plan >= 0) & self._lanes.in_junction[cars.plan] & ~cars.granted & ~cars.walks[:, None]
        barred[:, 0] = False
        distance = np.where(barred, begins, np.inf).min(axis=1)
        return np.where(distance > LOOK_AHEAD, np.inf, distance)

    def _passage(self, cars: Cars, index: int) -> list[int]:
        """Return the lanes of the next junction that a car may not enter yet, up to its last connecting road."""
        lanes = self._lanes
        found: list[int] = []
        for row, granted in zip(cars.plan[index, 1:].tolist(), cars.granted[index, 1:].tolist(), strict=True):
            if row >= 0 and lanes.in_junction[row] and not granted:
                found.append(row)
            elif found:
                return found
        while (ways := lanes.following(found[-1])) and lanes.road[ways[0]] == lanes.road[found[-1]]:
            found.append(ways[0])
        return found
