"""Lanes of a road network as a graph, and the search for a route over it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import networkx as nx
import numpy as np

from eidrive_scenario.errors import Diagnostic, InputError
from eidrive_scenario.roads.geometry.poses import lane_at
from eidrive_scenario.roads.geometry.tables import RoadTables
from eidrive_scenario.roads.model.location import LaneKey, LaneLocation
from eidrive_scenario.roads.model.road_map import Lane, LaneSection, Road
from eidrive_scenario.roads.routing.costs import Cost
from eidrive_scenario.roads.routing.links import LaneLinks
from eidrive_scenario.roads.routing.movement import driving_direction

if TYPE_CHECKING:
    LaneGraph = nx.DiGraph[LaneKey]
else:
    LaneGraph = nx.DiGraph

LANE_CHANGE_COST = 10.0
"""Detour that is equivalent to a lane change [m]."""
SHORT_SECTION_COST = 500.0
"""Additional cost of a lane change times the length of the section [m²]: short sections are unsuitable."""
MIN_CHANGE_WIDTH = 1.0
"""Minimum width of a lane in the middle of its section for a lane change to it [m]."""
REACHED_DISTANCE = 0.01
"""Maximum distance of a destination behind the start that counts as reached [m]."""


class RouteError(InputError):
    """No route over the lanes from one location to another exists."""


def build_graph(tables: RoadTables, links: LaneLinks) -> LaneGraph:
    """Return the graph of lanes: nodes LaneKey with `length` [m], `end` (x, y) and `drivable`.

    Edges have `weight` [m] and `kind`, 'successor' or 'change'. Lengths and ends are those of the center lines. An edge
    leads from a lane to its successors in the driving direction and to its neighbors of the same direction.
    """
    graph: LaneGraph = LaneGraph()
    roads = {road.id: road for road in tables.roads}
    directions = {
        (road.id, number): driving_direction(road, number)
        for road in roads.values()
        for section in road.sections
        for number in section.lanes
    }
    for key, row in tables.lane_keys():
        if key.lane:
            graph.add_node(key, drivable=bool(tables.lane_drivable[row]), row=row)
    _measure(graph, tables, directions)
    for key in list(graph):
        length = graph.nodes[key]["length"]
        for other, direction in links.beyond(key, directions[key.road, key.lane]):
            if other in graph and directions[other.road, other.lane] == direction:
                graph.add_edge(key, other, weight=length, kind="successor")
    for road in roads.values():
        for section in road.sections:
            for one, two in _neighbors(section):
                if directions[road.id, one] == directions[road.id, two]:
                    cost = LANE_CHANGE_COST + SHORT_SECTION_COST / max(section.length, 1.0)
                    keys = LaneKey(road.id, section.index, one), LaneKey(road.id, section.index, two)
                    graph.add_edge(*keys, weight=cost, kind="change")
                    graph.add_edge(*reversed(keys), weight=cost, kind="change")
    return graph


def _measure(graph: LaneGraph, tables: RoadTables, directions: Mapping[tuple[str, int], int]) -> None:
    """Set the length of the center line by Gauss-Legendre quadrature and the exit point of each node."""
    keys = list(graph)
    row = np.array([graph.nodes[key].pop("row") for key in keys], dtype=np.int64)
    section = tables.lane_section[row]
    start, span = tables.section_start[section], tables.section_length[section]
    nodes, weights = np.polynomial.legendre.leggauss(7)
    length = np.zeros(len(row))
    for node, weight in zip(nodes.tolist(), weights.tolist(), strict=True):
        length += 0.5 * weight * span * tables.stretch(row, start + 0.5 * (1.0 + node) * span)
    forward = np.array([directions[key.road, key.lane] > 0 for key in keys], dtype=bool)
    ends = tables.lane_poses(row, np.where(forward, start + span, start), np.zeros(len(row)))
    for key, meters, x, y in zip(keys, length.tolist(), ends.x.tolist(), ends.y.tolist(), strict=True):
        graph.nodes[key].update(length=meters, end=(x, y))


def _neighbors(section: LaneSection) -> Iterator[tuple[int, int]]:
    """Yield pairs of adjacent drivable lanes, also across lane 0."""
    lanes = [lane for number, lane in section.lanes.items() if number]
    for one, two in pairwise(lanes):
        if _usable(one, section) and _usable(two, section):
            yield one.id, two.id


def _usable(lane: Lane, section: LaneSection) -> bool:
    return lane.drivable and lane.width.value(0.5 * section.length) >= MIN_CHANGE_WIDTH


def find_lanes(
    graph: LaneGraph, roads: Mapping[str, Road], start: LaneLocation, end: LaneLocation, cost: Cost | None = None
) -> tuple[LaneKey, ...]:
    """Return the lanes of the cheapest route: by A* with the straight distance to the end, by Dijkstra with a `cost`.

    Raise RouteError if there is none.
    """
    source, target = _key(roads, start), _key(roads, end)
    goal = graph.nodes[target]["end"] if target in graph else (0.0, 0.0)
    last = graph.nodes[target]["length"] if target in graph else 0.0

    def bound(key: LaneKey, _: LaneKey) -> float:
        # The cost counts up to the start of the target; lanes of real maps meet within a few centimeters.
        x, y = graph.nodes[LaneKey(*key[:3])]["end"]
        return max(0.99 * (math.hypot(goal[0] - x, goal[1] - y) - last) - 1.0, 0.0)

    behind = (end.s - start.s) * driving_direction(roads[end.road], end.lane) < -REACHED_DISTANCE
    if source[:2] == target[:2] and behind and source in graph:
        graph, source = _with_start_copy(graph, source)
    try:
        found: Sequence[LaneKey]
        if cost is None:
            found = nx.astar_path(graph, source, target, heuristic=bound, weight="weight")
        else:
            found = nx.dijkstra_path(graph, source, target, weight=cost)
    except (nx.NetworkXNoPath, nx.NodeNotFound) as error:
        raise RouteError(
            Diagnostic(
                f"no route over the lanes leads from road {start.road!r} lane {start.lane} s {start.s:.1f} "
                f"to road {end.road!r} lane {end.lane} s {end.s:.1f}",
                "check the direction of the lanes and the links between them",
            )
        ) from error
    return tuple(LaneKey(*key[:3]) for key in found)


def _with_start_copy(graph: LaneGraph, source: LaneKey) -> tuple[LaneGraph, LaneKey]:
    """Return a graph with a copy of the section of the source, which has exits but no entries."""
    copy: LaneGraph = LaneGraph(graph)
    group = [key for key in graph if key[:2] == source[:2]]

    def twin(key: LaneKey) -> LaneKey:
        return _StartLane(*key)

    for key in group:
        for _, other, data in graph.out_edges(key, data=True):
            copy.add_edge(twin(key), twin(other) if data["kind"] == "change" else other, **data)
    return copy, twin(source)


class _StartLane(LaneKey):
    """Part of a lane ahead of the start."""

    __slots__ = ()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _StartLane) and tuple(self) == tuple(other)

    def __hash__(self) -> int:
        return hash(("started", *self))


def _key(roads: Mapping[str, Road], location: LaneLocation) -> LaneKey:
    section, lane = lane_at(roads[location.road], location.lane, location.s)
    return LaneKey(location.road, section.index, lane.id)
