"""Areas of traffic: polygons, and ranges of roads between cursors."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from eidrive_scenario.arrays import Bools
from eidrive_scenario.errors import Diagnostic
from eidrive_scenario.geometry import points_in_polygon
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.roads.model.location import PositionError
from eidrive_scenario.roads.routing.links import RoadEnd
from eidrive_scenario.traffic.lanes import TrafficLanes
from eidrive_scenario.traffic.spawning.sites import Covers, SpawnSites


@dataclass(frozen=True)
class Cursor:
    """Cross section of a road at s [m]; s is None for the start or end of the road; lanes () for all lanes."""

    road: str
    s: float | None = None
    lanes: tuple[int, ...] = ()


@dataclass(frozen=True)
class Stretch:
    """Part of a road from `low` to `high` [m]; lanes () for all lanes."""

    road: str
    low: float
    high: float
    lanes: tuple[int, ...] = ()


def polygon(corners: Sequence[tuple[float, float]]) -> Covers:
    """Return a test whether sites are inside a polygon."""
    outline = np.array(corners)
    return lambda sites: points_in_polygon(np.column_stack([sites.x, sites.y]), outline)


def stretches_cover(lanes: TrafficLanes, stretches: Sequence[Stretch]) -> Covers:
    """Return a test whether sites are on one of several parts of roads."""

    def covers(sites: SpawnSites) -> Bools:
        found = np.zeros(len(sites), dtype=bool)
        s, road, number = lanes.s(sites.row, sites.progress), lanes.road[sites.row], lanes.tables.lane_id[sites.row]
        for stretch in stretches:
            here = (road == lanes.tables.index[stretch.road]) & (s >= stretch.low) & (s <= stretch.high)
            found |= here & np.isin(number, stretch.lanes) if stretch.lanes else here
        return found

    return covers


def road_range(roads: RoadNetwork, cursors: Sequence[Cursor], length: float | None = None) -> list[Stretch]:
    """Return the parts of roads from the first cursor over the others to the last one.

    The lanes of a cursor are valid up to the next cursor. Between cursors on different roads the range follows the
    shortest chain of linked roads with all their lanes. `length` truncates the range from the first cursor on [m].
    Raise PositionError if a road does not exist or the roads are not linked.
    """
    ends = _links(roads)
    parts: list[tuple[Stretch, bool]] = []
    for number, (one, two) in enumerate(pairwise(cursors)):
        first, last = roads.road(one.road).length, roads.road(two.road).length
        here = one.s if one.s is not None else 0.0 if number == 0 else first
        there = two.s if two.s is not None else last
        if one.road == two.road:
            parts.append((Stretch(one.road, min(here, there), max(here, there), one.lanes), there >= here))
            continue
        chain = _chain(ends, one.road, two.road)
        leaving, *between, entering = chain
        forward = leaving.side > 0
        if one.s is None and number == 0 and not forward:
            here = first
        parts.append((Stretch(one.road, here if forward else 0.0, first if forward else here, one.lanes), forward))
        for entry in between[::2]:
            whole = roads.road(entry.road).length
            parts.append((Stretch(entry.road, 0.0, whole), entry.side < 0))
        forward = entering.side < 0
        if two.s is None and number == len(cursors) - 2 and not forward:
            there = 0.0
        parts.append((Stretch(two.road, 0.0 if forward else there, there if forward else last, two.lanes), forward))
    return _cut(parts, length)


def _cut(parts: Sequence[tuple[Stretch, bool]], length: float | None) -> list[Stretch]:
    found, left = [], np.inf if length is None else length
    for stretch, forward in parts:
        span = min(stretch.high - stretch.low, left)
        low = stretch.low if forward else stretch.high - span
        found.append(Stretch(stretch.road, low, low + span, stretch.lanes))
        left -= span
        if left <= 0.0:
            break
    return found


def _links(roads: RoadNetwork) -> Mapping[RoadEnd, list[RoadEnd]]:
    """Return the connected ends of roads by the links of lanes."""
    found: dict[RoadEnd, list[RoadEnd]] = {}
    for one, two, edge in roads.graph.edges(data=True):
        if edge["kind"] == "successor" and one.road != two.road:
            leaving = RoadEnd(one.road, roads.driving_direction(one.road, one.lane))
            entering = RoadEnd(two.road, -roads.driving_direction(two.road, two.lane))
            for a, b in ((leaving, entering), (entering, leaving)):
                if b not in found.setdefault(a, []):
                    found[a].append(b)
    return found


def _chain(ends: Mapping[RoadEnd, list[RoadEnd]], start: str, goal: str) -> list[RoadEnd]:
    """Return the road ends from the exit of `start` to the entry of `goal`; roads between have two consecutive ends."""
    queue = deque([[RoadEnd(start, 1)], [RoadEnd(start, -1)]])
    seen = {RoadEnd(start, 1), RoadEnd(start, -1)}
    while queue:
        chain = queue.popleft()
        for entry in ends.get(chain[-1], ()):
            if entry.road == goal:
                return [*chain, entry]
            if entry not in seen:
                other = RoadEnd(entry.road, -entry.side)
                seen |= {entry, other}
                queue.append([*chain, entry, other])
    raise PositionError(
        Diagnostic(f"no chain of roads leads from road {start!r} to road {goal!r}", "correct the road cursors")
    )
