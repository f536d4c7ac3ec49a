"""Occupants of the lanes of a fleet: its cars, other actors, and the ends of lanes."""

from __future__ import annotations

import numpy as np

from eidrive_scenario.arrays import Array
from eidrive_scenario.traffic.cars import PLANNED, Cars
from eidrive_scenario.traffic.lane_changes import LaneChanges
from eidrive_scenario.traffic.lanes import TrafficLanes
from eidrive_scenario.traffic.leaders import (
    FIXED,
    Leaders,
    Occupants,
    concatenate_occupants,
    find_leaders,
)
from eidrive_scenario.traffic.obstacles import Obstacles
from eidrive_scenario.world.view import WorldView


class Occupancy:
    """Occupancy of the lanes of one fleet."""

    def __init__(self, lanes: TrafficLanes, changes: LaneChanges) -> None:
        self._lanes = lanes
        self._changes = changes
        self._obstacles = Obstacles(lanes)
        row = np.flatnonzero(np.isfinite(lanes.ends_at))
        at = lanes.ends_at[row]
        self._ends = Occupants(row, at, at, at, np.zeros(len(row)), np.full(len(row), FIXED))

    def observe(self, view: WorldView, own: frozenset[str], near: Array | None) -> None:
        """Observe the actors outside the fleet `own`; with positions `near` (K, 2) [m] only those near one of them."""
        self._obstacles.observe(view, own, near)

    @property
    def moving(self) -> set[int]:
        """Lanes that moving actors outside the fleet overlap."""
        return self._obstacles.moving

    def occupants(self, cars: Cars) -> Occupants:
        """Return all occupants: cars (also on lanes that they are leaving), other actors, lane ends."""
        own = np.arange(len(cars))
        still, lane = self._changes.still_left(cars)
        indices, row = np.concatenate([own, still]), np.concatenate([cars.row, lane])
        key = cars.progress[indices]
        mine = Occupants(row, key, key + cars.rear[indices], key + cars.front[indices], cars.speed[indices], indices)
        return concatenate_occupants(mine, self._obstacles.occupants, self._ends)

    def leaders(self, cars: Cars, occupants: Occupants) -> Leaders:
        """Return the leaders of all cars. During a lane change it is the nearer one of both lanes.

        The end of a lane does not stop a car that is leaving this lane, as it leaves only while moving.
        """
        leaders = find_leaders(self._lanes, cars.plan, cars.progress, cars.front, occupants)
        still, lane = self._changes.still_left(cars)
        if still.size:
            chain = self._lanes.chain(lane, PLANNED + 1)
            standing = occupants.without(FIXED)
            other = find_leaders(self._lanes, chain, cars.progress[still], cars.front[still], standing, own=still)
            gap, speed = leaders.gap.copy(), leaders.speed.copy()
            nearer = Leaders(gap[still], speed[still]).or_nearer(other)
            gap[still], speed[still] = nearer.gap, nearer.speed
            leaders = Leaders(gap, speed)
        return Leaders(leaders.gap * self._lanes.stretch(cars.row, cars.progress), leaders.speed)
