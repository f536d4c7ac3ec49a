"""The surface that extensions import: actions, conditions, criteria, detectors, channels. The engine never does."""

from eidrive_scenario import traffic
from eidrive_scenario.detections import CLASSES, Detections
from eidrive_scenario.driving.overrides import Override
from eidrive_scenario.driving.planner import Planner
from eidrive_scenario.driving.route_planner import RoutePlanner
from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.driving.step import AgentStep, Goal, Plan
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
from eidrive_scenario.fusion.method import FusionMethod, Report
from eidrive_scenario.geometry import box_distance, footprint, footprint_distance, overlap, wrap_angle
from eidrive_scenario.openscenario import Scenario, model
from eidrive_scenario.openscenario.trajectory_times import has_times
from eidrive_scenario.perception.detector import Detector, Installation
from eidrive_scenario.perception.lifting import lift
from eidrive_scenario.perception.surroundings import Surroundings
from eidrive_scenario.randomness import generator
from eidrive_scenario.recording.criterion import Criterion, CriterionSettings, Verdict, judge, never_appeared
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.roads import LaneLocation, Pose, RoadNetwork, Route, RouteError
from eidrive_scenario.sensing.readings import CameraReading, EgoState, LidarReading, Readings, SignalReading
from eidrive_scenario.settings import Settings, load_yaml, parse_settings
from eidrive_scenario.storyboard.actor import Actor, is_ours
from eidrive_scenario.storyboard.behaviour import ActionBehaviour
from eidrive_scenario.storyboard.commands import Commands, CustomCommand
from eidrive_scenario.storyboard.condition import (
    Condition,
    EntityCondition,
    Measure,
    QuantityCondition,
    compares,
    in_words,
    relation,
)
from eidrive_scenario.storyboard.distances import box_of, closing_speed, distance, frame_of, kind_of, same_way
from eidrive_scenario.storyboard.domains import Domain
from eidrive_scenario.storyboard.environments import changed as changed_environment
from eidrive_scenario.storyboard.motion import STEEPEST, Motion, Place, Steering
from eidrive_scenario.storyboard.positions import references, resolve, trajectory_of
from eidrive_scenario.storyboard.progress import Progress, Watch
from eidrive_scenario.storyboard.random_way import any_branch, random_route
from eidrive_scenario.storyboard.road_positions import count_lanes, facing
from eidrive_scenario.storyboard.route import route_of
from eidrive_scenario.storyboard.stage import Absent, Stage
from eidrive_scenario.storyboard.stand_in import StandIn
from eidrive_scenario.storyboard.states import State, StateChange, Transition
from eidrive_scenario.storyboard.trajectory import Layout, TrajectoryProgress, lay_out
from eidrive_scenario.storyboard.transition import Transition as ValueTransition
from eidrive_scenario.v2x.channel import Channel
from eidrive_scenario.v2x.link_channel import LinkChannel
from eidrive_scenario.v2x.link_events import LinkEvents, OutcomeBlock, OutcomeColumns
from eidrive_scenario.v2x.message import LinkEvent, Message, ReceivedMessage
from eidrive_scenario.v2x.profile import ChannelProfile
from eidrive_scenario.world.actor import ActorSpec, Control, Placement
from eidrive_scenario.world.appearance import AnimationState, Appearance, LightState, Visibility
from eidrive_scenario.world.environment import Environment
from eidrive_scenario.world.multi_axle import turning_wheelbase
from eidrive_scenario.world.view import Contact, WorldView

__all__ = [
    "CLASSES",
    "STEEPEST",
    "Absent",
    "ActionBehaviour",
    "Actor",
    "ActorSpec",
    "AgentSettings",
    "AgentStep",
    "AnimationState",
    "Appearance",
    "CameraReading",
    "Channel",
    "ChannelProfile",
    "Commands",
    "Condition",
    "Contact",
    "Control",
    "Criterion",
    "CriterionSettings",
    "CustomCommand",
    "Detections",
    "Detector",
    "Diagnostic",
    "Domain",
    "EgoState",
    "EidriveError",
    "EntityCondition",
    "Environment",
    "ExtensionError",
    "Frame",
    "FusionMethod",
    "Goal",
    "InputError",
    "Installation",
    "LaneLocation",
    "Layout",
    "LidarReading",
    "LightState",
    "LinkChannel",
    "LinkEvent",
    "LinkEvents",
    "Measure",
    "Message",
    "Motion",
    "OutcomeBlock",
    "OutcomeColumns",
    "Override",
    "Place",
    "Placement",
    "Plan",
    "Planner",
    "Pose",
    "Progress",
    "QuantityCondition",
    "Readings",
    "ReceivedMessage",
    "Report",
    "RoadNetwork",
    "Route",
    "RouteError",
    "RoutePlanner",
    "Scenario",
    "ScenarioError",
    "SettingError",
    "Settings",
    "SignalReading",
    "SimulationError",
    "Stage",
    "StandIn",
    "State",
    "StateChange",
    "Steering",
    "Surroundings",
    "TrajectoryProgress",
    "Transition",
    "ValueTransition",
    "Verdict",
    "Visibility",
    "WallLimitError",
    "Watch",
    "WorldView",
    "any_branch",
    "box_distance",
    "box_of",
    "changed_environment",
    "closing_speed",
    "compares",
    "count_lanes",
    "distance",
    "facing",
    "footprint",
    "footprint_distance",
    "frame_of",
    "generator",
    "has_times",
    "in_words",
    "is_ours",
    "judge",
    "kind_of",
    "lay_out",
    "lift",
    "load_yaml",
    "model",
    "never_appeared",
    "overlap",
    "parse_settings",
    "random_route",
    "references",
    "relation",
    "resolve",
    "route_of",
    "same_way",
    "suggestion",
    "traffic",
    "trajectory_of",
    "turning_wheelbase",
    "wrap_angle",
]
