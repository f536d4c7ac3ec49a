"""Cost of an edge of the lane graph, and the speeds that costs assume."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from eidrive_scenario.roads.model.location import LaneKey

Cost = Callable[[LaneKey, LaneKey, Mapping[str, Any]], float]
"""Cost of an edge of the lane graph: lane, following lane, data of the edge."""

USUAL_SPEED = 50.0 / 3.6
"""Assumed speed on roads without a stated speed limit [m/s]."""
FREE_SPEED = 130.0 / 3.6
"""Assumed speed on roads whose speed is not limited [m/s]."""
JUNCTION_COST = 1e6
"""Cost of entering a junction where the fewest junctions are requested [m]; longer than any route."""


def assumed_speed(limit: float | None) -> float:
    """Return the speed [m/s] that costs assume for a speed limit [m/s]; None and 0 mean that none is stated."""
    return USUAL_SPEED if not limit else min(limit, FREE_SPEED)
