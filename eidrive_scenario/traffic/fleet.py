"""Fleet of background cars, which follow lanes and leaders, change lanes, and stop for obstacles."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.car_following import Drivers, IntelligentDriver, ballistic
from eidrive_scenario.base.randomness import generator
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.traffic.cars import PLANNED, Cars
from eidrive_scenario.traffic.lane_changes import DECIDE_EACH, LaneChanger, LaneChanges
from eidrive_scenario.traffic.lanes import FREE, TrafficLanes
from eidrive_scenario.traffic.leaders import LOOK_AHEAD, Leaders, Occupants
from eidrive_scenario.traffic.occupancy import Occupancy
from eidrive_scenario.traffic.right_of_way import Crossings, MustStop, RightOfWay, StopLines
from eidrive_scenario.world.actor import ActorSpec, Placement
from eidrive_scenario.world.view import WorldView


class Plans:
    """Plans of all cars up to the distance of a leader."""

    def __init__(self, lanes: TrafficLanes, crossings: Crossings, seed: int) -> None:
        self._lanes = lanes
        self._crossings = crossings
        self._seed = seed

    def extend(self, cars: Cars, index: int) -> None:
        """Extend the plan of a car. Further lanes of a passage that it holds already are granted."""
        lengths, name = self._lanes.lengths, cars.specs[index].name
        plan = [lane for lane in cars.plan[index].tolist() if lane >= 0]
        ahead = sum(lengths[lane] for lane in plan[1:])
        while ahead < LOOK_AHEAD and len(plan) <= PLANNED:
            choices = self._lanes.following[plan[-1]]
            if not choices:
                break
            pick = 0
            if len(choices) > 1:
                turn = int(cars.turns[index])
                pick = int(generator(self._seed, "traffic", name, turn).integers(len(choices)))
                cars.turns[index] += 1
            cars.plan[index, len(plan)] = choices[pick]
            # On a closed path the next passage of a lane that it holds now has to be granted again.
            passing = cars.granted[index, len(plan) - 1]
            cars.granted[index, len(plan)] = passing and self._crossings.holds(name, choices[pick])
            plan.append(choices[pick])
            ahead += lengths[choices[pick]]

    def pass_ends(self, cars: Cars) -> list[str]:
        """Move cars at the end of their lane to the next one. Return the cars without a next lane."""
        lanes = self._lanes
        gone = []
        for index in np.flatnonzero(cars.progress >= lanes.length[cars.lane]).tolist():
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
        limit = self._lanes.limits(cars.lane, cars.progress) * cars.factor
        desired = np.where(
            np.isfinite(limit), limit, np.where(np.isinf(limit), np.maximum(FREE, cars.fallback), cars.fallback)
        )
        desired = np.minimum(np.where(np.isnan(cars.own_speed), desired, cars.own_speed), cars.top_speed)
        seen = (cars.plan >= 0) & (begins <= LOOK_AHEAD)
        bend = self._lanes.tightest(np.where(seen, cars.plan, cars.lane[:, None]))
        square = cars.drivers.lateral_acceleration[:, None] / np.maximum(bend, 1e-6)
        square = square + 2.0 * cars.drivers.deceleration[:, None] * np.maximum(begins, 0.0)
        slowest = np.sqrt(np.where(seen, square, np.inf).min(axis=1))
        return np.asarray(np.minimum(desired, slowest))


REACT_EACH = 0.05
"""Interval between decisions of drivers [s]. In shorter time steps the acceleration is constant in between."""


class Fleet:
    """Cars on the lanes of a road network.

    Each car follows the center of its lane with the Intelligent Driver Model and slows down for bends. It selects
    branches by a separate stream of random numbers (seed, name). It enters a junction only if the lanes in conflict are
    free and its traffic light permits it. Lanes are changed by MOBIL. A car at the end of the lanes leaves and is
    listed in `departed`.
    """

    def __init__(
        self,
        roads: RoadNetwork,
        *,
        seed: int = 0,
        driver: IntelligentDriver | None = None,
        changer: LaneChanger | None = None,
        must_stop: MustStop | None = None,
    ) -> None:
        self.driver = driver or IntelligentDriver()
        self.departed: frozenset[str] = frozenset()
        self.lanes = TrafficLanes(roads)
        self._crossings = Crossings(self.lanes)
        self._right_of_way = RightOfWay(self.lanes, self._crossings)
        self._plans = Plans(self.lanes, self._crossings, seed)
        self._changes = LaneChanges(self.lanes, changer or LaneChanger(), self.driver)
        self._lines = None if must_stop is None else StopLines(self.lanes, must_stop)
        self._cars = Cars()
        self._index: dict[str, int] = {}
        self._made = self._ticks = self._decisions = 0
        self._until = 0.0
        self._poses: Array | None = None
        self._occupancy = Occupancy(self.lanes)

    @property
    def decides(self) -> bool:
        """Whether drivers decide in the next step."""
        return self._until < 1e-9

    def interval(self, dt: float) -> float:
        """Return the time between two decisions for steps of dt [s]."""
        return max(round(REACT_EACH / dt), 1) * dt

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the cars in the order of addition."""
        return tuple(self._index)

    @property
    def speeds(self) -> Mapping[str, float]:
        """Speed of each car [m/s]."""
        return dict(zip(self._index, self._cars.speed.tolist(), strict=True))

    @property
    def specs(self) -> list[ActorSpec]:
        """Specifications of the cars."""
        return self._cars.specs

    @property
    def drivers(self) -> Drivers:
        """Driver parameters of the cars."""
        return self._cars.drivers

    @property
    def boxes(self) -> Array:
        """Bounding boxes x y z l w h yaw of the cars (N, 7) [m, rad]."""
        poses, body = self.poses, np.array([(*spec.offset, *spec.size) for spec in self.specs]).reshape(-1, 6)
        cos, sin = np.cos(poses[:, 3]), np.sin(poses[:, 3])
        x = poses[:, 0] + cos * body[:, 0] - sin * body[:, 1]
        y = poses[:, 1] + sin * body[:, 0] + cos * body[:, 1]
        return np.column_stack([x, y, poses[:, 2] + body[:, 2], body[:, 3:], poses[:, 3]])

    def spec(self, name: str) -> ActorSpec:
        """Return the specification of a car."""
        return self._cars.specs[self._index[name]]

    def positions(self, names: Sequence[str]) -> tuple[Array, Array]:
        """Return x and y of cars [m]."""
        rows = [self._index[name] for name in names]
        return self.poses[rows, 0], self.poses[rows, 1]

    def places(self, names: Sequence[str]) -> tuple[NDArray[np.int64], Array]:
        """Return lanes and progress of cars [m]."""
        rows = [self._index[name] for name in names]
        return self._cars.lane[rows], self._cars.progress[rows]

    def __contains__(self, name: str) -> bool:
        return name in self._index

    def __len__(self) -> int:
        return len(self._index)

    def add_at(
        self,
        spec: ActorSpec,
        lane: int,
        progress: float,
        *,
        speed: float = 0.0,
        desired_speed: float | None = None,
        driver: IntelligentDriver | None = None,
        factor: float = 1.0,
        fallback: float = FREE,
        ignores_lights: bool = False,
    ) -> Placement:
        """Add a car by the running number of its lane and the progress there.

        factor          share of the speed limit that is the desired speed
        fallback        desired speed on lanes without a limit [m/s]
        ignores_lights  whether the driver ignores traffic lights
        """
        if spec.name in self._index:
            raise ValueError(f"car {spec.name!r} is in the fleet already")
        half = 0.5 * spec.size[0]
        index = self._cars.append(
            spec,
            driver or self.driver,
            progress=progress,
            speed=speed,
            front=spec.offset[0] + half,
            rear=spec.offset[0] - half,
            own_speed=math.nan if desired_speed is None else desired_speed,
            factor=factor,
            top_speed=spec.max_speed,
            fallback=fallback,
            asked=math.nan,
            number=self._made,
            walks=bool(self.lanes.walkable[lane]),
            ignores_lights=ignores_lights,
        )
        self._made += 1
        self._index[spec.name] = index
        self._cars.plan[index, 0] = lane
        self._poses, self._until = None, 0.0
        if self.lanes.in_junction[lane] and not self.lanes.walkable[lane]:
            self._crossings.take(lane, spec.name)
            self._cars.granted[index, 0] = True
        self._plans.extend(self._cars, index)
        x, y, z, h, p, r = self.poses[index].tolist()
        return Placement(x, y, z, h, p, r, float(self._cars.speed[index]), teleport=True)

    def remove(self, name: str) -> None:
        """Remove a car."""
        index = self._index[name]
        self._crossings.forget(name)
        self._cars.delete(index)
        self._poses = None
        self._index = {spec.name: n for n, spec in enumerate(self._cars.specs)}

    @property
    def poses(self) -> Array:
        """Poses x y z yaw pitch roll of the reference points (N, 6) [m, rad]."""
        if self._poses is None:
            cars, lanes = self._cars, self.lanes
            sign = lanes.direction[cars.lane]
            poses = lanes.tables.lane_poses(cars.lane, lanes.s(cars.lane, cars.progress), cars.offset * sign)
            yaw = poses.h + np.where(sign > 0, 0.0, math.pi) + np.arctan(cars.slope)
            self._poses = np.column_stack([poses.x, poses.y, poses.z, yaw, poses.p * sign, poses.r * sign])
        return self._poses

    def placements(self) -> dict[str, Placement]:
        """Return the current placements of the cars."""
        rows = zip(self._index, self.poses.tolist(), self._cars.speed.tolist(), strict=True)
        return {name: Placement(x, y, z, h, p, r, speed) for name, (x, y, z, h, p, r), speed in rows}

    def observe(self, view: WorldView, *, everywhere: bool = True) -> None:
        """Observe the other actors; with `everywhere` False only those near the cars of the fleet."""
        near = None if everywhere else self.poses[:, :2]
        self._occupancy.observe(view, frozenset(self._index), near)

    def step(self, view: WorldView | None, dt: float) -> dict[str, Placement]:
        """Move by dt and return the placements. Actors in `view` outside the fleet are obstacles.

        Without a view the positions of the last `observe` are used. Cars that left in this step are in `departed` and
        not in the result.
        """
        self.departed = frozenset()
        self._ticks += 1
        decides = self.decides
        self._until = (self.interval(dt) if decides else self._until) - dt
        if decides and view is not None:
            self.observe(view, everywhere=False)
        if not len(self):
            return {}
        if decides:
            self._decide(dt)
        cars = self._cars
        covered, cars.speed = ballistic(cars.speed, cars.acceleration, dt)
        cars.progress = cars.progress + covered / self.lanes.stretch(cars.lane, cars.progress)
        self._changes.advance(cars, covered)
        self._poses = None
        # Move cars at the end of their lane to the next one, or remove them
        gone = self._plans.pass_ends(self._cars)
        for name in gone:
            self.remove(name)
        self.departed = frozenset(gone)
        return self.placements()

    def _decide(self, dt: float) -> None:
        """Decide on accelerations, junction entries and lane changes."""
        cars = self._cars
        self._decisions += 1
        row_lengths = np.where(cars.plan >= 0, self.lanes.length[cars.plan], 0.0)
        begins = np.cumsum(row_lengths, axis=1) - row_lengths - cars.progress[:, None]
        occupants = self.occupants()
        leaders = self._occupancy.leaders(cars, occupants)
        lights = Leaders.none(len(cars)) if self._lines is None else self._lines.ahead(cars)
        self._right_of_way.grant_right_of_way(
            cars, leaders.or_nearer(lights), lights, begins, occupants, self._occupancy.moving, self._ticks * dt
        )
        desired = self._plans.desired_speeds(cars, begins)
        halted = leaders.or_nearer(lights).or_nearer(self._right_of_way.waits(cars, begins))
        cars.acceleration = cars.drivers.response(cars.speed, desired, halted.gap, cars.speed - halted.speed)
        self._change_lanes(self.interval(dt), leaders, desired, occupants, begins)

    def occupants(self) -> Occupants:
        """Return all occupants: cars (also on lanes that they are leaving), other actors, lane ends."""
        return self._occupancy.occupants(self._cars)

    def _change_lanes(
        self, interval: float, leaders: Leaders, desired: Array, occupants: Occupants, begins: Array
    ) -> None:
        """Let drivers whose turn it is consider a lane change."""
        cars = self._cars
        every = max(round(DECIDE_EACH / interval), 1)
        indices = np.flatnonzero(cars.number % every == self._decisions % every)
        if not indices.size:
            return
        junction = (cars.plan >= 0) & self.lanes.in_junction[cars.plan]
        to_junction = np.where(junction, begins, np.inf).min(axis=1)
        for index, target in self._changes.decide(cars, indices, leaders, desired, occupants, to_junction):
            self._changes.begin(cars, index, target)
            cars.plan[index] = (target, *(-1,) * (cars.plan.shape[1] - 1))
            cars.granted[index] = False
            self._plans.extend(cars, index)
