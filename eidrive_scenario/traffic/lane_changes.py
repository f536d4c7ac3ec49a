"""Which cars change lanes, and how they move sideways."""

from __future__ import annotations

import numpy as np

from eidrive_scenario.arrays import Array, Integers
from eidrive_scenario.traffic.cars import PLANNED, Cars
from eidrive_scenario.traffic.idm import Drivers, IntelligentDriver
from eidrive_scenario.traffic.lanes import TrafficLanes
from eidrive_scenario.traffic.leaders import FOREIGN, Leaders, Occupants, find_followers, find_leaders
from eidrive_scenario.traffic.mobil import LaneChanger, Prospect, incentive, safe

DURATION = 4.0
"""A lane change takes so long at an even speed [s]; Toledo and Zohar, TRR 1999 (2007) 71, found a mean of 4.6 s."""
SHORTEST = 12.0
"""Less way than this does not suffice for a lane change [m]."""
SLOWEST = 2.0
"""Slower cars stay in their lane, unless it ends ahead of them [m/s]."""
LAST_CHANCE = 50.0
"""Within this distance from its lane's end a car changes however slow it is [m]."""
DECIDE_EACH = 0.5
"""A driver thinks of changing lanes as often [s]."""
SETTLED = 0.3
"""This near the center of its lane a car may think of the next change [m]."""
ROOM = 60.0
"""Of two cars that would change into the same lane at once, this near each other, only one does [m]."""


class LaneChanges:
    """Lane changes by MOBIL with the cars' own car-following model."""

    def __init__(self, lanes: TrafficLanes, changer: LaneChanger, driver: IntelligentDriver) -> None:
        self._lanes = lanes
        self._changer = changer
        self._others = Drivers.of([driver])

    def decide(
        self, cars: Cars, who: Integers, leaders: Leaders, desired: Array, occupants: Occupants, to_junction: Array
    ) -> list[tuple[int, int]]:
        """Cars among `who` that change lanes now, and to which lane; the most eager first.

        leaders, desired  of all cars;  to_junction  (N,) meters to the next junction, inf if there is none in sight
        """
        lanes, row = self._lanes, cars.row[who]
        found: list[tuple[float, int, int]] = []
        ends_in = lanes.ends_at[row] - cars.progress[who]
        room = self.length(cars.speed[who])
        able = (
            (np.abs(cars.offset[who]) < SETTLED)
            & ~cars.walks[who]
            & ~lanes.in_junction[row]
            & ~cars.granted[who].any(axis=1)
        )
        able &= to_junction[who] > room + cars.front[who]
        able &= (cars.speed[who] > SLOWEST) | (ends_in < LAST_CHANCE)
        for to_left, beside in ((True, lanes.left), (False, lanes.right)):
            target = beside[row]
            possible = able & (target >= 0)
            possible[possible] = lanes.ends_at[target[possible]] - cars.progress[who[possible]] > room[possible]
            some, lane = who[possible], target[possible]
            if some.size:
                prospect = self._prospect(cars, some, lane, leaders, desired, occupants)
                slow_side = to_left == lanes.left_hand[cars.row[some]]
                gain = np.where(
                    slow_side,
                    incentive(self._changer, prospect, True),
                    incentive(self._changer, prospect, False),
                )
                chosen = np.flatnonzero(safe(self._changer, prospect) & (gain > 0.0))
                found += [(-float(gain[n]), int(some[n]), int(lane[n])) for n in chosen]
        return self._one_at_a_time(cars, found)

    def _one_at_a_time(self, cars: Cars, found: list[tuple[float, int, int]]) -> list[tuple[int, int]]:
        taken: list[tuple[int, int]] = []
        for _, index, lane in sorted(found):
            crowded = any(
                other == index or (target == lane and abs(cars.progress[other] - cars.progress[index]) < ROOM)
                for other, target in taken
            )
            if not crowded:
                taken.append((index, lane))
        return taken

    def _prospect(
        self, cars: Cars, who: Integers, target: Integers, leaders: Leaders, desired: Array, occupants: Occupants
    ) -> Prospect:
        lanes = self._lanes
        progress, front, rear, speed = cars.progress[who], cars.front[who], cars.rear[who], cars.speed[who]
        drivers, wish, length = cars.drivers.of_rows(who), desired[who], front - rear
        after = find_leaders(lanes, lanes.chain(target, PLANNED + 1), progress, front, occupants, own=who)
        new = find_followers(lanes, target, progress, rear, occupants, who)
        old = find_followers(lanes, cars.row[who], progress, rear, occupants, who)
        gap, ahead = leaders.gap[who], leaders.speed[who]

        def follower(number: Integers, behind: Array, leader: Array) -> Array:
            """Acceleration of followers at a gap behind a leader of that speed; 0 where there is no follower."""
            owner = np.where(number >= 0, occupants.owner[number], FOREIGN)
            own = owner >= 0
            table = np.repeat(self._others.table, len(owner), axis=0)
            table[own] = cars.drivers.table[owner[own]]
            v = occupants.speed[number]
            wish = np.where(own, desired[owner], np.maximum(v, 1.0))
            found = Drivers(table).response(v, wish, behind, v - leader)
            return np.where(number >= 0, found, 0.0)

        return Prospect(
            own=drivers.response(speed, wish, gap, speed - ahead),
            own_after=drivers.response(speed, wish, after.gap, speed - after.speed),
            new_follower=follower(new.number, new.gap + length + after.gap, after.speed),
            new_follower_after=follower(new.number, new.gap, speed),
            old_follower=follower(old.number, old.gap, speed),
            old_follower_after=follower(old.number, old.gap + length + gap, ahead),
        )

    @staticmethod
    def length(speed: Array) -> Array:
        """Return meters that a lane change takes at speeds (N,) [m/s]."""
        return np.maximum(speed * DURATION, SHORTEST)

    def begin(self, cars: Cars, index: int, target: int) -> None:
        """Let a car begin its change: it belongs to the new lane from now on, still beside its center."""
        rows, progress = cars.row[[index]], cars.progress[[index]]
        apart = float(self._lanes.apart(rows, np.array([target]), progress)[0])
        cars.offset[index] -= apart
        cars.shift[index] = cars.offset[index]
        cars.shift_done[index] = 0.0
        cars.shift_length[index] = float(self.length(cars.speed[[index]])[0])

    def advance(self, cars: Cars, covered: Array) -> None:
        """Move those who change sideways while they cover meters (N,): a path of least jerk, as a quintic has it."""
        who = np.flatnonzero(cars.changing)
        if not who.size:
            return
        cars.shift_done[who] += covered[who]
        part = np.minimum(cars.shift_done[who] / cars.shift_length[who], 1.0)
        cars.offset[who] = cars.shift[who] * (1.0 - part**3 * (10.0 + part * (6.0 * part - 15.0)))
        cars.slope[who] = -cars.shift[who] / cars.shift_length[who] * 30.0 * (part * (1.0 - part)) ** 2
        cars.shift[who[part >= 1.0]] = 0.0

    def still_left(self, cars: Cars) -> tuple[Integers, Integers]:
        """Cars whose body still covers a part of the lane that they leave, and that lane."""
        who = np.flatnonzero(cars.changing)
        if not who.size:
            return who, who
        row = cars.row[who]
        half = 0.5 * self._lanes.width(row, cars.progress[who])
        body = np.array([0.5 * cars.specs[n].size[1] for n in who])
        lane = np.where(cars.offset[who] > 0.0, self._lanes.beside_left[row], self._lanes.beside_right[row])
        covers = (np.abs(cars.offset[who]) + body > half) & (lane >= 0)
        return who[covers], lane[covers]
