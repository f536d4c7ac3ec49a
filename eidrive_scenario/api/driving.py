"""Planners: from the ego state, the fused objects and the goal to a trajectory.

Stable: all names.
"""

from eidrive_scenario.detections import Detections
from eidrive_scenario.driving.planning.planner import Planner
from eidrive_scenario.driving.planning.route_planner import RoutePlanner
from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.driving.step import AgentStep, Plan
from eidrive_scenario.requests import Goal
from eidrive_scenario.sensing.readings import EgoState

__all__ = [
    "AgentSettings",
    "AgentStep",
    "Detections",
    "EgoState",
    "Goal",
    "Plan",
    "Planner",
    "RoutePlanner",
]
