"""What a way over the lanes may cost, other than its length: time, junctions, or chance."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from eidrive_scenario.roads.location import LaneKey

if TYPE_CHECKING:
    import numpy as np

    from eidrive_scenario.roads.network import RoadNetwork

Cost = Callable[[LaneKey, LaneKey, Mapping[str, Any]], float]
"""What an edge of the lane graph costs, given its two lanes and its data."""

USUAL_SPEED = 50.0 / 3.6
"""With which a road counts whose speed limit the map does not say [m/s]."""
FREE_SPEED = 130.0 / 3.6
"""With which a road counts that has no limit [m/s]."""
JUNCTION_COST = 1e6
"""Metres of detour that a junction is worth to who wants the fewest of them: more than any way has."""
MOST_UNLIKELY = 10.0
"""The largest factor by which chance makes a road seem longer than it is."""


def speed_on(network: RoadNetwork, road: str, s: float, lane: int | None = None) -> float:
    """The speed with which a place on the road counts [m/s]."""
    limit = network.speed_limit(road, s, lane)
    return USUAL_SPEED if not limit else min(limit, FREE_SPEED)


def fastest(network: RoadNetwork) -> Cost:
    """Seconds at the speed limits."""
    known: dict[LaneKey, float] = {}

    def cost(one: LaneKey, _: LaneKey, data: Mapping[str, Any]) -> float:
        key = LaneKey(*one[:3])
        if key not in known:
            section = network.road(key.road).sections[key.section]
            known[key] = speed_on(network, key.road, 0.5 * (section.s + section.end), key.lane)
        return float(data["weight"]) / known[key]

    return cost


def fewest_junctions(network: RoadNetwork) -> Cost:
    """Each junction that is entered counts more than any length; among equals the shortest way."""

    def cost(one: LaneKey, other: LaneKey, data: Mapping[str, Any]) -> float:
        before, after = network.road(one.road).junction_id, network.road(other.road).junction_id
        return float(data["weight"]) + (JUNCTION_COST if after is not None and after != before else 0.0)

    return cost


def random_costs(network: RoadNetwork, generator: np.random.Generator) -> Cost:
    """Metres, each road's times a factor that the generator draws: now one way is the cheapest, now another."""
    draws = generator.uniform(0.0, math.log(MOST_UNLIKELY), len(network.roads)).tolist()
    factors = {road: math.exp(draw) for road, draw in zip(network.roads, draws, strict=True)}

    def cost(one: LaneKey, _: LaneKey, data: Mapping[str, Any]) -> float:
        return float(data["weight"]) * factors[one.road]

    return cost
