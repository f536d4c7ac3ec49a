"""Planners and vehicle controllers of a station, and driving stacks, which operate all stations of a run.

Stable: all names but those of driving stacks (`DrivingStack`, `EmptyStack`, `StackContext`, `StackFactory`,
`StackInputs`, `StackSettings`), which may change in a minor version.
"""

from eidrive_scenario.base.coverage import PerceptionRegion, ViewSector
from eidrive_scenario.base.detections import Detections
from eidrive_scenario.base.requests import Goal
from eidrive_scenario.driving.agent import Agent
from eidrive_scenario.driving.agent_factory import build_agent
from eidrive_scenario.driving.communication.radio_line_of_sight import line_of_sight_states
from eidrive_scenario.driving.control.vehicle_controller import VehicleController
from eidrive_scenario.driving.planner_settings import PlannerSettings
from eidrive_scenario.driving.planning.route_planner import Planner, RoutePlanner
from eidrive_scenario.driving.settings import AgentSettings, agent_settings
from eidrive_scenario.driving.stack import (
    DrivingStack,
    EmptyStack,
    StackContext,
    StackFactory,
    StackInputs,
    StackSettings,
)
from eidrive_scenario.driving.stations import Stations
from eidrive_scenario.driving.step import AgentStep, Plan, StationAction, StationPerception
from eidrive_scenario.sensing.readings import EgoState
from eidrive_scenario.world.actor import ActorSpec, Control

__all__ = [
    "ActorSpec",
    "Agent",
    "AgentSettings",
    "AgentStep",
    "Control",
    "Detections",
    "DrivingStack",
    "EgoState",
    "EmptyStack",
    "Goal",
    "PerceptionRegion",
    "Plan",
    "Planner",
    "PlannerSettings",
    "RoutePlanner",
    "StackContext",
    "StackFactory",
    "StackInputs",
    "StackSettings",
    "StationAction",
    "StationPerception",
    "Stations",
    "VehicleController",
    "ViewSector",
    "agent_settings",
    "build_agent",
    "line_of_sight_states",
]
