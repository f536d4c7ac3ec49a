"""Distances in road coordinates between places on connected roads."""

from __future__ import annotations

import heapq
from collections.abc import Mapping

from eidrive_scenario.roads.links import LaneLinks
from eidrive_scenario.roads.location import LaneLocation
from eidrive_scenario.roads.model import Road
from eidrive_scenario.roads.movement import driving_direction


class RoadDistances:
    """Shortest ways from road to road along reference lines (Dijkstra), remembered per road and direction."""

    def __init__(self, roads: Mapping[str, Road], links: LaneLinks) -> None:
        self._roads = roads
        self._links = links
        self._found: dict[tuple[str, int], dict[str, tuple[float, int]]] = {}

    def between(self, a: LaneLocation, b: LaneLocation) -> tuple[float, float] | None:
        """How far b lies ahead of a (behind where negative) and to its left, seen in the traffic direction of a's lane.

        Along the reference lines of the shortest chain of roads [m]. None where no chain of roads joins them.
        """
        direction = driving_direction(self._roads[a.road], a.lane)
        if a.road == b.road:
            return (b.s - a.s) * direction, (b.t - a.t) * direction
        options = []
        for sense in (1, -1):
            way = self._from(a.road, direction * sense).get(b.road)
            if way is not None:
                gap, entered = way
                rest = b.s if entered > 0 else self._roads[b.road].length - b.s
                left = self._roads[a.road].length - a.s if direction * sense > 0 else a.s
                across = b.t * entered * sense - a.t * direction
                options.append((left + gap + rest, sense, across))
        if not options:
            return None
        span, sense, across = min(options, key=lambda option: option[0])
        return span * sense, across

    def _from(self, road: str, direction: int) -> dict[str, tuple[float, int]]:
        """For each road reached by leaving `road` in `direction`: metres between the two, and the direction entered."""
        known = self._found.get((road, direction))
        if known is not None:
            return known
        reached: dict[str, tuple[float, int]] = {}
        done: set[tuple[str, int]] = set()
        queue = [(0.0, number, way) for number, way in self._links.beyond_road(road, direction)]
        heapq.heapify(queue)
        while queue:
            gap, number, way = heapq.heappop(queue)
            if (number, way) in done:
                continue
            done.add((number, way))
            reached.setdefault(number, (gap, way))
            beyond = gap + self._roads[number].length
            for other, onward in self._links.beyond_road(number, way):
                if (other, onward) not in done:
                    heapq.heappush(queue, (beyond, other, onward))
        self._found[road, direction] = reached
        return reached
