"""Actions, conditions and controller models of the scenario subsystem.

Stable: `ActionBehaviour`, `Condition` and its subclasses, `ControllerModel`, their contexts, `Actor`, `Motion`,
`Domain`, `model`. The other names are those that the actions of this project use; they may change with a minor version.
"""

from eidrive_scenario import traffic as traffic
from eidrive_scenario.base.requests import LONGEST_WAY as LONGEST_WAY
from eidrive_scenario.base.requests import Goal as Goal
from eidrive_scenario.base.requests import Override as Override
from eidrive_scenario.openscenario import model as model
from eidrive_scenario.openscenario.conventions import is_agent_controller as is_agent_controller
from eidrive_scenario.openscenario.conventions import property_entries as property_entries
from eidrive_scenario.openscenario.model.routing import TIME_ATTRIBUTES as TIME_ATTRIBUTES
from eidrive_scenario.openscenario.model.routing import has_times as has_times
from eidrive_scenario.storyboard.context.behaviour import ActionBehaviour as ActionBehaviour
from eidrive_scenario.storyboard.context.condition import Condition as Condition
from eidrive_scenario.storyboard.context.condition import EntityCondition as EntityCondition
from eidrive_scenario.storyboard.context.condition import Measure as Measure
from eidrive_scenario.storyboard.context.condition import QuantityCondition as QuantityCondition
from eidrive_scenario.storyboard.context.condition import describe_rule as describe_rule
from eidrive_scenario.storyboard.context.condition import next_change as next_change
from eidrive_scenario.storyboard.context.condition import relation as relation
from eidrive_scenario.storyboard.context.condition import satisfies_rule as satisfies_rule
from eidrive_scenario.storyboard.context.controller_model import ControllerModel as ControllerModel
from eidrive_scenario.storyboard.context.protocols import ActionContext as ActionContext
from eidrive_scenario.storyboard.context.protocols import ConditionContext as ConditionContext
from eidrive_scenario.storyboard.context.protocols import ControllerContext as ControllerContext
from eidrive_scenario.storyboard.context.protocols import EntityAbsentError as EntityAbsentError
from eidrive_scenario.storyboard.kinematics.actor import Actor as Actor
from eidrive_scenario.storyboard.kinematics.motion import STEEPEST as STEEPEST
from eidrive_scenario.storyboard.kinematics.motion import LateralStep as LateralStep
from eidrive_scenario.storyboard.kinematics.motion import Motion as Motion
from eidrive_scenario.storyboard.kinematics.motion_state import ResolvedPosition as ResolvedPosition
from eidrive_scenario.storyboard.kinematics.route import build_route as build_route
from eidrive_scenario.storyboard.kinematics.route import faces_traffic as faces_traffic
from eidrive_scenario.storyboard.kinematics.route import random_route as random_route
from eidrive_scenario.storyboard.kinematics.route import uniform_branch_selector as uniform_branch_selector
from eidrive_scenario.storyboard.kinematics.trajectory import TrajectoryCurve as TrajectoryCurve
from eidrive_scenario.storyboard.kinematics.trajectory import TrajectoryProgress as TrajectoryProgress
from eidrive_scenario.storyboard.kinematics.trajectory_sampling import sample_trajectory as sample_trajectory
from eidrive_scenario.storyboard.kinematics.transition_profile import TransitionProfile as TransitionProfile
from eidrive_scenario.storyboard.positions.distances import closing_speed as closing_speed
from eidrive_scenario.storyboard.positions.distances import distance as distance
from eidrive_scenario.storyboard.positions.distances import entity_box as entity_box
from eidrive_scenario.storyboard.positions.distances import resolve_coordinate_system as resolve_coordinate_system
from eidrive_scenario.storyboard.positions.distances import resolve_distance_type as resolve_distance_type
from eidrive_scenario.storyboard.positions.distances import same_way as same_way
from eidrive_scenario.storyboard.positions.position_types import count_lanes as count_lanes
from eidrive_scenario.storyboard.positions.position_types import facing as facing
from eidrive_scenario.storyboard.positions.resolution import referenced_entities as referenced_entities
from eidrive_scenario.storyboard.positions.resolution import resolve_position as resolve_position
from eidrive_scenario.storyboard.positions.resolution import trajectory_of as trajectory_of
from eidrive_scenario.storyboard.state.commands import Commands as Commands
from eidrive_scenario.storyboard.state.commands import CustomCommand as CustomCommand
from eidrive_scenario.storyboard.state.element_states import Domain as Domain
from eidrive_scenario.storyboard.state.element_states import ElementState as ElementState
from eidrive_scenario.storyboard.state.element_states import ElementStateObserver as ElementStateObserver
from eidrive_scenario.storyboard.state.element_states import ElementStates as ElementStates
from eidrive_scenario.storyboard.state.element_states import ElementTransition as ElementTransition
from eidrive_scenario.storyboard.state.element_states import StateChange as StateChange
from eidrive_scenario.storyboard.state.environments import merge_environment as merge_environment
from eidrive_scenario.world.appearance import AnimationState as AnimationState
from eidrive_scenario.world.appearance import Appearance as Appearance
from eidrive_scenario.world.appearance import LightState as LightState
from eidrive_scenario.world.appearance import Visibility as Visibility
from eidrive_scenario.world.environment import Environment as Environment
from eidrive_scenario.world.physics.dynamics import turning_wheelbase as turning_wheelbase
