"""Lanes of a road network as a graph, and the search for a route over it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from heapq import heappop, heappush
from itertools import count, pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from eidrive_scenario.errors import Diagnostic, InputError
from eidrive_scenario.roads.geometry.poses import lane_at
from eidrive_scenario.roads.geometry.tables import RoadTables
from eidrive_scenario.roads.model.location import LaneKey, LaneLocation
from eidrive_scenario.roads.model.road_map import Road
from eidrive_scenario.roads.routing.links import LaneLinks

Cost = Callable[[LaneKey, LaneKey, Mapping[str, Any]], float]
"""Cost of an edge of the lane graph: lane, following lane, data of the edge."""


if TYPE_CHECKING:
    import networkx as nx

    LaneGraph = nx.DiGraph[LaneKey]

Successors = Mapping[LaneKey, Mapping[LaneKey, Mapping[str, Any]]]
"""Data of the edges of each lane, by the lane that they lead to."""

LANE_CHANGE_COST = 10.0
"""Detour that is equivalent to a lane change [m]."""
SHORT_SECTION_COST = 500.0
"""Additional cost of a lane change times the length of the section [m²]: short sections are unsuitable."""
JUNCTION_COST = 1e6
"""Cost of entering a junction where the fewest junctions are requested [m]; longer than any route."""
MIN_CHANGE_WIDTH = 1.0
"""Minimum width of a lane in the middle of its section for a lane change to it [m]."""
RESOLUTION = 1e-6
"""Unit of costs, far more than rounding errors: routes of equal sums are equally cheap [m, or unit of the cost]."""
HIGHEST = 1e12
"""Maximum cost of an edge, above those of all routes; higher ones count as equal."""
REACHED_DISTANCE = 0.01
"""Maximum distance of a destination behind the start that counts as reached [m]."""


class RouteError(InputError):
    """No route over the lanes from one location to another exists."""


@dataclass(frozen=True)
class LaneWays:
    """Lanes and the edges between them as dictionaries, for the search of routes.

    nodes       `length` of each lane [m], its `end` (x, y) and `drivable`
    successors  data of the edges of each lane, by the lane that they lead to: `weight` [m] and `kind`, 'successor' or
                'change'

    Lengths and ends are those of the center lines. An edge leads from a lane to its successors in the driving
    direction and to its neighbors of the same direction.
    """

    nodes: dict[LaneKey, dict[str, Any]]
    successors: dict[LaneKey, dict[LaneKey, dict[str, Any]]]

    def as_graph(self) -> LaneGraph:
        """Return the same as a graph with the data of nodes and edges."""
        import networkx as nx

        graph: LaneGraph = nx.DiGraph()
        graph.add_nodes_from(self.nodes.items())
        graph.add_edges_from(
            (lane, other, data) for lane, ways in self.successors.items() for other, data in ways.items()
        )
        return graph


def build_ways(tables: RoadTables, links: LaneLinks) -> LaneWays:
    """Return the lanes of a road network and the edges between them."""
    rows = {key: row for row, key in enumerate(tables.lane_keys) if key.lane}
    directions = {key: tables.by_id[key.road].directions[key.lane] for key in rows}
    nodes = _measure(rows, tables, directions)
    successors: dict[LaneKey, dict[LaneKey, dict[str, Any]]] = {key: {} for key in nodes}
    for key, data in nodes.items():
        for other, direction in links.beyond(key, directions[key]):
            if directions.get(other) == direction:
                successors[key][other] = {"weight": data["length"], "kind": "successor"}
    for road in tables.roads:
        for section in road.sections:
            middle = 0.5 * section.length
            # A lane without a width separates no others.
            lanes = {n: lane for n, lane in section.lanes.items() if n and not lane.width.is_zero}
            wide = {n: lane.drivable and lane.width.value(middle) >= MIN_CHANGE_WIDTH for n, lane in lanes.items()}
            for lane, neighbor in pairwise(lanes):  # also across lane 0
                if wide[lane] and wide[neighbor] and road.directions[lane] == road.directions[neighbor]:
                    cost = LANE_CHANGE_COST + SHORT_SECTION_COST / max(section.length, 1.0)
                    left, right = LaneKey(road.id, section.index, lane), LaneKey(road.id, section.index, neighbor)
                    successors[left][right] = {"weight": cost, "kind": "change"}
                    successors[right][left] = {"weight": cost, "kind": "change"}
    return LaneWays(nodes, successors)


def _measure(
    rows: Mapping[LaneKey, int], tables: RoadTables, directions: Mapping[LaneKey, int]
) -> dict[LaneKey, dict[str, Any]]:
    """Return the data of lanes; the length of the center line is found by Gauss-Legendre quadrature."""
    row = np.array(list(rows.values()), dtype=np.int64)
    section = tables.lane_section[row]
    start, span = tables.section_start[section], tables.section_length[section]
    nodes, weights = np.polynomial.legendre.leggauss(7)
    length = np.zeros(len(row))
    for node, weight in zip(nodes.tolist(), weights.tolist(), strict=True):
        length += 0.5 * weight * span * tables.stretch(row, start + 0.5 * (1.0 + node) * span)
    forward = np.array([direction > 0 for direction in directions.values()], dtype=bool)
    ends = tables.lane_poses(row, np.where(forward, start + span, start), np.zeros(len(row)))
    measured = zip(
        rows, tables.lane_drivable[row].tolist(), length.tolist(), ends.x.tolist(), ends.y.tolist(), strict=True
    )
    return {key: {"drivable": drivable, "length": meters, "end": (x, y)} for key, drivable, meters, x, y in measured}


def find_lanes(
    ways: LaneWays, roads: Mapping[str, Road], start: LaneLocation, end: LaneLocation, cost: Cost | None = None
) -> tuple[LaneKey, ...]:
    """Return the lanes of the cheapest route: by A* with the straight distance to the end, by Dijkstra with a `cost`.

    Raise RouteError if there is none.
    """
    source, target = lane_key(roads, start), lane_key(roads, end)
    successors: Successors = ways.successors
    goal = ways.nodes[target]["end"] if target in ways.nodes else (0.0, 0.0)
    last = ways.nodes[target]["length"] if target in ways.nodes else 0.0

    def bound(key: LaneKey) -> float:
        # The cost counts up to the start of the target; lanes of real maps meet within a few centimeters.
        x, y = ways.nodes[LaneKey(*key[:3])]["end"]
        return max(0.99 * (math.hypot(goal[0] - x, goal[1] - y) - last) - 1.0, 0.0)

    behind = (end.s - start.s) * roads[end.road].driving_direction(end.lane) < -REACHED_DISTANCE
    if source[:2] == target[:2] and behind and source in successors:
        successors, source = _with_start_copy(successors, source)
    path = None
    if source in successors and target in successors:
        path = cheapest_path(successors, source, target, cost, bound if cost is None else None)
    if path is None:
        ends = " to ".join(f"road {place.road!r} lane {place.lane} s {place.s:.1f}" for place in (start, end))
        hint = "check the direction of the lanes and the links between them"
        raise RouteError(Diagnostic(f"no route over the lanes leads from {ends}", hint))
    return tuple(LaneKey(*key[:3]) for key in path)


def cheapest_path(
    successors: Successors,
    source: LaneKey,
    target: LaneKey,
    cost: Cost | None = None,
    bound: Callable[[LaneKey], float] | None = None,
) -> list[LaneKey] | None:
    """Return the cheapest path by A* (Hart, Nilsson and Raphael 1968); None if no path exists.

    cost   cost of an edge; by default its weight
    bound  lower bound of the cost from a node to the target; None: 0, as by Dijkstra

    Costs are sums of whole multiples of RESOLUTION, which rounding does not affect. Of the paths with equal costs, the
    one with the earliest lane changes is chosen, then that of the lowest road ids from the end: the result depends
    neither on the order of the edges nor on `bound`.
    """
    numbers = count()
    waiting: list[tuple[float, int, int, LaneKey]] = [(0.0, next(numbers), 0, source)]
    least = {source: 0}
    origins: dict[LaneKey, LaneKey] = {}
    # Nodes of all cheapest paths have estimates of at most the cost of the target.
    while waiting and waiting[0][0] <= least.get(target, math.inf):
        _, _, length, key = heappop(waiting)
        if length > least[key]:
            continue
        for other, data in successors[key].items():
            edge = min(data["weight"] if cost is None else cost(key, other, data), HIGHEST)
            longer = length + max(round(edge / RESOLUTION), 1)  # no edge is free: a path has no cycles
            before = least.get(other, math.inf)
            if longer < before:
                least[other], origins[other] = longer, key
                estimate = longer if bound is None else longer + bound(other) / RESOLUTION
                heappush(waiting, (estimate, next(numbers), longer, other))
            elif longer == before:
                origins[other] = min(origins[other], key, key=lambda origin: (origin[:2] == other[:2], origin))
    if target not in least:
        return None
    path = [target]
    while (origin := origins.get(path[-1])) is not None:
        path.append(origin)
    return path[::-1]


def _with_start_copy(successors: Successors, source: LaneKey) -> tuple[Successors, LaneKey]:
    """Return the edges with a copy of the section of the source, which has exits but no entries."""

    def twin(key: LaneKey) -> LaneKey:
        return _StartLane(*key)

    copies = {
        twin(key): {twin(other) if data["kind"] == "change" else other: data for other, data in edges.items()}
        for key, edges in successors.items()
        if key[:2] == source[:2]
    }
    return {**successors, **copies}, twin(source)


class _StartLane(LaneKey):
    """Part of a lane ahead of the start."""

    __slots__ = ()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _StartLane) and tuple(self) == tuple(other)

    def __hash__(self) -> int:
        return hash(("started", *self))


def lane_key(roads: Mapping[str, Road], location: LaneLocation) -> LaneKey:
    """Return the lane of a location. Raise PositionError if it does not exist."""
    section, lane = lane_at(roads[location.road], location.lane, location.s)
    return LaneKey(location.road, section.index, lane.id)
