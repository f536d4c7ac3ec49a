"""Occupants of the lanes of a fleet: its cars, other actors on every lane that they overlap, and the ends of lanes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from eidrive_scenario.base.arrays import Array, Integers
from eidrive_scenario.traffic.cars import PLANNED, Cars
from eidrive_scenario.traffic.lanes import TrafficLanes
from eidrive_scenario.traffic.leaders import (
    FIXED,
    FOREIGN,
    LOOK_AHEAD,
    Leaders,
    Occupants,
    concatenate_occupants,
    find_leaders,
    no_occupants,
)
from eidrive_scenario.world.view import WorldView

STANDING = 0.5
"""Maximum speed of a standing actor [m/s]."""
TALLEST = 4.0
"""Maximum height of vehicles, above which actors do not occupy a lane [m]; Directive 96/53/EC."""
OUTLINE = np.array(
    [(0.5, 0.5), (0.5, 0.0), (0.5, -0.5), (0.0, 0.5), (0.0, -0.5), (-0.5, 0.5), (-0.5, 0.0), (-0.5, -0.5)]
)


class Occupancy:
    """Occupancy of the lanes of one fleet. Actors outside the fleet that stay in place are located once.

    foreign  outlines of the actors outside the fleet
    moving   lanes that moving actors outside the fleet overlap
    """

    def __init__(self, lanes: TrafficLanes) -> None:
        self._lanes = lanes
        lane = np.flatnonzero(np.isfinite(lanes.ends_at))
        at = lanes.ends_at[lane]
        self._ends = Occupants(lane, at, at, at, np.zeros(len(lane)), np.full(len(lane), FIXED))
        self.foreign = no_occupants()
        self.moving = set[int]()
        self._before: dict[str, bytes] = {}
        self._resting: tuple[str, ...] = ()
        """Actors that stayed in place since `_at_rest` and `_moving_at_rest` were determined."""
        self._at_rest, self._moving_at_rest = no_occupants(), set[int]()

    def observe(self, view: WorldView, own: frozenset[str], near: Array | None = None) -> None:
        """Observe all actors not in `own`. In a junction with overlapping roads an actor occupies all lanes below it.

        near  (K, 2) positions [m]; actors beyond the range of sight from all of them are ignored
        """
        rows = _considered(view, own, near)
        state = np.column_stack([view.boxes[rows], view.position[rows, 2], view.velocity[rows, :2]])
        before, self._before = self._before, {}
        resting: list[int] = []
        others: list[int] = []
        for row, values in zip(rows.tolist(), state, strict=True):
            name, packed = view.names[row], values.tobytes()
            (resting if before.get(name) == packed else others).append(row)
            self._before[name] = packed
        names = tuple(view.names[row] for row in resting)
        if names != self._resting:
            self._resting = names
            self._at_rest, self._moving_at_rest = _outlines(self._lanes, view, resting)
        occupants, moving = _outlines(self._lanes, view, others)
        self.moving = moving | self._moving_at_rest
        self.foreign = concatenate_occupants(occupants, self._at_rest) if names else occupants

    def occupants(self, cars: Cars) -> Occupants:
        """Return all occupants: cars (also on lanes that they are leaving), other actors, lane ends."""
        own = np.arange(len(cars))
        still, left = self._lanes_left(cars)
        indices, lane = np.concatenate([own, still]), np.concatenate([cars.lane, left])
        key = cars.progress[indices]
        mine = Occupants(lane, key, key + cars.rear[indices], key + cars.front[indices], cars.speed[indices], indices)
        return concatenate_occupants(mine, self.foreign, self._ends)

    def leaders(self, cars: Cars, occupants: Occupants) -> Leaders:
        """Return the leaders of all cars. During a lane change it is that of both lanes which demands more braking.

        The end of a lane does not stop a car that is leaving this lane, as it leaves only while moving.
        """
        leaders = find_leaders(self._lanes, cars.plan, cars.progress, cars.front, occupants)
        still, lane = self._lanes_left(cars)
        if still.size:
            chain = self._lanes.chain(lane, PLANNED + 1)
            standing = occupants.without(FIXED)
            other = find_leaders(self._lanes, chain, cars.progress[still], cars.front[still], standing, own=still)
            drivers, speed = cars.drivers.of_rows(still), cars.speed[still]
            braking, other_braking = (
                drivers.interaction(speed, gap, speed - leader_speed)
                for gap, leader_speed in ((leaders.gap[still], leaders.speed[still]), (other.gap, other.speed))
            )
            stronger = other_braking > braking
            binding = still[stronger]
            leaders.gap[binding], leaders.speed[binding] = other.gap[stronger], other.speed[stronger]
            leaders.owner[binding] = other.owner[stronger]
        return replace(leaders, gap=leaders.gap * self._lanes.stretch(cars.lane, cars.progress))

    def _lanes_left(self, cars: Cars) -> tuple[Integers, Integers]:
        """Return the cars whose bodies still overlap the lane that they leave, and these lanes."""
        indices = np.flatnonzero(cars.changing)
        if not indices.size:
            return indices, indices
        new = cars.lane[indices]
        half = 0.5 * self._lanes.width(new, cars.progress[indices])
        body = np.array([0.5 * cars.specs[n].size[1] for n in indices])
        old = np.where(cars.offset[indices] > 0.0, self._lanes.beside_left[new], self._lanes.beside_right[new])
        covers = (np.abs(cars.offset[indices]) + body > half) & (old >= 0)
        return indices[covers], old[covers]


def _considered(view: WorldView, own: frozenset[str], near: Array | None) -> Integers:
    """Return the rows of the actors not in `own`, with positions `near` only those within the range of sight."""
    rows = np.array([row for row, name in enumerate(view.names) if name not in own], dtype=np.int64)
    if near is None or not rows.size:
        return rows
    if not len(near):
        return rows[:0]
    reach = LOOK_AHEAD + np.hypot(view.size[rows, 0], view.size[rows, 1])
    dx, dy = (view.position[rows, axis, None] - near[:, axis] for axis in (0, 1))
    return np.asarray(rows[np.any(dx * dx + dy * dy < reach[:, None] ** 2, axis=1)])


def _outlines(lanes: TrafficLanes, view: WorldView, rows: list[int]) -> tuple[Occupants, set[int]]:
    """Return the outlines of actors on every lane that they overlap, and the lanes of moving ones.

    Actors above all vehicles, such as sign gantries, occupy none.
    """
    if not rows:
        return no_occupants(), set()
    boxes = view.boxes[rows]
    corners = OUTLINE[None] * boxes[:, None, 3:5]
    cos, sin = np.cos(boxes[:, 6, None]), np.sin(boxes[:, 6, None])
    x = (boxes[:, 0, None] + cos * corners[..., 0] - sin * corners[..., 1]).ravel()
    y = (boxes[:, 1, None] + sin * corners[..., 0] + cos * corners[..., 1]).ravel()
    z = view.position[rows, 2].repeat(len(OUTLINE))
    lane, s, point = lanes.roads.overlapped_lanes(x, y, z)
    base = boxes[point // len(OUTLINE), 2] - 0.5 * boxes[point // len(OUTLINE), 5]
    in_the_way = base - lanes.tables.lane_poses(lane, s, np.zeros(len(lane))).z < TALLEST
    lane, s, point = lane[in_the_way], s[in_the_way], point[in_the_way]
    progress = lanes.progress(lane, s)
    heading = lanes.tables.curves.at(lanes.road[lane], s)[2]
    vx, vy = view.velocity[rows, :2].T.take(point // len(OUTLINE), axis=1)
    speed = np.maximum((vx * np.cos(heading) + vy * np.sin(heading)) * lanes.direction[lane], 0.0)
    moving = np.hypot(vx, vy) > STANDING
    owner = np.full(len(lane), FOREIGN)
    return Occupants(lane, progress, progress, progress, speed, owner), set(lane[moving].tolist())
