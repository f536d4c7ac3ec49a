"""Distances in road coordinates between locations on connected roads, and the search near a previous location."""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Iterator, Mapping
from typing import Literal, NamedTuple

from eidrive_scenario.roads.geometry import poses
from eidrive_scenario.roads.model.location import LaneKey, LaneLocation
from eidrive_scenario.roads.model.road_map import Road
from eidrive_scenario.roads.routing.graph import JUNCTION_COST
from eidrive_scenario.roads.routing.links import LaneLinks
from eidrive_scenario.roads.routing.movement import Movement, default_rank

Chain = Literal["shortest", "fastest", "leastIntersections"]
"""Criterion that selects the chain of roads of a distance."""


class RoadDistances:
    """Shortest chains of roads along reference lines; their search is kept per road and direction."""

    def __init__(self, roads: Mapping[str, Road], links: LaneLinks, speed: Callable[[str], float]) -> None:
        """Store the roads. `speed` returns the assumed speed of a road for the fastest chain [m/s]."""
        self._roads = roads
        self._links = links
        self._speed = speed
        self._searches: dict[tuple[str, int, Chain], _Search] = {}

    def between(
        self, a: LaneLocation, b: LaneLocation, by: Chain = "shortest", only: int = 0
    ) -> tuple[float, float] | None:
        """Return the distances from a to b ahead and to the left in the driving direction of the lane of a [m].

        They are measured along the reference lines of the chain of roads that `by` selects. Behind and right are
        negative. The result is None if no chain of roads connects the locations.

        only  1 for ways ahead only, -1 for ways behind
        """
        placed = self.placed(a, b, by, only)
        return None if placed is None else placed[:2]

    def placed(
        self, a: LaneLocation, b: LaneLocation, by: Chain = "shortest", only: int = 0
    ) -> tuple[float, float, int] | None:
        """Return `between`, and +1 if s of both roads increases in the same direction along the chain, else -1."""
        direction = self._roads[a.road].driving_direction(a.lane)
        options: list[tuple[float, float, int, float, int]] = []
        if a.road == b.road:
            ahead, left_of_a = (b.s - a.s) * direction, (b.t - a.t) * direction
            sense = 1 if ahead > 0.0 else -1
            is_shortest = 2.0 * abs(ahead) <= self._roads[a.road].length  # as the way around a closed track is longer
            if is_shortest and only * ahead >= 0.0:
                return ahead, left_of_a, 1
            if only in (0, sense):
                options.append((abs(ahead) * self._per_meter(a.road, by), abs(ahead), sense, left_of_a, 1))
        rest = {1: b.s, -1: self._roads[b.road].length - b.s}
        rest_costs = {entered: meters * self._per_meter(b.road, by) for entered, meters in rest.items()}
        for sense in (only,) if only else (1, -1):
            left = self._roads[a.road].length - a.s if direction * sense > 0 else a.s
            left_cost = left * self._per_meter(a.road, by)
            least = min((option[0] for option in options), default=math.inf)
            entry = self._search(a.road, direction * sense, by).best_entry(b.road, rest_costs, least - left_cost)
            if entry is not None:
                cost, gap, entered = entry
                across = b.t * entered * sense - a.t * direction
                cost += left_cost + rest_costs[entered]
                options.append((cost, left + gap + rest[entered], sense, across, entered * direction * sense))
        if not options:
            return None
        _, span, sense, across, same = min(options, key=lambda option: option[0])
        return span * sense, across, same

    def _per_meter(self, road: str, by: Chain) -> float:
        return 1.0 / self._speed(road) if by == "fastest" else 1.0

    def _entering(self, before: str, road: str, by: Chain) -> float:
        junction = self._roads[road].junction_id
        enters = junction is not None and junction != self._roads[before].junction_id
        return JUNCTION_COST if by == "leastIntersections" and enters else 0.0

    def _search(self, road: str, direction: int, by: Chain) -> _Search:
        search = self._searches.get((road, direction, by))
        if search is None:
            search = self._searches[road, direction, by] = _Search(self._from(road, direction, by))
        return search

    def _from(self, road: str, direction: int, by: Chain) -> Iterator[tuple[str, _Entry]]:
        """Yield the entries of roads from `road` in `direction` in the order of their costs (Dijkstra's algorithm)."""
        done: set[tuple[str, int]] = set()
        first = self._links.beyond_road(road, direction)
        queue = [(self._entering(road, number, by), 0.0, number, way) for number, way in first]
        heapq.heapify(queue)
        while queue:
            cost, gap, number, way = heapq.heappop(queue)
            if (number, way) in done:
                continue
            done.add((number, way))
            yield number, _Entry(cost, gap, way)
            length = self._roads[number].length
            cost += length * self._per_meter(number, by)
            for other, onward in self._links.beyond_road(number, way):
                if (other, onward) not in done:
                    heapq.heappush(queue, (cost + self._entering(number, other, by), gap + length, other, onward))


class _Entry(NamedTuple):
    """Entry of a road: its cost, the length of the roads before it [m], and its direction, +1 along s, else -1."""

    cost: float
    gap: float
    direction: int


class _Search:
    """Search for roads, continued as far as the requests need; `entries` yields them in the order of their costs."""

    def __init__(self, entries: Iterator[tuple[str, _Entry]]) -> None:
        self._entries = entries
        self._reached: dict[str, list[_Entry]] = {}
        self._cost = 0.0
        """Cost of the last entry; no later one costs less."""

    def best_entry(self, road: str, rest: Mapping[int, float], limit: float) -> _Entry | None:
        """Return the entry of a road that leads to a location on it at the least cost; None without one below `limit`.

        A road can be entered at both ends.

        rest  costs on the road up to the location, by the direction of entry
        """
        reached = self._reached.setdefault(road, [])
        limit = min(limit, *(entry.cost + rest[entry.direction] for entry in reached), math.inf)
        while self._cost < limit:
            number, entry = next(self._entries, ("", None))
            if entry is None:
                self._cost = math.inf
                break
            self._cost = entry.cost
            self._reached.setdefault(number, []).append(entry)
            if number == road:
                limit = min(limit, entry.cost + rest[entry.direction])
        return min(reached, key=lambda entry: entry.cost + rest[entry.direction], default=None)


def locate_near(
    roads: Mapping[str, Road], links: LaneLinks, movement: Movement, x: float, y: float, hint: LaneLocation
) -> LaneLocation | None:
    """Return the lane location of a point on the road of `hint` or on an adjacent one, or None if it is on neither.

    Where several adjacent roads overlap, it is on that of the default route.
    """
    road = roads[hint.road]
    location = _on(road, x, y, hint.s)
    if location is not None:
        return location
    ahead = road.driving_direction(hint.lane)
    here = LaneKey(road.id, road.section_at(hint.s).index, hint.lane)
    for direction in (ahead, -ahead):
        last = len(road.sections) - 1 if direction > 0 else 0
        lane = links.continued(here, road.id, last)
        fork = movement.fork(LaneKey(road.id, last, lane), direction) if lane else ()
        for branch in sorted(fork, key=lambda branch: default_rank(branch.turn, road)):
            target = roads[branch.lane.road]
            adjacent = _on(target, x, y, 0.0 if branch.direction > 0 else target.length)
            if adjacent is not None:
                return adjacent
    return None


def _on(road: Road, x: float, y: float, s: float) -> LaneLocation | None:
    s, t, beyond = poses.project(road, x, y, s)
    if beyond:
        return None
    section, lane, outside = poses.lane_beside(road, s, t)
    if outside:
        return None
    return LaneLocation(road.id, lane.id, s, t - poses.lane_t(road, section, lane, s)[0], t)
