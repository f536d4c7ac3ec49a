"""Actions, conditions and controller models of the scenario subsystem.

Stable: `ActionBehaviour`, `Condition` and its subclasses, `ControllerModel`, their contexts, `Actor`, `Motion`,
`Domain`, `model`. The other names are those that the actions of this project use; they may change with a minor version.
"""

from eidrive_scenario import traffic
from eidrive_scenario.base.requests import LONGEST_WAY, Goal, Override
from eidrive_scenario.openscenario import model
from eidrive_scenario.openscenario.conventions import is_agent_controller, property_entries
from eidrive_scenario.openscenario.model.routing import TIME_ATTRIBUTES, has_times
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
from eidrive_scenario.storyboard.context.protocols import (
    ActionContext,
    ConditionContext,
    ControllerContext,
    EntityAbsentError,
)
from eidrive_scenario.storyboard.kinematics.actor import Actor
from eidrive_scenario.storyboard.kinematics.motion import STEEPEST, LateralStep, Motion
from eidrive_scenario.storyboard.kinematics.motion_state import ResolvedPosition
from eidrive_scenario.storyboard.kinematics.route import (
    build_route,
    faces_traffic,
    random_route,
    uniform_branch_selector,
)
from eidrive_scenario.storyboard.kinematics.trajectory import TrajectoryCurve, TrajectoryProgress
from eidrive_scenario.storyboard.kinematics.trajectory_sampling import sample_trajectory
from eidrive_scenario.storyboard.kinematics.transition_profile import TransitionProfile
from eidrive_scenario.storyboard.positions.distances import (
    closing_speed,
    distance,
    entity_box,
    resolve_coordinate_system,
    resolve_distance_type,
    same_way,
)
from eidrive_scenario.storyboard.positions.position_types import count_lanes, facing
from eidrive_scenario.storyboard.positions.resolution import referenced_entities, resolve_position, trajectory_of
from eidrive_scenario.storyboard.state.commands import Commands, CustomCommand
from eidrive_scenario.storyboard.state.element_states import (
    Domain,
    ElementState,
    ElementStateObserver,
    ElementStates,
    ElementTransition,
    StateChange,
)
from eidrive_scenario.storyboard.state.environments import merge_environment
from eidrive_scenario.world.appearance import AnimationState, Appearance, LightState, Visibility
from eidrive_scenario.world.environment import Environment
from eidrive_scenario.world.physics.dynamics import turning_wheelbase

__all__ = [
    "LONGEST_WAY",
    "STEEPEST",
    "TIME_ATTRIBUTES",
    "ActionBehaviour",
    "ActionContext",
    "Actor",
    "AnimationState",
    "Appearance",
    "Commands",
    "Condition",
    "ConditionContext",
    "ControllerContext",
    "ControllerModel",
    "CustomCommand",
    "Domain",
    "ElementState",
    "ElementStateObserver",
    "ElementStates",
    "ElementTransition",
    "EntityAbsentError",
    "EntityCondition",
    "Environment",
    "Goal",
    "LateralStep",
    "LightState",
    "Measure",
    "Motion",
    "Override",
    "QuantityCondition",
    "ResolvedPosition",
    "StateChange",
    "TrajectoryCurve",
    "TrajectoryProgress",
    "TransitionProfile",
    "Visibility",
    "build_route",
    "closing_speed",
    "count_lanes",
    "describe_rule",
    "distance",
    "entity_box",
    "faces_traffic",
    "facing",
    "has_times",
    "is_agent_controller",
    "merge_environment",
    "model",
    "property_entries",
    "random_route",
    "referenced_entities",
    "relation",
    "resolve_coordinate_system",
    "resolve_distance_type",
    "resolve_position",
    "same_way",
    "sample_trajectory",
    "satisfies_rule",
    "traffic",
    "trajectory_of",
    "turning_wheelbase",
    "uniform_branch_selector",
]
