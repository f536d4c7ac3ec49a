"""Costs of routes other than length: travel time, junctions, random factors."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from eidrive_scenario.roads.model.location import LaneKey
from eidrive_scenario.roads.network import RoadNetwork
from eidrive_scenario.roads.routing.costs import JUNCTION_COST, Cost

MAX_FACTOR = 10.0
"""Maximum factor by which a random cost exceeds the length."""


def fastest(network: RoadNetwork) -> Cost:
    """Return the travel time at the speed limits [s] as cost."""
    known: dict[LaneKey, float] = {}

    def cost(one: LaneKey, _: LaneKey, data: Mapping[str, Any]) -> float:
        key = LaneKey(*one[:3])
        if key not in known:
            known[key] = network.usual_speed(key)
        return float(data["weight"]) / known[key]

    return cost


def fewest_junctions(network: RoadNetwork) -> Cost:
    """Return a cost by which a junction counts more than any length.

    Routes with equally many junctions are ordered by length.
    """

    def cost(one: LaneKey, other: LaneKey, data: Mapping[str, Any]) -> float:
        before, after = network.road(one.road).junction_id, network.road(other.road).junction_id
        return float(data["weight"]) + (JUNCTION_COST if after is not None and after != before else 0.0)

    return cost


def random_costs(network: RoadNetwork, generator: np.random.Generator) -> Cost:
    """Return the length times a random factor of each road as cost [m], so that different draws select different
    routes.
    """
    draws = generator.uniform(0.0, math.log(MAX_FACTOR), len(network.roads)).tolist()
    factors = {road: math.exp(draw) for road, draw in zip(network.roads, draws, strict=True)}

    def cost(one: LaneKey, _: LaneKey, data: Mapping[str, Any]) -> float:
        return float(data["weight"]) * factors[one.road]

    return cost
