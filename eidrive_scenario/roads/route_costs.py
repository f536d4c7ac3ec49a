"""What a way over the lanes may cost, other than its length: time, junctions, or chance."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from eidrive_scenario.roads.model.location import LaneKey
from eidrive_scenario.roads.network import RoadNetwork
from eidrive_scenario.roads.routing.costs import JUNCTION_COST, Cost, assumed_speed

MOST_UNLIKELY = 10.0
"""The largest factor by which chance makes a road seem longer than it is."""


def fastest(network: RoadNetwork) -> Cost:
    """Return seconds at the speed limits."""
    known: dict[LaneKey, float] = {}

    def cost(one: LaneKey, _: LaneKey, data: Mapping[str, Any]) -> float:
        key = LaneKey(*one[:3])
        if key not in known:
            section = network.road(key.road).sections[key.section]
            known[key] = assumed_speed(network.speed_limit(key.road, 0.5 * (section.s + section.end), key.lane))
        return float(data["weight"]) / known[key]

    return cost


def fewest_junctions(network: RoadNetwork) -> Cost:
    """Return each junction that is entered counts more than any length; among equals the shortest way."""

    def cost(one: LaneKey, other: LaneKey, data: Mapping[str, Any]) -> float:
        before, after = network.road(one.road).junction_id, network.road(other.road).junction_id
        return float(data["weight"]) + (JUNCTION_COST if after is not None and after != before else 0.0)

    return cost


def random_costs(network: RoadNetwork, generator: np.random.Generator) -> Cost:
    """Return meters, each road's times a factor that the generator draws: now one way is the cheapest, now another."""
    draws = generator.uniform(0.0, math.log(MOST_UNLIKELY), len(network.roads)).tolist()
    factors = {road: math.exp(draw) for road, draw in zip(network.roads, draws, strict=True)}

    def cost(one: LaneKey, _: LaneKey, data: Mapping[str, Any]) -> float:
        return float(data["weight"]) * factors[one.road]

    return cost
