"""Background traffic: cars that follow lanes and each other, change lanes, and stop for what stands in their way."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.randomness import generator
from eidrive_scenario.roads import LaneLocation, RoadNetwork
from eidrive_scenario.traffic.cars import PLANNED, Cars
from eidrive_scenario.traffic.crossings import Crossings
from eidrive_scenario.traffic.idm import Drivers, IntelligentDriver, ballistic
from eidrive_scenario.traffic.lane_changes import DECIDE_EACH, LaneChanges
from eidrive_scenario.traffic.lanes import FREE, TrafficLanes
from eidrive_scenario.traffic.leaders import (
    FIXED,
    LOOK_AHEAD,
    Leaders,
    Occupants,
    find_leaders,
    nobody,
    obstacles,
    together,
)
from eidrive_scenario.traffic.mobil import LaneChanger
from eidrive_scenario.traffic.stop_lines import MustStop, StopLines
from eidrive_scenario.world.actor import ActorSpec, Placement
from eidrive_scenario.world.view import WorldView

Array = NDArray[np.float64]

STOP_LINE = 1.0
"""A car that waits for a junction stops this far before it [m]."""
PATIENCE = 20.0
"""A car that has waited so long before a junction is not overtaken by others any more [s]."""
TOO_LATE = 4.0
"""A car that would have to brake harder than this passes a light that has just turned [m/s²]."""


class Fleet:
    """Cars on the lanes of a road network.

    Each follows the lane's centre with the Intelligent Driver Model, slows down for bends, takes a branch at a fork by
    its own stream of random numbers (seed, name), and enters a junction only when the lanes that it meets are free and
    its light, if any, lets it. Lanes are changed by MOBIL. A car that reaches the end of the lanes leaves: `departed`
    names it.
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
        self._seed = seed
        self._crossings = Crossings(self.lanes)
        self._changes = LaneChanges(self.lanes, changer or LaneChanger(), self.driver)
        self._lines = None if must_stop is None else StopLines(self.lanes, must_stop)
        self._cars = Cars()
        self._index: dict[str, int] = {}
        self._made = 0
        self._ticks = 0
        self._poses: Array | None = None
        self._foreign, self._moving = nobody(), set[int]()
        self._ends = self._ends_of_lanes()

    @property
    def names(self) -> tuple[str, ...]:
        """The cars, in the order in which they were added."""
        return tuple(self._index)

    @property
    def speeds(self) -> Mapping[str, float]:
        """Speed of each car [m/s]."""
        return dict(zip(self._index, self._cars.speed.tolist(), strict=True))

    @property
    def specs(self) -> list[ActorSpec]:
        """The bodies of the cars."""
        return self._cars.specs

    @property
    def drivers(self) -> Drivers:
        """The parameters of the cars' drivers."""
        return self._cars.drivers

    @property
    def boxes(self) -> Array:
        """(N, 7) x y z l w h yaw of the cars' bounding boxes now [m, rad]."""
        poses, body = self.poses, np.array([(*spec.offset, *spec.size) for spec in self.specs]).reshape(-1, 6)
        cos, sin = np.cos(poses[:, 3]), np.sin(poses[:, 3])
        x = poses[:, 0] + cos * body[:, 0] - sin * body[:, 1]
        y = poses[:, 1] + sin * body[:, 0] + cos * body[:, 1]
        return np.column_stack([x, y, poses[:, 2] + body[:, 2], body[:, 3:], poses[:, 3]])

    def spec(self, name: str) -> ActorSpec:
        """The body of a car."""
        return self._cars.specs[self._index[name]]

    def positions(self, names: Sequence[str]) -> tuple[Array, Array]:
        """x and y of cars [m]."""
        rows = [self._index[name] for name in names]
        return self.poses[rows, 0], self.poses[rows, 1]

    def places(self, names: Sequence[str]) -> tuple[NDArray[np.int64], Array]:
        """Lane rows and progress of cars [m]."""
        rows = [self._index[name] for name in names]
        return self._cars.row[rows], self._cars.progress[rows]

    def __contains__(self, name: str) -> bool:
        return name in self._index

    def __len__(self) -> int:
        return len(self._index)

    def add(
        self,
        spec: ActorSpec,
        location: LaneLocation,
        *,
        speed: float = 0.0,
        desired_speed: float | None = None,
        driver: IntelligentDriver | None = None,
    ) -> Placement:
        """Bring a car in at a lane's centre line; without a desired speed it drives at the limit.

        Raises PositionError for a lane that does not exist, ValueError for a name that is taken.
        """
        row, progress = self.lanes.of(location)
        return self.add_at(spec, row, progress, speed=speed, desired_speed=desired_speed, driver=driver)

    def add_at(
        self,
        spec: ActorSpec,
        row: int,
        progress: float,
        *,
        speed: float = 0.0,
        desired_speed: float | None = None,
        driver: IntelligentDriver | None = None,
        factor: float = 1.0,
        fallback: float = FREE,
    ) -> Placement:
        """`add`, by the lane's row and the progress along it.

        factor    of the speed limit that the car keeps to;  fallback  its desired speed where there is no limit [m/s]
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
            number=self._made,
            walks=bool(self.lanes.walkable[row]),
        )
        self._made += 1
        self._index[spec.name] = index
        self._cars.plan[index, 0] = row
        self._poses = None
        if self.lanes.in_junction[row] and not self.lanes.walkable[row]:
            self._crossings.take(row, spec.name)
            self._cars.granted[index, 0] = True
        self._extend(index)
        return self._placement(index, teleport=True)

    def remove(self, name: str) -> None:
        """Take a car out."""
        index = self._index[name]
        self._crossings.forget(name)
        self._cars.delete(index)
        self._poses = None
        self._index = {spec.name: n for n, spec in enumerate(self._cars.specs)}

    @property
    def poses(self) -> Array:
        """(N, 6) x y z yaw pitch roll of the reference points now [m, rad]."""
        if self._poses is None:
            cars, lanes = self._cars, self.lanes
            sign = lanes.direction[cars.row]
            found = lanes.tables.lane_poses(cars.row, lanes.s(cars.row, cars.progress), cars.offset * sign)
            yaw = found.h + np.where(sign > 0, 0.0, math.pi) + np.arctan(cars.slope)
            self._poses = np.column_stack([found.x, found.y, found.z, yaw, found.p * sign, found.r * sign])
        return self._poses

    def placements(self) -> dict[str, Placement]:
        """Where the cars are now."""
        rows = zip(self._index, self.poses.tolist(), self._cars.speed.tolist(), strict=True)
        return {name: Placement(x, y, z, h, p, r, speed) for name, (x, y, z, h, p, r), speed in rows}

    def _placement(self, index: int, *, teleport: bool) -> Placement:
        x, y, z, h, p, r = self.poses[index].tolist()
        return Placement(x, y, z, h, p, r, float(self._cars.speed[index]), teleport)

    def observe(self, view: WorldView, *, everywhere: bool = True) -> None:
        """Look where all others are; with `everywhere` False only near the cars of the fleet."""
        near = None if everywhere else self.poses[:, :2]
        self._foreign, self._moving = obstacles(self.lanes, view, frozenset(self._index), near)

    def step(self, view: WorldView | None, dt: float) -> dict[str, Placement]:
        """Drive on by dt; whatever in `view` is not of the fleet is an obstacle. Returns where the cars are then.

        Without a view the others are where `observe` saw them last. Cars that left in this step are in `departed` and
        no more in the result.
        """
        self.departed = frozenset()
        self._ticks += 1
        if view is not None:
            self.observe(view, everywhere=False)
        if not len(self):
            return {}
        cars = self._cars
        row_lengths = np.where(cars.plan >= 0, self.lanes.length[cars.plan], 0.0)
        begins = np.cumsum(row_lengths, axis=1) - row_lengths - cars.progress[:, None]
        occupants = self.occupants()
        leaders = self._leaders(occupants)
        lights = self._lights()
        self._update_crossings(leaders.or_nearer(lights), lights, begins, dt)
        desired = self._desired_speeds(begins)
        halted = leaders.or_nearer(lights).or_nearer(self._waits(begins))
        acceleration = cars.drivers.response(cars.speed, desired, halted.gap, cars.speed - halted.speed)
        self._change_lanes(dt, leaders, desired, occupants, begins)
        covered, cars.speed = ballistic(cars.speed, acceleration, dt)
        cars.progress = cars.progress + covered / self.lanes.stretch(cars.row, cars.progress)
        self._changes.advance(cars, covered)
        self._poses = None
        self._pass_ends()
        return self.placements()

    def occupants(self) -> Occupants:
        """Everything on the lanes: the fleet, also on the lanes that its cars are leaving, others, lanes' ends."""
        cars = self._cars
        own = np.arange(len(cars))
        still, lane = self._changes.still_left(cars)
        who, row = np.concatenate([own, still]), np.concatenate([cars.row, lane])
        key = cars.progress[who]
        mine = Occupants(row, key, key + cars.rear[who], key + cars.front[who], cars.speed[who], who)
        return together(mine, self._foreign, self._ends)

    def _ends_of_lanes(self) -> Occupants:
        row = np.flatnonzero(np.isfinite(self.lanes.ends_at))
        at = self.lanes.ends_at[row]
        return Occupants(row, at, at, at, np.zeros(len(row)), np.full(len(row), FIXED))

    def _leaders(self, occupants: Occupants) -> Leaders:
        """The leaders of all cars; of those that change lanes, the nearer one of both lanes.

        The end of a lane does not stop a car that is leaving it: only by driving on it gets out of that lane.
        """
        cars = self._cars
        leaders = find_leaders(self.lanes, cars.plan, cars.progress, cars.front, occupants)
        still, lane = self._changes.still_left(cars)
        if still.size:
            chain = self.lanes.chain(lane, PLANNED + 1)
            standing = occupants.without(FIXED)
            other = find_leaders(self.lanes, chain, cars.progress[still], cars.front[still], standing, own=still)
            gap, speed = leaders.gap.copy(), leaders.speed.copy()
            nearer = Leaders(gap[still], speed[still]).or_nearer(other)
            gap[still], speed[still] = nearer.gap, nearer.speed
            leaders = Leaders(gap, speed)
        return Leaders(leaders.gap * self.lanes.stretch(cars.row, cars.progress), leaders.speed)

    def _lights(self) -> Leaders:
        """The stop lines before lights that tell cars to stop, for those that still can."""
        cars = self._cars
        closed = nobody() if self._lines is None else self._lines.closed()
        none = np.zeros(len(cars))
        lights = find_leaders(self.lanes, cars.plan, cars.progress + cars.front, none, closed)
        with np.errstate(divide="ignore"):
            late = cars.speed**2 / (2.0 * np.maximum(lights.gap, 0.0)) > TOO_LATE
        binding = (lights.gap >= 0.0) & ~(late & (cars.speed > 0.0)) & ~cars.walks
        return Leaders(np.where(binding, np.maximum(lights.gap - STOP_LINE, 1e-3), np.inf), lights.speed)

    def _waiting_lane(self) -> NDArray[np.bool_]:
        """(N, D) for each lane of the plans beyond the first, whether the car has to wait before it."""
        cars = self._cars
        ahead: NDArray[np.bool_] = (cars.plan >= 0) & self.lanes.in_junction[cars.plan]
        ahead &= ~cars.granted & ~cars.walks[:, None]
        ahead[:, 0] = False
        return ahead

    def _distances_to_wait(self, begins: Array) -> Array:
        """(N,) metres to the first junction lane ahead that a car may not enter yet, inf if there is none in sight."""
        distance = np.where(self._waiting_lane(), begins, np.inf).min(axis=1)
        return np.where(distance > LOOK_AHEAD, np.inf, distance)

    def _waits(self, begins: Array) -> Leaders:
        """The stop lines of junctions that cars may not enter yet."""
        wait = self._distances_to_wait(begins) - self._cars.front - STOP_LINE
        return Leaders(np.maximum(wait, 1e-3), np.zeros(len(self)))

    def _update_crossings(self, leaders: Leaders, lights: Leaders, begins: Array, dt: float) -> None:
        """Hand passages through junctions to the cars that come near and may have them: first come, first served.

        Lanes that meet one beneath a foreign actor on the move are not handed out, nor what would hold up a car that
        has lost its patience. Who is stopped by a light before the junction gives back what it got.
        """
        cars = self._cars
        names = list(self._index)
        for index in np.flatnonzero(cars.granted[:, 0]).tolist():
            held = self._crossings.holders[int(cars.plan[index, 0])]
            held[names[index]] = float(cars.progress[index] + cars.rear[index])
        ahead = cars.granted.any(axis=1) & ~cars.granted[:, 0] & np.isfinite(lights.gap)
        for index in np.flatnonzero(ahead).tolist():
            if lights.gap[index] + cars.front[index] < begins[index, np.argmax(cars.granted[index])]:
                self._crossings.forget(names[index])
                cars.granted[index] = False
        distance = self._distances_to_wait(begins)
        v = cars.speed
        close = distance <= v * v / (2.0 * cars.drivers.deceleration) + cars.front + 4.0 * STOP_LINE + v
        gap = leaders.gap + cars.front
        asking = []
        for index in np.flatnonzero(close & (gap > distance)).tolist():
            passage = self._passage(index)
            behind = distance[index] + self.lanes.length[passage].sum() - cars.rear[index]
            if gap[index] > behind + cars.drivers.standstill_gap[index]:
                since = int(cars.asked[index]) or self._ticks
                cars.asked[index] = since
                asking.append((since, float(distance[index]), names[index], index, passage))
        kept_free: set[int] = set()
        for since, _, name, index, passage in sorted(asking):
            if all(self._crossings.free(row, name, self._moving | kept_free) for row in passage):
                for row in passage:
                    self._crossings.take(row, name)
                cars.granted[index] |= np.isin(cars.plan[index], passage)
                cars.asked[index] = 0
            elif (self._ticks - since) * dt > PATIENCE:
                kept_free.update(passage)

    def _passage(self, index: int) -> list[int]:
        """The lanes through the next junction that a car may not enter yet, to the end of its last connecting road."""
        cars, lanes = self._cars, self.lanes
        found: list[int] = []
        for row, granted in zip(cars.plan[index, 1:].tolist(), cars.granted[index, 1:].tolist(), strict=True):
            if row >= 0 and lanes.in_junction[row] and not granted:
                found.append(row)
            elif found:
                return found
        while (ways := lanes.following(found[-1])) and lanes.road[ways[0]] == lanes.road[found[-1]]:
            found.append(ways[0])
        return found

    def _desired_speeds(self, begins: Array) -> Array:
        """Each car's own speed or the limit, less before bends so that comfortable braking suffices."""
        cars = self._cars
        limit = self.lanes.limits(cars.row, cars.progress) * cars.factor
        wanted = np.where(
            np.isfinite(limit), limit, np.where(np.isinf(limit), np.maximum(FREE, cars.fallback), cars.fallback)
        )
        wanted = np.minimum(np.where(np.isnan(cars.own_speed), wanted, cars.own_speed), cars.top_speed)
        seen = (cars.plan >= 0) & (begins <= LOOK_AHEAD)
        bend = self.lanes.tightest(np.where(seen, cars.plan, cars.row[:, None]))
        square = cars.drivers.lateral_acceleration[:, None] / np.maximum(bend, 1e-6)
        square = square + 2.0 * cars.drivers.deceleration[:, None] * np.maximum(begins, 0.0)
        slowest = np.sqrt(np.where(seen, square, np.inf).min(axis=1))
        return np.asarray(np.minimum(wanted, slowest))

    def _change_lanes(self, dt: float, leaders: Leaders, desired: Array, occupants: Occupants, begins: Array) -> None:
        """Let the drivers whose turn it is think of another lane."""
        cars = self._cars
        every = max(round(DECIDE_EACH / dt), 1)
        who = np.flatnonzero(cars.number % every == self._ticks % every)
        if not who.size:
            return
        junction = (cars.plan >= 0) & self.lanes.in_junction[cars.plan]
        to_junction = np.where(junction, begins, np.inf).min(axis=1)
        for index, target in self._changes.decide(cars, who, leaders, desired, occupants, to_junction):
            self._changes.begin(cars, index, target)
            cars.plan[index] = -1
            cars.plan[index, 0] = target
            cars.granted[index] = False
            self._extend(index)

    def _pass_ends(self) -> None:
        """Cars that have come to the end of their lane go on in the next one, or leave."""
        cars, lanes = self._cars, self.lanes
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
                self._extend(index)
        for name in gone:
            self.remove(name)
        self.departed = frozenset(gone)

    def _extend(self, index: int) -> None:
        """Plan further lanes until they reach as far as a leader counts; forks by the car's own random numbers."""
        cars, lengths = self._cars, self.lanes.lengths
        plan = [row for row in cars.plan[index].tolist() if row >= 0]
        ahead = sum(lengths[row] for row in plan[1:])
        while ahead < LOOK_AHEAD and len(plan) <= PLANNED:
            choices = self.lanes.following(plan[-1])
            if not choices:
                break
            pick = 0
            if len(choices) > 1:
                name, turn = cars.specs[index].name, int(cars.turns[index])
                pick = int(generator(self._seed, "traffic", name, turn).integers(len(choices)))
                cars.turns[index] += 1
            cars.plan[index, len(plan)] = choices[pick]
            cars.granted[index, len(plan)] = self._crossings.holds(cars.specs[index].name, choices[pick])
            plan.append(choices[pick])
            ahead += lengths[choices[pick]]
