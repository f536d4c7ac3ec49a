"""Lane changes of a fleet, by MOBIL: minimizing overall braking induced by lane changes.

Kesting, Treiber and Helbing, General lane-changing model MOBIL for car-following models, Transportation Research Record
1999 (2007) 86.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from eidrive_scenario.base.arrays import Array, Bools, Integers
from eidrive_scenario.base.car_following import Drivers, IntelligentDriver
from eidrive_scenario.roads.routing.route import smoothstep
from eidrive_scenario.traffic.cars import PLANNED, VAN_FRONT, Cars
from eidrive_scenario.traffic.lanes import TrafficLanes
from eidrive_scenario.traffic.leaders import FIXED, FOREIGN, Leaders, Occupants, find_followers, find_leaders


@dataclass(frozen=True)
class LaneChanger:
    """Parameters of the model with the values of the paper. Its symmetric rule has no bias.

    politeness         p, weight of the disadvantage of others, from 0 (egoistic) to 1 (altruistic)
    threshold          Δa_th, minimum advantage of a lane change [m/s²]
    safe_deceleration  b_safe, maximum deceleration of the new follower [m/s²]
    bias               Δa_bias, in favor of the lane on the side of slow traffic [m/s²]
    """

    politeness: float = 0.5
    threshold: float = 0.1
    safe_deceleration: float = 4.0
    bias: float = 0.0


@dataclass(frozen=True)
class Prospect:
    """Accelerations (N,) before and after a lane change [m/s²] of the car, its new and its old follower."""

    own: Array
    own_after: Array
    new_follower: Array
    new_follower_after: Array
    old_follower: Array
    old_follower_after: Array


def safe(changer: LaneChanger, prospect: Prospect) -> Bools:
    """Return the safety criterion (equation 1): neither the new follower nor the car has to brake too hard."""
    hardest = np.minimum(prospect.new_follower_after, prospect.own_after)
    return np.asarray(hardest >= -changer.safe_deceleration)


def incentive(changer: LaneChanger, prospect: Prospect, to_slow_side: Bools | bool) -> Array:
    """Return the incentive minus the threshold (equations 2 and 6) [m/s²]. A positive value favors the change."""
    gain = prospect.own_after - prospect.own
    others = prospect.new_follower_after - prospect.new_follower + prospect.old_follower_after - prospect.old_follower
    bias = np.where(to_slow_side, changer.bias, -changer.bias)
    return np.asarray(gain + changer.politeness * others - changer.threshold + bias)


DURATION = 4.0
"""Duration of a lane change at constant speed [s]. Toledo and Zohar, TRR 1999 (2007) 71, found a mean of 4.6 s."""
SHORTEST = 12.0
"""Minimum length of a lane change of a vehicle up to a van [m]."""
STRETCH = 4.4
"""Minimum length of a lane change of a longer vehicle per distance from its rear axle to its front.

With it the front corner of a bus of 2.55 m stays in a new lane of 3.5 m.
"""
SLOWEST = 2.0
"""Minimum speed for a lane change, unless the lane ends [m/s]."""
LAST_CHANCE = 50.0
"""Distance to the end of a lane within which a car changes at any speed [m]."""
DECIDE_EACH = 0.5
"""Interval between lane change decisions of a driver [s]."""
SETTLED = 0.3
"""Maximum distance from the lane center for a new lane change [m]."""
ROOM = 60.0
"""Minimum distance between two cars that change to the same lane at the same time [m]."""


class LaneChanges:
    """Lane changes by MOBIL with the car-following models of the cars."""

    def __init__(self, lanes: TrafficLanes, changer: LaneChanger, driver: IntelligentDriver) -> None:
        self._lanes = lanes
        self._changer = changer
        self._others = Drivers.of([driver])

    def decide(
        self, cars: Cars, indices: Integers, leaders: Leaders, desired: Array, occupants: Occupants, to_junction: Array
    ) -> list[tuple[int, int]]:
        """Return the cars of `indices` that change lanes now with their target lanes, ordered by descending incentive.

        leaders, desired  of all cars
        to_junction       (N,) distance to the next junction, inf if there is none within sight [m]
        """
        lanes, lane = self._lanes, cars.lane[indices]
        ends_in = lanes.ends_at[lane] - cars.progress[indices]
        room = self.length(cars.speed[indices], cars.front[indices])
        able = (np.abs(cars.offset[indices]) < SETTLED) & ~cars.walks[indices]
        able &= ~lanes.in_junction[lane] & ~cars.granted[indices].any(axis=1)
        able &= to_junction[indices] > room + cars.front[indices]
        able &= (cars.speed[indices] > SLOWEST) | (ends_in < LAST_CHANCE)
        sides = [(lanes.left[lane], lanes.left_hand[lane]), (lanes.right[lane], ~lanes.left_hand[lane])]
        target, slow_side = (np.concatenate(parts) for parts in zip(*sides, strict=True))
        some, room, able = np.tile(indices, 2), np.tile(room, 2), np.tile(able, 2)
        possible = np.flatnonzero(able & (target >= 0))
        possible = possible[lanes.ends_at[target[possible]] - cars.progress[some[possible]] > room[possible]]
        own, length = some[possible], room[possible]
        possible = possible[lanes.may_cross(cars.lane[own], target[possible], cars.progress[own], length)]
        if not possible.size:
            return []
        some, target, slow_side = some[possible], target[possible], slow_side[possible]
        prospect = self._prospect(cars, some, target, leaders, desired, occupants)
        gain = incentive(self._changer, prospect, slow_side)
        chosen = np.flatnonzero(safe(self._changer, prospect) & (gain > 0.0))
        begun: list[tuple[int, int]] = []
        for _, index, new in sorted((-float(gain[n]), int(some[n]), int(target[n])) for n in chosen):
            if not any(
                other == index or (taken == new and abs(cars.progress[other] - cars.progress[index]) < ROOM)
                for other, taken in begun
            ):
                begun.append((index, new))
        return begun

    def _prospect(
        self, cars: Cars, indices: Integers, target: Integers, leaders: Leaders, desired: Array, occupants: Occupants
    ) -> Prospect:
        lanes = self._lanes
        columns = cars.progress, cars.front, cars.rear, cars.speed
        progress, front, rear, speed = (column[indices] for column in columns)
        drivers, wish, length = cars.drivers.of_rows(indices), desired[indices], front - rear
        after = find_leaders(lanes, lanes.chain(target, PLANNED + 1), progress, front, occupants, own=indices)
        moving = occupants.without(FIXED)
        new = find_followers(lanes, target, progress, rear, moving, indices)
        old = find_followers(lanes, cars.lane[indices], progress, rear, moving, indices)
        gap, ahead = leaders.gap[indices], leaders.speed[indices]

        # Before and after the change in one call each, first the car, then its new and its old follower
        own = Drivers(np.tile(drivers.table, (2, 1))).response(
            np.tile(speed, 2),
            np.tile(wish, 2),
            np.concatenate([gap, after.gap]),
            np.concatenate([speed - ahead, speed - after.speed]),
        )
        number = np.concatenate([new.number, new.number, old.number, old.number])
        behind = np.concatenate([new.gap + length + after.gap, new.gap, old.gap, old.gap + length + gap])
        leader = np.concatenate([after.speed, speed, speed, ahead])
        followers = self._followers(cars, desired, moving, number, behind, leader)
        return Prospect(*own.reshape(2, -1), *followers.reshape(4, -1))

    def _followers(
        self, cars: Cars, desired: Array, occupants: Occupants, number: Integers, behind: Array, leader: Array
    ) -> Array:
        """Return the accelerations of followers at a gap behind a leader of this speed; 0 without a follower."""
        owner = np.where(number >= 0, occupants.owner[number], FOREIGN)
        own = owner >= 0
        table = np.repeat(self._others.table, len(owner), axis=0)
        table[own] = cars.drivers.table[owner[own]]
        v = occupants.speed[number]
        wish = np.where(own, desired[owner], np.maximum(v, 1.0))
        return np.where(number >= 0, Drivers(table).response(v, wish, behind, v - leader), 0.0)

    @staticmethod
    def length(speed: Array, front: Array) -> Array:
        """Return the length of a lane change at speeds (N,) [m/s] with distances (N,) to the front bumper [m]."""
        return np.maximum(speed * DURATION, np.where(front > VAN_FRONT, STRETCH * front, SHORTEST))

    def begin(self, cars: Cars, index: int, target: int) -> None:
        """Start the change of a car. It belongs to the new lane from now on, still beside its center."""
        old, progress = cars.lane[[index]], cars.progress[[index]]
        apart = float(self._lanes.apart(old, np.array([target]), progress)[0])
        cars.offset[index] -= apart
        cars.shift[index] = cars.offset[index]
        cars.shift_done[index] = 0.0
        cars.shift_length[index] = float(self.length(cars.speed[[index]], cars.front[[index]])[0])

    def advance(self, cars: Cars, covered: Array) -> None:
        """Move changing cars laterally on a quintic path of minimum jerk while they cover distances (N,) [m]."""
        indices = np.flatnonzero(cars.changing)
        if not indices.size:
            return
        cars.shift_done[indices] += covered[indices]
        part = np.minimum(cars.shift_done[indices] / cars.shift_length[indices], 1.0)
        cars.offset[indices] = cars.shift[indices] * (1.0 - smoothstep(part))
        cars.slope[indices] = -cars.shift[indices] / cars.shift_length[indices] * 30.0 * (part * (1.0 - part)) ** 2
        cars.shift[indices[part >= 1.0]] = 0.0
