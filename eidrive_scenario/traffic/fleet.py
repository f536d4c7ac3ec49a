"""Background traffic: cars that follow their lanes and each other, and stop for whatever stands in their way."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.randomness import generator
from eidrive_scenario.roads import LaneLocation, RoadNetwork
from eidrive_scenario.traffic.crossings import Crossings
from eidrive_scenario.traffic.idm import IntelligentDriver, ballistic
from eidrive_scenario.traffic.lanes import TrafficLanes
from eidrive_scenario.traffic.leaders import LOOK_AHEAD, Leaders, Occupants, find_leaders, obstacles, together
from eidrive_scenario.world.actor import ActorSpec, Placement
from eidrive_scenario.world.view import WorldView

Array = NDArray[np.float64]

STOP_LINE = 1.0
"""A car that waits for a junction stops this far before it [m]."""
ROLLING = 2.0
"""A leader at this speed clears the space behind a junction by itself [m/s]."""
PLANNED = 8
"""Most lanes that a car knows ahead of itself."""


@dataclass
class _Car:
    spec: ActorSpec
    plan: list[int]
    desired_speed: float | None
    turns: int = 0
    granted: set[int] = field(default_factory=set)

    @property
    def front(self) -> float:
        return self.spec.offset[0] + 0.5 * self.spec.size[0]

    @property
    def rear(self) -> float:
        return self.spec.offset[0] - 0.5 * self.spec.size[0]


class Fleet:
    """Cars on the lanes of a road network.

    Each follows the lane's centre with the Intelligent Driver Model, slows down for bends, takes a branch at a fork by
    its own stream of random numbers (seed, name), and enters a junction only when the lanes that it meets are free.
    Lane changes are none of its business. A car that reaches the end of the lanes leaves: `departed` names it.
    """

    def __init__(self, roads: RoadNetwork, *, seed: int = 0, driver: IntelligentDriver | None = None) -> None:
        self.driver = driver or IntelligentDriver()
        self.departed: frozenset[str] = frozenset()
        self._seed = seed
        self._lanes = TrafficLanes(roads)
        self._crossings = Crossings(self._lanes)
        self._cars: dict[str, _Car] = {}
        self._progress: Array = np.empty(0)
        self._speed: Array = np.empty(0)

    @property
    def names(self) -> tuple[str, ...]:
        """The cars, in the order in which they were added."""
        return tuple(self._cars)

    @property
    def speeds(self) -> Mapping[str, float]:
        """Speed of each car [m/s]."""
        return dict(zip(self._cars, self._speed.tolist(), strict=True))

    def add(
        self, spec: ActorSpec, location: LaneLocation, *, speed: float = 0.0, desired_speed: float | None = None
    ) -> Placement:
        """Bring a car in at a lane's centre line; without a desired speed it drives at the limit.

        Raises PositionError for a lane that does not exist, ValueError for a name that is taken.
        """
        if spec.name in self._cars:
            raise ValueError(f"car {spec.name!r} is in the fleet already")
        row, progress = self._lanes.of(location)
        car = _Car(spec, [row], desired_speed)
        self._cars[spec.name] = car
        self._progress = np.append(self._progress, progress)
        self._speed = np.append(self._speed, speed)
        if self._lanes.in_junction[row]:
            self._grant(car, row)
        self._extend(car)
        return replace(self.placements()[spec.name], teleport=True)

    def remove(self, name: str) -> None:
        """Take a car out."""
        index = list(self._cars).index(name)
        del self._cars[name]
        self._crossings.forget(name)
        self._progress = np.delete(self._progress, index)
        self._speed = np.delete(self._speed, index)

    def placements(self) -> dict[str, Placement]:
        """Where the cars are now."""
        if not self._cars:
            return {}
        row = np.array([car.plan[0] for car in self._cars.values()])
        poses = self._lanes.tables.lane_poses(row, self._lanes.s(row, self._progress), np.zeros(len(row)))
        sign = self._lanes.direction[row]
        yaw = poses.h + np.where(sign > 0, 0.0, math.pi)
        columns = (poses.x, poses.y, poses.z, yaw, poses.p * sign, poses.r * sign, self._speed)
        rows = zip(*(column.tolist() for column in columns), strict=True)
        return {
            name: Placement(x, y, z, yaw=h, pitch=p, roll=r, speed=v)
            for name, (x, y, z, h, p, r, v) in zip(self._cars, rows, strict=True)
        }

    def step(self, view: WorldView | None, dt: float) -> dict[str, Placement]:
        """Drive on by dt; whatever in `view` is not of the fleet is an obstacle. Returns where the cars are then.

        Cars that left in this step are in `departed` and no more in the result.
        """
        self.departed = frozenset()
        if not self._cars:
            return {}
        others, moving = (None, set()) if view is None else obstacles(self._lanes, view, frozenset(self._cars))
        ahead = self._leaders(others)
        self._update_crossings(ahead, moving)
        leaders = self._halted(ahead)
        acceleration = self.driver.response(
            self._speed, self._desired_speeds(), leaders.gap, self._speed - leaders.speed
        )
        covered, self._speed = ballistic(self._speed, acceleration, dt)
        row = np.array([car.plan[0] for car in self._cars.values()])
        self._progress = self._progress + covered / self._lanes.stretch(row, self._progress)
        self._pass_ends()
        return self.placements()

    def _leaders(self, others: Occupants | None) -> Leaders:
        cars = list(self._cars.values())
        row = np.array([car.plan[0] for car in cars])
        front, rear = np.array([car.front for car in cars]), np.array([car.rear for car in cars])
        occupants = Occupants(row, self._progress, self._progress + rear, self._speed, np.arange(len(cars)))
        if others is not None:
            occupants = together(occupants, others)
        plans = np.full((len(cars), PLANNED + 1), -1)
        for index, car in enumerate(cars):
            plans[index, : len(car.plan)] = car.plan[: PLANNED + 1]
        leaders = find_leaders(self._lanes, plans, self._progress, front, occupants)
        return Leaders(leaders.gap * self._lanes.stretch(row, self._progress), leaders.speed)

    def _halted(self, leaders: Leaders) -> Leaders:
        """The leaders, or the stop line of a junction that a car may not enter yet where that is nearer."""
        gap, speed = leaders.gap.copy(), leaders.speed.copy()
        for index, car in enumerate(self._cars.values()):
            wait = self._distance_to_wait(car, float(self._progress[index])) - car.front - STOP_LINE
            if wait < gap[index]:
                gap[index], speed[index] = max(wait, 1e-3), 0.0
        return Leaders(gap, speed)

    def _distance_to_wait(self, car: _Car, progress: float) -> float:
        """Metres to the first junction lane ahead that the car may not enter yet, inf if there is none in sight."""
        distance = -progress
        for row, following in zip(car.plan, car.plan[1:], strict=False):
            distance += self._lanes.lengths[row]
            if distance > LOOK_AHEAD:
                break
            if self._lanes.in_junction[following] and following not in car.granted:
                return distance
        return math.inf

    def _update_crossings(self, leaders: Leaders, moving: set[int]) -> None:
        """Hand passages through junctions to the cars that come near and may have them, the nearest first.

        `moving` are the lanes beneath foreign actors on the move: lanes that meet one of them are not handed out.
        """
        asking = []
        for index, (name, car) in enumerate(self._cars.items()):
            progress = float(self._progress[index])
            for row in car.granted:
                if row == car.plan[0]:
                    self._crossings.holders[row][name] = progress + car.rear
            distance = self._distance_to_wait(car, progress)
            v = float(self._speed[index])
            if distance > v * v / (2.0 * self.driver.deceleration) + car.front + 4.0 * STOP_LINE + v:
                continue
            passage = self._passage(car)
            behind = distance + sum(self._lanes.lengths[row] for row in passage) - car.rear
            gap = float(leaders.gap[index]) + car.front
            first = gap > distance
            room = gap > behind + self.driver.standstill_gap or float(leaders.speed[index]) > ROLLING
            if first and room:
                asking.append((distance, name, passage))
        for _, name, passage in sorted(asking):
            if all(self._crossings.free(row, name, moving) for row in passage):
                for row in passage:
                    self._grant(self._cars[name], row)

    def _passage(self, car: _Car) -> list[int]:
        """The lanes of a car's plan through the next junction that it may not enter yet."""
        found: list[int] = []
        for row in car.plan[1:]:
            if self._lanes.in_junction[row] and row not in car.granted:
                found.append(row)
            elif found:
                break
        return found

    def _grant(self, car: _Car, row: int) -> None:
        """Give a car a junction lane."""
        car.granted.add(row)
        self._crossings.take(row, car.spec.name)

    def _desired_speeds(self) -> Array:
        """Each car's own speed or the limit, less before bends so that comfortable braking suffices."""
        found = np.empty(len(self._cars))
        for index, car in enumerate(self._cars.values()):
            progress = float(self._progress[index])
            own = car.desired_speed
            wanted = self._lanes.limit(car.plan[0], progress) if own is None else own
            distance = -progress
            for row in car.plan:
                bend = self._lanes.bend_speed(row, self.driver.lateral_acceleration)
                ahead = max(distance, 0.0)
                if bend < wanted:
                    wanted = min(wanted, math.sqrt(bend * bend + 2.0 * self.driver.deceleration * ahead))
                distance += self._lanes.lengths[row]
                if distance > LOOK_AHEAD:
                    break
            found[index] = wanted
        return found

    def _pass_ends(self) -> None:
        """Cars that have come to the end of their lane go on in the next one, or leave."""
        gone = []
        for index, (name, car) in enumerate(self._cars.items()):
            while self._progress[index] >= self._lanes.lengths[car.plan[0]]:
                if len(car.plan) == 1:
                    gone.append(name)
                    break
                left = car.plan.pop(0)
                beyond = float(self._progress[index] - self._lanes.lengths[left])
                scale = self._lanes.stretch(np.array([left, car.plan[0]]), np.array([self._lanes.lengths[left], 0.0]))
                self._progress[index] = beyond * float(scale[0] / scale[1])
                if left in car.granted:
                    car.granted.discard(left)
                    self._crossings.release(name, left)
                self._extend(car)
        for name in gone:
            self.remove(name)
        self.departed = frozenset(gone)

    def _extend(self, car: _Car) -> None:
        """Plan further lanes until they reach as far as a leader counts; forks by the car's own random numbers."""
        ahead = sum(self._lanes.lengths[row] for row in car.plan[1:])
        while ahead < LOOK_AHEAD and len(car.plan) <= PLANNED:
            choices = [row for row in self._lanes.following(car.plan[-1]) if self._lanes.tables.lane_drivable[row]]
            if not choices:
                return
            pick = 0
            if len(choices) > 1:
                pick = int(generator(self._seed, "traffic", car.spec.name, car.turns).integers(len(choices)))
                car.turns += 1
            car.plan.append(choices[pick])
            ahead += self._lanes.lengths[choices[pick]]
