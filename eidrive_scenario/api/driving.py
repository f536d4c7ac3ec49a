"""Planners and vehicle controllers of a station, and driving stacks, which operate all stations of a run.

Stable: all names but those of driving stacks (`DrivingStack`, `EmptyStack`, `StackContext`, `StackFactory`,
`StackInputs`, `StackSettings`), which may change in a minor version.
"""

from eidrive_scenario.base.coverage import PerceptionRegion as PerceptionRegion
from eidrive_scenario.base.coverage import ViewSector as ViewSector
from eidrive_scenario.base.detections import Detections as Detections
from eidrive_scenario.base.requests import Goal as Goal
from eidrive_scenario.driving.agent import Agent as Agent
from eidrive_scenario.driving.agent_factory import build_agent as build_agent
from eidrive_scenario.driving.communication.radio_line_of_sight import line_of_sight_states as line_of_sight_states
from eidrive_scenario.driving.control.vehicle_controller import VehicleController as VehicleController
from eidrive_scenario.driving.planner_settings import PlannerSettings as PlannerSettings
from eidrive_scenario.driving.planning.route_planner import Planner as Planner
from eidrive_scenario.driving.planning.route_planner import RoutePlanner as RoutePlanner
from eidrive_scenario.driving.settings import AgentSettings as AgentSettings
from eidrive_scenario.driving.settings import agent_settings as agent_settings
from eidrive_scenario.driving.stack import DrivingStack as DrivingStack
from eidrive_scenario.driving.stack import EmptyStack as EmptyStack
from eidrive_scenario.driving.stack import StackContext as StackContext
from eidrive_scenario.driving.stack import StackFactory as StackFactory
from eidrive_scenario.driving.stack import StackInputs as StackInputs
from eidrive_scenario.driving.stack import StackSettings as StackSettings
from eidrive_scenario.driving.stations import Stations as Stations
from eidrive_scenario.driving.step import AgentStep as AgentStep
from eidrive_scenario.driving.step import Plan as Plan
from eidrive_scenario.driving.step import StationAction as StationAction
from eidrive_scenario.driving.step import StationPerception as StationPerception
from eidrive_scenario.sensing.readings import EgoState as EgoState
from eidrive_scenario.world.actor import ActorSpec as ActorSpec
from eidrive_scenario.world.actor import Control as Control
