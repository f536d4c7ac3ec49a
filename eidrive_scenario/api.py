"""The surface that extensions import: actions, conditions, criteria, detectors, channels. The engine never does."""

from eidrive_scenario import traffic
from eidrive_scenario.arrays import Array
from eidrive_scenario.detections import CLASSES, Detections
from eidrive_scenario.driving.planning.planner import Planner
from eidrive_scenario.driving.planning.route_planner import RoutePlanner
from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.driving.step import AgentStep, Plan
from eidrive_scenario.errors import (
    Diagnostic,
    EidriveError,
    ExtensionError,
    InputError,
    ScenarioError,
    SettingError,
    SimulationError,
    WallLimitError,
    suggestion,
)
from eidrive_scenario.evaluation.criterion import (
    Criterion,
    CriterionSettings,
    Verdict,
    actor_never_present,
    evaluate_criteria,
)
from eidrive_scenario.fusion.method import FusionMethod, Report
from eidrive_scenario.geometry import box_distance, footprint, footprint_distance, overlap, wrap_angle
from eidrive_scenario.openscenario import Scenario, model
from eidrive_scenario.openscenario.trajectory_times import has_times
from eidrive_scenario.perception.detector import Detector, DetectorContext
from eidrive_scenario.perception.geometry.map_context import MapContext
from eidrive_scenario.perception.lifting.lifting import lift
from eidrive_scenario.randomness import generator
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.requests import Goal, Override
from eidrive_scenario.roads import LaneLocation, Pose, RoadNetwork, Route, RouteError
from eidrive_scenario.sensing.readings import CameraReading, EgoState, LidarReading, Readings, SignalReading
from eidrive_scenario.settings import Settings, load_yaml, parse_settings
from eidrive_scenario.storyboard.context.behaviour import ActionBehaviour
from eidrive_scenario.storyboard.context.condition import (
    Condition,
    EntityCondition,
    Measure,
    QuantityCondition,
    describe_rule,
    relation,
    satisfies_rule,
)
from eidrive_scenario.storyboard.context.controller_model import ControllerModel
from eidrive_scenario.storyboard.context.runtime_context import EntityAbsentError, RuntimeContext
from eidrive_scenario.storyboard.kinematics.actor import Actor, is_agent_controller
from eidrive_scenario.storyboard.kinematics.motion import STEEPEST, LateralStep, Motion, ResolvedPosition
from eidrive_scenario.storyboard.kinematics.random_routes import random_route, uniform_branch_selector
from eidrive_scenario.storyboard.kinematics.route import build_route
from eidrive_scenario.storyboard.kinematics.trajectory import TrajectoryCurve, TrajectoryProgress, sample_trajectory
from eidrive_scenario.storyboard.kinematics.transition_profile import TransitionProfile
from eidrive_scenario.storyboard.positions.distances import (
    closing_speed,
    distance,
    entity_box,
    resolve_coordinate_system,
    resolve_distance_type,
    same_way,
)
from eidrive_scenario.storyboard.positions.resolution import referenced_entities, resolve_position, trajectory_of
from eidrive_scenario.storyboard.positions.road_positions import count_lanes, facing
from eidrive_scenario.storyboard.state.commands import Commands, CustomCommand
from eidrive_scenario.storyboard.state.domains import Domain
from eidrive_scenario.storyboard.state.element_states import ElementStateObserver, ElementStates
from eidrive_scenario.storyboard.state.environments import merge_environment
from eidrive_scenario.storyboard.state.states import ElementState, ElementTransition, StateChange
from eidrive_scenario.tolerances import EPSILON, TIME_TOLERANCE
from eidrive_scenario.v2x.channel import Channel
from eidrive_scenario.v2x.link_channel import LinkChannel
from eidrive_scenario.v2x.messages.message import LinkEvent, Message, ReceivedMessage
from eidrive_scenario.v2x.profile import ChannelProfile
from eidrive_scenario.v2x.statistics.link_events import LinkEvents, OutcomeBlock, OutcomeColumns
from eidrive_scenario.world.actor import ActorSpec, Control, Placement
from eidrive_scenario.world.appearance import AnimationState, Appearance, LightState, Visibility
from eidrive_scenario.world.environment import Environment
from eidrive_scenario.world.physics.multi_axle import turning_wheelbase
from eidrive_scenario.world.view import Contact, WorldView

__all__ = [
    "CLASSES",
    "EPSILON",
    "STEEPEST",
    "TIME_TOLERANCE",
    "ActionBehaviour",
    "Actor",
    "ActorSpec",
    "AgentSettings",
    "AgentStep",
    "AnimationState",
    "Appearance",
    "Array",
    "CameraReading",
    "Channel",
    "ChannelProfile",
    "Commands",
    "Condition",
    "Contact",
    "Control",
    "ControllerModel",
    "Criterion",
    "CriterionSettings",
    "CustomCommand",
    "Detections",
    "Detector",
    "DetectorContext",
    "Diagnostic",
    "Domain",
    "EgoState",
    "EidriveError",
    "ElementState",
    "ElementStateObserver",
    "ElementStates",
    "ElementTransition",
    "EntityAbsentError",
    "EntityCondition",
    "Environment",
    "ExtensionError",
    "Frame",
    "FusionMethod",
    "Goal",
    "InputError",
    "LaneLocation",
    "LateralStep",
    "LidarReading",
    "LightState",
    "LinkChannel",
    "LinkEvent",
    "LinkEvents",
    "MapContext",
    "Measure",
    "Message",
    "Motion",
    "OutcomeBlock",
    "OutcomeColumns",
    "Override",
    "Placement",
    "Plan",
    "Planner",
    "Pose",
    "QuantityCondition",
    "Readings",
    "ReceivedMessage",
    "Report",
    "ResolvedPosition",
    "RoadNetwork",
    "Route",
    "RouteError",
    "RoutePlanner",
    "RuntimeContext",
    "Scenario",
    "ScenarioError",
    "SettingError",
    "Settings",
    "SignalReading",
    "SimulationError",
    "StateChange",
    "TrajectoryCurve",
    "TrajectoryProgress",
    "TransitionProfile",
    "Verdict",
    "Visibility",
    "WallLimitError",
    "WorldView",
    "actor_never_present",
    "box_distance",
    "build_route",
    "closing_speed",
    "count_lanes",
    "describe_rule",
    "distance",
    "entity_box",
    "evaluate_criteria",
    "facing",
    "footprint",
    "footprint_distance",
    "generator",
    "has_times",
    "is_agent_controller",
    "lift",
    "load_yaml",
    "merge_environment",
    "model",
    "overlap",
    "parse_settings",
    "random_route",
    "referenced_entities",
    "relation",
    "resolve_coordinate_system",
    "resolve_distance_type",
    "resolve_position",
    "same_way",
    "sample_trajectory",
    "satisfies_rule",
    "suggestion",
    "traffic",
    "trajectory_of",
    "turning_wheelbase",
    "uniform_branch_selector",
    "wrap_angle",
]
