"""Planned lanes of cars, with branches selected by random numbers of each car."""

from __future__ import annotations

import numpy as np

from eidrive_scenario.arrays import Array
from eidrive_scenario.randomness import generator
from eidrive_scenario.traffic.cars import PLANNED, Cars
from eidrive_scenario.traffic.crossings import Crossings
from eidrive_scenario.traffic.lanes import FREE, TrafficLanes
from eidrive_scenario.traffic.leaders import LOOK_AHEAD


class Plans:
    """Plans of all cars up to the distance of a leader."""

    def __init__(self, lanes: TrafficLanes, crossings: Crossings, seed: int) -> None:
        self._lanes = lanes
        self._crossings = crossings
        self._seed = seed

    def extend(self, cars: Cars, index: int) -> None:
        """Extend the plan of a car. Lanes of a junction that it holds already are granted."""
        lengths, name = self._lanes.lengths, cars.specs[index].name
        plan = [row for row in cars.plan[index].tolist() if row >= 0]
        ahead = sum(lengths[row] for row in plan[1:])
        while ahead < LOOK_AHEAD and len(plan) <= PLANNED:
            choices = self._lanes.following(plan[-1])
            if not choices:
                break
            pick = 0
            if len(choices) > 1:
                turn = int(cars.turns[index])
                pick = int(generator(self._seed, "traffic", name, turn).integers(len(choices)))
                cars.turns[index] += 1
            cars.plan[index, len(plan)] = choices[pick]
            cars.granted[index, len(plan)] = self._crossings.holds(name, choices[pick])
            plan.append(choices[pick])
            ahead += lengths[choices[pick]]

    def pass_ends(self, cars: Cars) -> list[str]:
        """Move cars at the end of their lane to the next one. Return the cars without a next lane."""
        lanes = self._lanes
        gone = []
        for index in np.flatnonzero(cars.progress >= lanes.length[cars.row]).tolist():
            name = cars.specs[index].name
            while cars.progress[index] >= lanes.length[cars.plan[index, 0]]:
                if cars.plan[index, 1] < 0:
                    gone.append(name)
                    break
                left, entered = int(cars.plan[index, 0]), int(cars.plan[index, 1])
                beyond = float(cars.progress[index] - lanes.length[left])
                scale = lanes.stretch(np.array([left, entered]), np.array([lanes.lengths[left], 0.0]))
                cars.progress[index] = beyond * float(scale[0] / scale[1])
                if cars.granted[index, 0]:
                    self._crossings.release(name, left)
                cars.plan[index] = np.append(cars.plan[index, 1:], -1)
                cars.granted[index] = np.append(cars.granted[index, 1:], False)
                self.extend(cars, index)
        return gone

    def desired_speeds(self, cars: Cars, begins: Array) -> Array:
        """Return the desired speeds (N,) [m/s], reduced ahead of bends for comfortable braking.

        begins  (N, D) distances from each car to the starts of its planned lanes [m]
        """
        limit = self._lanes.limits(cars.row, cars.progress) * cars.factor
        desired = np.where(
            np.isfinite(limit), limit, np.where(np.isinf(limit), np.maximum(FREE, cars.fallback), cars.fallback)
        )
        desired = np.minimum(np.where(np.isnan(cars.own_speed), desired, cars.own_speed), cars.top_speed)
        seen = (cars.plan >= 0) & (begins <= LOOK_AHEAD)
        bend = self._lanes.tightest(np.where(seen, cars.plan, cars.row[:, None]))
        square = cars.drivers.lateral_acceleration[:, None] / np.maximum(bend, 1e-6)
        square = square + 2.0 * cars.drivers.deceleration[:, None] * np.maximum(begins, 0.0)
        slowest = np.sqrt(np.where(seen, square, np.inf).min(axis=1))
        return np.asarray(np.minimum(desired, slowest))
