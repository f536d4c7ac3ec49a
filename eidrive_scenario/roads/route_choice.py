"""Choice of a route: its costs, and the lanes of its waypoints where several overlap.

Routes have the length as cost, or one of the costs here: travel time, junctions, random factors.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cache
from operator import itemgetter
from typing import Any, NamedTuple

import numpy as np

from eidrive_scenario.roads.model.location import LaneKey, LaneLocation
from eidrive_scenario.roads.network import RoadNetwork
from eidrive_scenario.roads.routing.graph import JUNCTION_COST, Cost, RouteError

AS_NEAR = 0.5
"""Maximum difference of the distances of lane centers from a waypoint that may be on any of them [m]."""
MAX_FACTOR = 10.0
"""Maximum factor by which a random cost exceeds the length."""


def fastest(network: RoadNetwork) -> Cost:
    """Return the travel time at the speed limits [s] as cost."""
    usual_speed = cache(network.usual_speed_in)

    def cost(lane: LaneKey, _: LaneKey, data: Mapping[str, Any]) -> float:
        return float(data["weight"]) / usual_speed(LaneKey(*lane[:3]))

    return cost


def fewest_junctions(network: RoadNetwork) -> Cost:
    """Return a cost by which a junction counts more than any length.

    Routes with equally many junctions are ordered by length.
    """

    def cost(lane: LaneKey, following: LaneKey, data: Mapping[str, Any]) -> float:
        before, after = network.road(lane.road).junction_id, network.road(following.road).junction_id
        return float(data["weight"]) + (JUNCTION_COST if after is not None and after != before else 0.0)

    return cost


def random_costs(network: RoadNetwork, generator: np.random.Generator) -> Cost:
    """Return the length times a random factor of each road as cost [m], so that different draws select different
    routes.
    """
    names = sorted(network.roads)  # the order in the file has no effect
    draws = generator.uniform(0.0, math.log(MAX_FACTOR), len(names)).tolist()
    factors = {road: math.exp(draw) for road, draw in zip(names, draws, strict=True)}

    def cost(lane: LaneKey, _: LaneKey, data: Mapping[str, Any]) -> float:
        return float(data["weight"]) * factors[lane.road]

    return cost


def lanes_near(roads: RoadNetwork, location: LaneLocation, *, on_all_levels: bool = False) -> list[LaneLocation]:
    """Return a location, and those on other lanes for vehicles that overlap there and whose centers are as near.

    The lanes are on the level of the location, as in its junction, or `on_all_levels`, as on and below a bridge.
    """
    if roads.road(location.road).junction_id is None and (roads.is_level or not on_all_levels):
        return [location]
    x, y, z, *_ = roads.pose(location)
    lanes = [lane for lane in roads.locations_at(x, y, None if on_all_levels else z) if roads.lane(lane).drivable]
    limit = AS_NEAR + min((abs(lane.offset) for lane in lanes), default=0.0)
    return [location, *(lane for lane in lanes if lane[:2] != location[:2] and abs(lane.offset) <= limit)]


def select_lanes(
    roads: RoadNetwork,
    places: Sequence[Sequence[LaneLocation]],
    costs: Sequence[Cost | None] | None = None,
    *,
    against_traffic: bool = False,
) -> list[LaneLocation]:
    """Return a lane location at each place, such that the route through them is the shortest.

    places  locations from which to select; of equally short routes, that of the first ones is selected
    costs   cost functions of the legs, as of `RoadNetwork.route`
    """
    if all(len(lanes) == 1 for lanes in places):
        return [lanes[0] for lanes in places]

    def length(a: LaneLocation, b: LaneLocation, cost: Cost | None) -> float:
        try:
            return roads.route(a, b, costs=[cost], against_traffic=against_traffic).reference_length
        except RouteError:
            return math.inf

    # The shortest ways to each lane of a place extend those to the lanes of the place before.
    ways: list[tuple[float, _Way]] = [(0.0, _Way(lane)) for lane in places[0]]
    for lanes, cost in zip(places[1:], costs or [None] * len(places), strict=False):
        if len(ways) == len(lanes) == 1:
            ways = [(0.0, _Way(lanes[0], ways[0][1]))]
            continue
        ways = [
            min(((done + length(way.lane, lane, cost), _Way(lane, way)) for done, way in ways), key=itemgetter(0))
            for lane in lanes
        ]
    selected: list[LaneLocation] = []
    step: _Way | None = min(ways, key=itemgetter(0))[1]
    while step is not None:
        selected.append(step.lane)
        step = step.before
    return selected[::-1]


class _Way(NamedTuple):
    """Way to a lane, over the lanes of the places before."""

    lane: LaneLocation
    before: _Way | None = None
