"""Right of way: stop lines of traffic lights, lanes that cross in junctions, and the order of passages.

In junctions: first come, first served, one car at a time on conflicting lanes. The first car of a queue requests all
lanes of its passage through the junction within its braking distance, if there is space behind the junction. They are
granted when no car holds a lane that crosses, merges or diverges. A car holds a lane until it has left it, and against
diverging lanes until it has cleared the fork. Long vehicles hold the lanes that they sweep over as well, and need them
without other vehicles, also outside the junction.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np

from eidrive_scenario.base.arrays import Array, Bools, number_in_groups
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
            if not signal.dynamic:
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
        signal_lanes = [lanes.row_of(LaneKey(road.id, section, number)) for number in lanes.roads.signal_lanes(place)]
        if road.junction_id is not None:
            return [(lane, 0.0) for lane in signal_lanes]
        return [(lane, float(lanes.progress(np.array(lane), np.array(place.s)))) for lane in signal_lanes]

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
        return Leaders(np.where(binding, np.maximum(lines.gap - STOP_LINE, 1e-3), np.inf), lines.speed)


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

    def meeting(self, lane: int) -> dict[int, bool]:
        """Return the lanes in conflict with a lane of a junction. The value is True if they only diverge."""
        if lane in self._meeting:
            return self._meeting[lane]
        lines, low, high = self._lines
        conflicts: dict[int, bool] = {}
        mine = lines[lane]
        points = NearestPoints(mine)
        junction = self._lanes.roads.roads[self._lanes.keys[lane].road].junction_id
        for other in () if junction is None else self._by_junction.get(junction, ()):
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

    def free(self, lane: int, name: str, blocked: set[int]) -> bool:
        """Return True if `name` may hold a lane: no car holds and nothing blocks a lane in conflict with it."""
        for other, only_fork in self.meeting(lane).items():
            if other in blocked:
                return False
            for holder, rear in self.holders.get(other, {}).items():
                if holder != name and not (only_fork and rear > FORK):
                    return False
        return True

    def is_swept(self, name: str, passage: list[int], sweep: Sweep) -> bool:
        """Return whether a long vehicle that holds lanes and `name` would sweep over a lane or each other's way."""
        ways = {int(self._lanes.backward[passage[0]]), *passage, *self._lanes.following[passage[-1]]}
        for holder, other in self.sweeps.items():
            meets = any(
                other[lane][0] <= sweep[lane][1] and sweep[lane][0] <= other[lane][1] for lane in other.keys() & sweep
            )
            if holder != name and (meets or not ways.isdisjoint(other)):
                return True
        for lane, held in self.holders.items() if sweep else ():
            leaves = not sweep.keys().isdisjoint(self._lanes.following[lane])
            enters = int(self._lanes.backward[lane]) in sweep
            end = sweep[lane][1] if lane in sweep else -np.inf
            for holder, rear in held.items():
                if holder != name and (leaves or (enters and rear == -np.inf) or (lane in sweep and rear <= end)):
                    return True
        return False

    def take(self, lane: int, name: str) -> None:
        """Let `name` hold a lane."""
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

    def waits(self, cars: Cars, begins: Array) -> Leaders:
        """Return the stop lines of junctions that cars may not enter yet, and the starts of ranges that are swept."""
        wait = self._distances(cars, begins) - cars.front - STOP_LINE
        lines = Leaders(np.maximum(wait, 1e-3), np.zeros(len(cars)))
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
        return lines.or_nearer(Leaders(np.where(passes, np.inf, starts.gap), starts.speed))

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
        """
        self._follow(cars, lights, begins)
        distance, first = self._distances(cars, begins), np.argmax(self._barred(cars), axis=1)
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
        self._requested = []
        for since, _, name, index, passage in sorted(asking):
            sweep = self._sweeps.of(cars.specs[index], passage)
            self._requested.append(sweep)
            if self._is_occupied(sweep, occupants, index):
                continue
            blocked = moving | kept_free
            if (
                all(self._crossings.free(lane, name, blocked) for lane in passage)
                and blocked.isdisjoint(sweep)
                and not self._crossings.is_swept(name, passage, sweep)
            ):
                for lane in passage:
                    self._crossings.take(lane, name)
                if sweep:
                    self._crossings.sweeps[name] = sweep
                cars.granted[index, first[index] : first[index] + len(passage)] = True
                cars.asked[index] = np.nan
            elif time - since > PATIENCE:
                kept_free.update(passage)

    def _is_occupied(self, sweep: Sweep, occupants: Occupants, index: int) -> bool:
        """Return whether another vehicle is in a swept range outside the junction, or cannot stop before it."""
        stopping = occupants.front + occupants.speed**2 / (2.0 * TOO_LATE)
        others = (occupants.owner != FIXED) & (occupants.owner != index)
        return any(
            np.any(
                others & (occupants.lane == lane) & (stopping > low - STOP_LINE) & (occupants.rear < high + STOP_LINE)
            )
            for lane, (low, high) in sweep.items()
            if not self._lanes.in_junction[lane]
        )

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
        distance = np.where(self._barred(cars), begins, np.inf).min(axis=1)
        return np.where(distance > LOOK_AHEAD, np.inf, distance)

    def _barred(self, cars: Cars) -> Bools:
        """Return which planned lanes (N, D) are in junctions that cars may not enter yet."""
        barred = (cars.plan >= 0) & self._lanes.in_junction[cars.plan] & ~cars.granted & ~cars.walks[:, None]
        barred[:, 0] = False
        return np.asarray(barred)

    def _passage(self, cars: Cars, index: int) -> list[int]:
        """Return the lanes of the next junction that a car may not enter yet, up to its last connecting road."""
        lanes = self._lanes
        passage: list[int] = []
        for lane, granted in zip(cars.plan[index, 1:].tolist(), cars.granted[index, 1:].tolist(), strict=True):
            if lane >= 0 and lanes.in_junction[lane] and not granted:
                passage.append(lane)
            elif passage:
                return passage
        while (ways := lanes.following[passage[-1]]) and lanes.road[ways[0]] == lanes.road[passage[-1]]:
            passage.append(ways[0])
        return passage
