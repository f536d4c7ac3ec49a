"""Right of way: stop lines of traffic lights, lanes that cross in junctions, and the order of passages.

In junctions: first come, first served, one car at a time on conflicting lanes. The first car of a queue requests all
lanes of its passage through the junction within its braking distance, if there is space behind the junction. They are
granted when no car holds a lane that crosses, merges or diverges. A car holds a lane until it has left it, and against
diverging lanes until it has cleared the fork. A vehicle that is too long to stop between two junctions requests the
lanes of both. Long vehicles hold the lanes that they sweep over as well, and need them without other vehicles, also
outside the junction.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property

import numpy as np

from eidrive_scenario.base.arrays import Array, Bools, Integers, number_in_groups
from eidrive_scenario.roads.geometry.nearest import NearestPoints
from eidrive_scenario.roads.model.location import LaneKey
from eidrive_scenario.roads.model.road_map import SignalPlace
from eidrive_scenario.traffic.cars import VAN_FRONT, Cars
from eidrive_scenario.traffic.lanes import TrafficLanes
from eidrive_scenario.traffic.leaders import FIXED, LOOK_AHEAD, Leaders, Occupants, find_leaders, no_occupants
from eidrive_scenario.traffic.sweeps import Sweep, Sweeps

STOP_LINE = 1.0
"""Distance of waiting cars from the stop line [m]."""
TOO_LATE = 4.0
"""Deceleration above which a car passes a light that has just changed [m/s²]."""
MustStop = Callable[[str], bool]
"""Whether the traffic light of this id requires a stop now."""


class StopLines:
    """Traffic lights of a map on the lanes for which they are valid.

    The stop line is at s of the light. For a light on a connecting road it is before the junction.
    """

    def __init__(self, lanes: TrafficLanes, must_stop: MustStop) -> None:
        self._lanes = lanes
        self._must_stop = must_stop
        self._signals: list[str] = []
        lines: list[tuple[int, float, int]] = []
        for signal in lanes.roads.signals.values():
            if not signal.stops_vehicles:
                continue
            for place in (signal.place, *signal.references):
                lines += [(lane, progress, len(self._signals)) for lane, progress in self._on_lanes(place)]
            self._signals.append(signal.id)
        self._lane = np.array([lane for lane, _, _ in lines], dtype=np.int64)
        self._progress = np.array([progress for _, progress, _ in lines])
        self._signal = np.array([signal for _, _, signal in lines], dtype=np.int64)
        self._shown: tuple[bool, ...] = ()
        self._closed = no_occupants()

    def _on_lanes(self, place: SignalPlace) -> list[tuple[int, float]]:
        lanes = self._lanes
        road = lanes.roads.roads.get(place.road)
        if road is None:
            return []
        section = road.section_at(place.s).index
        keys = [LaneKey(road.id, section, number) for number in lanes.roads.signal_lanes(place)]
        if road.junction_id is not None:
            return [(lanes.row_of(entry), 0.0) for key in keys if (entry := lanes.roads.entry_lane(key)) is not None]
        return [(row, float(lanes.progress(np.array(row), np.array(place.s)))) for row in map(lanes.row_of, keys)]

    def closed(self) -> Occupants:
        """Return the stop lines at which traffic has to stop now as occupants."""
        shown = tuple(self._must_stop(signal) for signal in self._signals)
        if shown != self._shown:
            self._shown = shown
            red = np.array(shown, dtype=bool)[self._signal]
            lane, progress = self._lane[red], self._progress[red]
            still = np.zeros(len(lane))
            self._closed = Occupants(lane, progress, progress, progress, still, np.full(len(lane), FIXED))
        return self._closed

    def ahead(self, cars: Cars) -> Leaders:
        """Return the stop lines at which cars stop, without those that require too hard braking."""
        none = np.zeros(len(cars))
        lines = find_leaders(self._lanes, cars.plan, cars.progress + cars.front, none, self.closed())
        late = cars.speed**2 > 2.0 * TOO_LATE * np.maximum(lines.gap, 0.0)
        binding = (lines.gap >= 0.0) & ~late & ~cars.walks & ~cars.ignores_lights
        return replace(lines, gap=np.where(binding, np.maximum(lines.gap - STOP_LINE, 1e-3), np.inf))


CLEARANCE = 3.2
"""Minimum distance of the center lines of lanes without a conflict [m].

It is less than that of adjacent lanes, and more than two cars need whose ends swing out in bends.
"""
TIGHT = 6.0
"""Radius of bends below which long ends need more than `CLEARANCE` [m]."""
HALF_WIDTH = 1.0
"""Half the width of a van [m]."""
FORK = 9.0
"""Distance from the start at which diverging lanes are separate [m]."""
SAMPLE = 0.75


class Crossings:
    """Conflicting lanes of junctions and the cars that hold them."""

    def __init__(self, lanes: TrafficLanes) -> None:
        self._lanes = lanes
        self._meeting: dict[int, dict[int, bool]] = {}
        self._by_junction: dict[str, list[int]] = {}
        for lane, key in enumerate(lanes.keys):
            junction = lanes.roads.roads[key.road].junction_id
            if junction is not None and lanes.tables.lane_drivable[lane]:
                self._by_junction.setdefault(junction, []).append(lane)
        self.holders: dict[int, dict[str, float]] = {}
        """Cars that hold each lane of a junction, with the progress of their rear on it [m]."""
        self.sweeps: dict[str, Sweep] = {}
        """Sweeps of the long vehicles that hold lanes."""

    def in_junction_of(self, lane: int) -> list[int]:
        """Return all lanes in the junction of a lane; none if it is in no junction."""
        junction = self._lanes.roads.roads[self._lanes.keys[lane].road].junction_id
        return [] if junction is None else self._by_junction.get(junction, [])

    def meeting(self, lane: int) -> dict[int, bool]:
        """Return the lanes in conflict with a lane of a junction. The value is True if they only diverge."""
        if lane in self._meeting:
            return self._meeting[lane]
        conflicts: dict[int, bool] = {}
        others = self.in_junction_of(lane)
        if not others:
            return conflicts
        lines, low, high = self._lines
        mine = lines[lane]
        points = NearestPoints(mine)
        for other in others:
            reach = CLEARANCE + max(self._swings[lane], self._swings[other])
            near_by = np.all(low[other] <= high[lane] + reach) and np.all(low[lane] <= high[other] + reach)
            if self._lanes.road[other] == self._lanes.road[lane] or not near_by:
                continue
            line = lines[other]
            together = np.hypot(*(line[0] - mine[0])) < 1.0
            near = np.flatnonzero(points.nearest(line)[0] < (CLEARANCE if together else reach))
            if near.size:
                conflicts[other] = bool(together and near.max() * SAMPLE < 2.0 * FORK)
        self._meeting[lane] = conflicts
        return conflicts

    @cached_property
    def _swings(self) -> Array:
        """Width (N,) by which the front of a van swings out farther in the bends of lanes than `CLEARANCE` permits."""
        all_lanes = np.arange(len(self._lanes.keys))
        radius = 1.0 / np.maximum(self._lanes.tightest(all_lanes), 1e-6)
        return np.maximum(_swing(radius) - _swing(np.array(TIGHT)), 0.0)

    @cached_property
    def _lines(self) -> tuple[dict[int, Array], Array, Array]:
        """Center lines (K, 2) of all lanes in junctions, and the corners of their bounding boxes."""
        lanes = self._lanes
        inside = np.array([lane for group in self._by_junction.values() for lane in group], dtype=np.int64)
        counts = np.maximum((lanes.length[inside] / SAMPLE).astype(np.int64), 1) + 1
        line, number = number_in_groups(counts)
        lane_of = inside[line]
        progress = lanes.length[lane_of] * number / (counts - 1)[line]
        poses = lanes.tables.lane_poses(lane_of, lanes.s(lane_of, progress), np.zeros(len(lane_of)))
        points = np.column_stack([poses.x, poses.y])
        low, high = np.full((len(lanes.keys), 2), np.inf), np.full((len(lanes.keys), 2), -np.inf)
        np.minimum.at(low, lane_of, points)
        np.maximum.at(high, lane_of, points)
        pieces = np.split(points, np.cumsum(counts)[:-1])
        return dict(zip(inside.tolist(), pieces, strict=True)), low, high

    def conflicts(self, passage: list[int], sweep: Sweep) -> set[int]:
        """Return the lanes in conflict with a passage, and those that are swept from it."""
        return {*sweep, *(other for lane in passage for other in self.meeting(lane))}

    def holder(self, name: str, passage: list[int], sweep: Sweep) -> str | None:
        """Return a car that holds a lane in conflict with a passage of `name`, or that is in the way of a sweep."""
        for lane in passage:
            for other, only_fork in self.meeting(lane).items():
                for holder, rear in self.holders.get(other, {}).items():
                    if holder != name and not (only_fork and rear > FORK):
                        return holder
        return self._sweeping(name, passage, sweep)

    def _sweeping(self, name: str, passage: list[int], sweep: Sweep) -> str | None:
        """Return a car that holds lanes and sweeps over the way of `name`, or is in the way of its sweep."""
        ways = {int(self._lanes.backward[passage[0]]), *passage, *self._lanes.following[passage[-1]]}
        for holder, other in self.sweeps.items():
            meets = any(
                other[lane][0] <= sweep[lane][1] and sweep[lane][0] <= other[lane][1] for lane in other.keys() & sweep
            )
            ahead = holder in self.holders.get(passage[0], ())
            if holder != name and not ahead and (meets or not ways.isdisjoint(other)):
                return holder
        for lane, held in self.holders.items() if sweep else ():
            leaves = not sweep.keys().isdisjoint(self._lanes.following[lane])
            enters = int(self._lanes.backward[lane]) in sweep
            end = sweep[lane][1] if lane in sweep else -np.inf
            for holder, rear in held.items():
                if holder != name and (leaves or (enters and rear == -np.inf) or (lane in sweep and rear <= end)):
                    return holder
        return None

    def take(self, lane: int, name: str) -> None:
        """Let `name` hold a lane of a junction. Lanes between the junctions of a passage are not held."""
        if self._lanes.in_junction[lane]:
            self.holders.setdefault(lane, {})[name] = -np.inf

    def holds(self, name: str, lane: int) -> bool:
        """Return whether `name` holds a lane."""
        return name in self.holders.get(lane, ())

    def release(self, name: str, lane: int) -> None:
        """Release a lane that `name` has left."""
        self.holders.get(lane, {}).pop(name, None)
        if name in self.sweeps and not any(name in held for held in self.holders.values()):
            del self.sweeps[name]

    def forget(self, name: str) -> None:
        """Release all lanes that `name` holds."""
        self.sweeps.pop(name, None)
        for held in self.holders.values():
            held.pop(name, None)


def _swing(radius: Array) -> Array:
    """Return the width by which the outer front corner of a van is outside of the path of its rear end [m]."""
    outer = radius + HALF_WIDTH
    return np.asarray(np.hypot(outer, VAN_FRONT) - outer)


AT_REST = 0.1
"""Maximum speed of a car that waits [m/s]."""
PATIENCE = 20.0
"""Waiting time after which a car has priority over others at a junction [s]."""


class RightOfWay:
    """First come, first served; `begins` (N, D) are the distances from each car to its planned lanes [m]."""

    def __init__(self, lanes: TrafficLanes, crossings: Crossings) -> None:
        self._lanes = lanes
        self._crossings = crossings
        self._sweeps = Sweeps(lanes)
        self._requested: list[Sweep] = []
        """Sweeps of the long vehicles that request a passage. Other vehicles do not stop in their ranges."""
        self._set_back: dict[tuple[int, tuple[float, ...]], float] = {}
        """Lengths at the ends of lanes that long bodies sweep over in the junction behind them [m]."""
        self._waits_for: dict[str, str] = {}
        """By the name of a standing car without a passage, the car for which it waited in the last decision."""

    def waits(self, cars: Cars, begins: Array) -> Leaders:
        """Return the stop lines of junctions that cars may not enter yet, and the starts of ranges that are swept."""
        distance = self._distances(cars, begins)
        wait = distance - cars.front - STOP_LINE - self._set_backs(cars, distance)
        lines = replace(Leaders.none(len(cars)), gap=np.maximum(wait, 1e-3))
        swept = [
            (lane, low - STOP_LINE)
            for sweep in (*self._crossings.sweeps.values(), *self._requested)
            for lane, (low, _) in sweep.items()
            if not self._lanes.in_junction[lane]
        ]
        if not swept:
            return lines
        lane, low = np.array([lane for lane, _ in swept]), np.array([low for _, low in swept])
        ranges = Occupants(lane, low, low, low, np.zeros(len(lane)), np.full(len(lane), FIXED))
        starts = find_leaders(self._lanes, cars.plan, cars.progress + cars.front, np.zeros(len(cars)), ranges)
        passes = cars.granted.any(axis=1) | (cars.speed**2 > 2.0 * TOO_LATE * np.maximum(starts.gap, 0.0))
        return lines.or_nearer(replace(starts, gap=np.where(passes, np.inf, starts.gap)))

    def _set_backs(self, cars: Cars, distance: Array) -> Array:
        """Return the lengths (N,) before the next junction over which long vehicles of the fleet may sweep [m]."""
        lengths = np.zeros(len(cars))
        long = [cars.specs[index] for index in np.flatnonzero(cars.front > VAN_FRONT).tolist()]
        bodies = {(*spec.offset, *spec.size): spec for spec in long}
        if not bodies:
            return lengths
        first = np.argmax(self._barred(cars), axis=1)
        for index in np.flatnonzero(np.isfinite(distance)).tolist():
            before, entered = cars.plan[index, first[index] - 1 : first[index] + 1].tolist()
            for body, spec in bodies.items():
                if (before, body) not in self._set_back:
                    sweeps = [self._sweeps.of(spec, [lane]) for lane in self._crossings.in_junction_of(entered)]
                    starts = [sweep[before][0] for sweep in sweeps if before in sweep]
                    self._set_back[before, body] = self._lanes.lengths[before] - min(starts, default=np.inf)
                lengths[index] = max(lengths[index], self._set_back[before, body])
        return lengths

    def grant_right_of_way(
        self,
        cars: Cars,
        leaders: Leaders,
        lights: Leaders,
        begins: Array,
        occupants: Occupants,
        moving: set[int],
        time: float,
    ) -> None:
        """Grant passages through junctions to approaching cars.

        There must be space behind the junction. Lanes in conflict with one of `moving`, which moving foreign actors
        overlap, are not granted, nor are lanes that delay a car with priority. A car that a traffic light stops before
        the junction loses its passage.

        Cars that wait for each other in a circle lose the lanes that they have not reached. They need no space behind
        the next junction and ignore priority, so that the circle moves on.
        """
        self._follow(cars, lights, begins)
        distance, first = self._distances(cars, begins), np.argmax(self._barred(cars), axis=1)
        v = cars.speed
        braking = v * v / (2.0 * cars.drivers.deceleration) + v
        close = distance <= braking + cars.front + 4.0 * STOP_LINE + self._set_backs(cars, distance)
        gap, names = leaders.gap + cars.front, [spec.name for spec in cars.specs]
        circle = self._circle(cars, leaders, names)
        for index in [index for index, name in enumerate(names) if name in circle]:
            self._revoke(cars, index, cars.granted[index] & (begins[index] > cars.front[index]))
        asking = []
        for index in np.flatnonzero(close & (gap > distance)).tolist():
            needed = 0.0 if names[index] in circle else float(cars.front[index] - cars.rear[index]) + STOP_LINE
            passage = self._passage(cars, index, needed)
            behind = distance[index] + self._lanes.length[passage].sum() - cars.rear[index]
            if gap[index] > behind + cars.drivers.standstill_gap[index] or names[index] in circle:
                if np.isnan(cars.asked[index]):
                    cars.asked[index] = time
                asking.append((float(cars.asked[index]), float(distance[index]), names[index], index, passage))
            elif leaders.owner[index] >= 0:
                self._waits_for[names[index]] = names[leaders.owner[index]]
        kept_free: dict[int, str] = {}
        self._requested = []
        for since, _, name, index, passage in sorted(asking):
            sweep = self._sweeps.of(cars.specs[index], passage)
            self._requested.append(sweep)
            owners = self._owners(sweep, occupants, index)
            if owners.size:
                self._waits_for[name] = names[owners[0]] if owners[0] >= 0 else ""
                continue
            holder = self._crossings.holder(name, passage, sweep)
            conflicts = self._crossings.conflicts(passage, sweep)
            prior = {} if name in circle else {lane: kept_free[lane] for lane in conflicts & kept_free.keys()}
            if holder is None and not prior and conflicts.isdisjoint(moving):
                for lane in passage:
                    self._crossings.take(lane, name)
                if sweep:
                    self._crossings.sweeps[name] = sweep
                cars.granted[index, first[index] : first[index] + len(passage)] = True
                if name not in circle:  # Else it keeps its rank until the circle has moved on
                    cars.asked[index] = np.nan
                continue
            self._waits_for[name] = holder or min(prior.values(), default="")
            if time - since > PATIENCE:
                kept_free.update(dict.fromkeys(passage, name))

    def _revoke(self, cars: Cars, index: int, ahead: Bools) -> None:
        """Revoke the lanes `ahead` (D,) of a passage, which the car has not reached."""
        if ahead.any():
            name, plan = cars.specs[index].name, cars.plan[index]
            cars.granted[index] &= ~ahead
            kept = plan[cars.granted[index]].tolist()
            for lane in set(plan[ahead].tolist()).difference(kept):
                self._crossings.release(name, lane)
            if kept and name in self._crossings.sweeps:
                self._crossings.sweeps[name] = self._sweeps.of(cars.specs[index], kept)

    def _circle(self, cars: Cars, leaders: Leaders, names: list[str]) -> set[str]:
        """Return the standing cars that wait for each other in closed circles, and forget for whom cars waited."""
        waits = {}
        for index in np.flatnonzero(cars.speed < AT_REST).tolist():
            behind_leader = leaders.owner[index] >= 0 and leaders.gap[index] < 2.0 * cars.drivers.standstill_gap[index]
            leader = names[leaders.owner[index]] if behind_leader else ""
            waits[names[index]] = self._waits_for.get(names[index], leader)
        self._waits_for = {}
        circle = set(waits)
        while len(after := {waits[name] for name in circle} & waits.keys()) < len(circle):
            circle = after
        return circle

    def _owners(self, sweep: Sweep, occupants: Occupants, index: int) -> Integers:
        """Return the owners that are in a swept range outside the junction, or cannot stop before it."""
        stopping = occupants.front + occupants.speed**2 / (2.0 * TOO_LATE)
        others = (occupants.owner != FIXED) & (occupants.owner != index)
        inside = np.zeros(len(others), dtype=bool)
        for lane, (low, high) in sweep.items():
            if not self._lanes.in_junction[lane]:
                reaches = (stopping > low - STOP_LINE) & (occupants.rear < high + STOP_LINE)
                inside |= (occupants.lane == lane) & reaches
        return np.asarray(occupants.owner[others & inside])

    def _follow(self, cars: Cars, lights: Leaders, begins: Array) -> None:
        """Update the progress of cars in junctions, and revoke passages that a traffic light blocks."""
        for index in np.flatnonzero(cars.granted[:, 0]).tolist():
            held = self._crossings.holders.get(int(cars.plan[index, 0]), {})
            held[cars.specs[index].name] = float(cars.progress[index] + cars.rear[index])
        ahead = cars.granted.any(axis=1) & ~cars.granted[:, 0] & np.isfinite(lights.gap)
        for index in np.flatnonzero(ahead).tolist():
            if lights.gap[index] + cars.front[index] < begins[index, np.argmax(cars.granted[index])]:
                self._crossings.forget(cars.specs[index].name)
                cars.granted[index] = False

    def _distances(self, cars: Cars, begins: Array) -> Array:
        """Return the distances (N,) to the first junction lane that a car may not enter yet [m], else inf."""
        distance = np.where(self._barred(cars), begins, np.inf).min(axis=1)
        return np.where(distance > LOOK_AHEAD, np.inf, distance)

    def _barred(self, cars: Cars) -> Bools:
        """Return which planned lanes (N, D) are in junctions that cars may not enter yet."""
        barred = (cars.plan >= 0) & self._lanes.in_junction[cars.plan] & ~cars.granted & ~cars.walks[:, None]
        barred[:, 0] = False
        return np.asarray(barred)

    def _passage(self, cars: Cars, index: int, needed: float) -> list[int]:
        """Return the lanes of the next junction that a car may not enter yet, up to its last connecting road.

        With less than the length `needed` to stop [m] between this junction and the next one, they are those of both.
        """
        lanes = self._lanes
        passage: list[int] = []
        between: list[int] = []
        for lane, granted in zip(cars.plan[index, 1:].tolist(), cars.granted[index, 1:].tolist(), strict=True):
            if lane >= 0 and lanes.in_junction[lane] and not granted:
                passage += [*between, lane]
                between = []
            elif passage:
                between.append(lane)
                if lane < 0 or granted or sum(lanes.lengths[other] for other in between) >= needed:
                    return passage
        while (ways := lanes.following[passage[-1]]) and lanes.road[ways[0]] == lanes.road[passage[-1]]:
            passage.append(ways[0])
        return passage
