"""The lanes of a road network as a graph, and the way from place to place over it."""

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
"""Meters of detour that a lane change is worth."""
HASTE_COST = 500.0
"""A lane change within a section of L meters costs this / L meters more: short sections are bad places for it."""
NARROWEST = 1.0
"""A lane must be this wide in the middle of its section to change to it [m]."""
HERE = 0.01
"""A destination that lies behind by less than this is reached without going round [m]."""


class RouteError(InputError):
    """There is no way over the lanes from one place to another."""


def build_graph(tables: RoadTables, links: LaneLinks) -> LaneGraph:
    """Nodes LaneKey with `length` [m], `end` (x, y) and `drivable`; edges with `weight` [m] and `kind`.

    The kind of an edge is 'successor' or 'change'; lengths and ends are those of the lanes' center lines.

    An edge leads from a lane to the lanes that traffic enters at its end, and to its neighbors of the same direction.
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
                    cost = LANE_CHANGE_COST + HASTE_COST / max(section.length, 1.0)
                    keys = LaneKey(road.id, section.index, one), LaneKey(road.id, section.index, two)
                    graph.add_edge(*keys, weight=cost, kind="change")
                    graph.add_edge(*reversed(keys), weight=cost, kind="change")
    return graph


def _measure(graph: LaneGraph, tables: RoadTables, directions: Mapping[tuple[str, int], int]) -> None:
    """Give each node the length of its center line, by Gauss-Legendre quadrature, and where traffic leaves it."""
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
    """Yield pairs of drivable lanes side by side, across lane 0 too."""
    lanes = [lane for number, lane in section.lanes.items() if number]
    for one, two in pairwise(lanes):
        if _usable(one, section) and _usable(two, section):
            yield one.id, two.id


def _usable(lane: Lane, section: LaneSection) -> bool:
    return lane.drivable and lane.width.value(0.5 * section.length) >= NARROWEST


def find_lanes(
    graph: LaneGraph, roads: Mapping[str, Road], start: LaneLocation, end: LaneLocation, cost: Cost | None = None
) -> tuple[LaneKey, ...]:
    """Return the lanes of the cheapest way: by A*, the straight line to the end as the bound; by Dijkstra with a `cost`.

    Raise RouteError.
    """
    source, target = _key(roads, start), _key(roads, end)
    goal = graph.nodes[target]["end"] if target in graph else (0.0, 0.0)
    last = graph.nodes[target]["length"] if target in graph else 0.0

    def bound(key: LaneKey, _: LaneKey) -> float:
        # The way counts up to where the target begins; lanes of real maps meet to within a few centimeters.
        x, y = graph.nodes[LaneKey(*key[:3])]["end"]
        return max(0.99 * (math.hypot(goal[0] - x, goal[1] - y) - last) - 1.0, 0.0)

    behind = (end.s - start.s) * driving_direction(roads[end.road], end.lane) < -HERE
    if source[:2] == target[:2] and behind and source in graph:
        graph, source = _started(graph, source)
    try:
        found: Sequence[LaneKey]
        if cost is None:
            found = nx.astar_path(graph, source, target, heuristic=bound, weight="weight")
        else:
            found = nx.dijkstra_path(graph, source, target, weight=cost)
    except (nx.NetworkXNoPath, nx.NodeNotFound) as error:
        raise RouteError(
            Diagnostic(
                f"no way over the lanes from road {start.road!r} lane {start.lane} s {start.s:.1f} "
                f"to road {end.road!r} lane {end.lane} s {end.s:.1f}",
                "check the direction of the lanes and the links between them",
            )
        ) from error
    return tuple(LaneKey(*key[:3]) for key in found)


def _started(graph: LaneGraph, source: LaneKey) -> tuple[LaneGraph, LaneKey]:
    """Return a graph with a second copy of the source's section: one that can be left, but not yet reached as a target."""
    copy: LaneGraph = LaneGraph(graph)
    group = [key for key in graph if key[:2] == source[:2]]

    def twin(key: LaneKey) -> LaneKey:
        return _Started(*key)

    for key in group:
        for _, other, data in graph.out_edges(key, data=True):
            copy.add_edge(twin(key), twin(other) if data["kind"] == "change" else other, **data)
    return copy, twin(source)


class _Started(LaneKey):
    """The part of a lane ahead of the start."""

    __slots__ = ()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Started) and tuple(self) == tuple(other)

    def __hash__(self) -> int:
        return hash(("started", *self))


def _key(roads: Mapping[str, Road], location: LaneLocation) -> LaneKey:
    section, lane = lane_at(roads[location.road], location.lane, location.s)
    return LaneKey(location.road, section.index, lane.id)
