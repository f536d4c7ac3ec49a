"""Planner of a third party that returns the same array in every tick, with other content."""

from __future__ import annotations

import numpy as np
from msgspec.structs import replace

from eidrive_scenario.api.driving import Detections, EgoState, Goal, Plan, RoutePlanner


class BufferedPlanner(RoutePlanner):
    """Route planner whose points are in one buffer."""

    _buffer = np.zeros((1000, 2))

    def plan(self, ego: EgoState, objects: Detections, goal: Goal | None, now: float) -> Plan:
        """Return the plan of the route planner."""
        plan = super().plan(ego, objects, goal, now)
        points = self._buffer[: len(plan.points)]
        points[:] = plan.points
        return replace(plan, points=points)
