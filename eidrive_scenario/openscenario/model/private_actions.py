"""Private actions, which apply to one entity: longitudinal, lateral and all others."""

from __future__ import annotations

from eidrive_scenario.openscenario.model.appearance import AppearanceAction
from eidrive_scenario.openscenario.model.controllers import ActivateControllerAction, ControllerAction
from eidrive_scenario.openscenario.model.declarations import EntityName
from eidrive_scenario.openscenario.model.element import ALL, CHOICE, Choice, Element, attribute, child
from eidrive_scenario.openscenario.model.entities import EntityRef, SensorReferenceSet
from eidrive_scenario.openscenario.model.enumerations import (
    CoordinateSystem,
    DynamicsDimension,
    DynamicsShape,
    FollowingMode,
    LaneLayerType,
    LateralDisplacement,
    LongitudinalDisplacement,
    SpeedTargetValueType,
)
from eidrive_scenario.openscenario.model.positions import Position
from eidrive_scenario.openscenario.model.routing import RoutingAction


class DynamicConstraints(Element):
    """Limits of speed [m/s], acceleration and deceleration [m/s²] and their rates [m/s³]."""

    max_acceleration: float | None = None
    max_deceleration: float | None = None
    max_speed: float | None = None
    max_acceleration_rate: float | None = attribute(since="1.2")
    max_deceleration_rate: float | None = attribute(since="1.2")


class TransitionDynamics(Element):
    """Dynamics of a transition: shape, and time [s], distance [m] or rate."""

    dynamics_dimension: DynamicsDimension
    dynamics_shape: DynamicsShape
    value: float
    following_mode: FollowingMode | None = attribute(since="1.2")


class AbsoluteTargetSpeed(Element):
    """Target speed [m/s]."""

    value: float


class RelativeTargetSpeed(Element):
    """Target speed relative to an entity: difference [m/s] or factor."""

    entity_ref: EntityName
    continuous: bool
    speed_target_value_type: SpeedTargetValueType
    value: float


class SpeedActionTarget(Element, content=Choice(empty_until="1.2")):
    """Target of a speed action."""

    relative_target_speed: RelativeTargetSpeed | None = None
    absolute_target_speed: AbsoluteTargetSpeed | None = None


class SpeedAction(Element, content=ALL):
    """Action that changes the speed of an entity."""

    speed_action_dynamics: TransitionDynamics
    speed_action_target: SpeedActionTarget


class SpeedProfileEntry(Element):
    """Speed [m/s] and duration of the transition to it [s]."""

    speed: float
    time: float | None = None


class SpeedProfileAction(Element):
    """Action with a series of speeds."""

    following_mode: FollowingMode
    entity_ref: EntityName | None = attribute(since="1.2")
    dynamic_constraints: DynamicConstraints | None = None
    entity_ref_element: EntityRef | None = child(until="1.2", deprecated="1.2", name="EntityRef")
    speed_profile_entry: tuple[SpeedProfileEntry, ...]


class LongitudinalDistanceAction(Element, content=ALL):
    """Action that keeps a distance [m] or a time gap [s] to an entity."""

    entity_ref: EntityName
    continuous: bool
    freespace: bool
    distance: float | None = None
    time_gap: float | None = None
    displacement: LongitudinalDisplacement | None = attribute(since="1.1")
    coordinate_system: CoordinateSystem | None = attribute(since="1.1")
    dynamic_constraints: DynamicConstraints | None = None


class LongitudinalAction(Element, content=Choice(empty_until="1.2")):
    """Longitudinal action of an entity."""

    speed_action: SpeedAction | None = None
    longitudinal_distance_action: LongitudinalDistanceAction | None = None
    speed_profile_action: SpeedProfileAction | None = child(since="1.2")


class AbsoluteTargetLane(Element):
    """Target lane by its id."""

    value: str
    layer: LaneLayerType | None = attribute(since="1.4")


class RelativeTargetLane(Element):
    """Target lane relative to the lane of an entity."""

    entity_ref: EntityName
    value: int
    layer: LaneLayerType | None = attribute(since="1.4")


class LaneChangeTarget(Element, content=Choice(empty_until="1.2")):
    """Target of a lane change."""

    relative_target_lane: RelativeTargetLane | None = None
    absolute_target_lane: AbsoluteTargetLane | None = None


class LaneChangeAction(Element, content=ALL):
    """Action that changes the lane; offset from the lane center [m]."""

    target_lane_offset: float | None = None
    lane_change_action_dynamics: TransitionDynamics
    lane_change_target: LaneChangeTarget


class AbsoluteTargetLaneOffset(Element):
    """Target offset from the lane center [m]."""

    value: float


class RelativeTargetLaneOffset(Element):
    """Target offset relative to an entity [m]."""

    entity_ref: EntityName
    value: float


class LaneOffsetTarget(Element, content=Choice(empty_until="1.2")):
    """Target of a lane offset."""

    relative_target_lane_offset: RelativeTargetLaneOffset | None = None
    absolute_target_lane_offset: AbsoluteTargetLaneOffset | None = None


class LaneOffsetActionDynamics(Element):
    """Dynamics of a lane offset; maximum lateral acceleration [m/s²]."""

    dynamics_shape: DynamicsShape
    max_lateral_acc: float | None = None


def is_immediate(
    dynamics: TransitionDynamics | LaneOffsetActionDynamics | LongitudinalDistanceAction | LateralDistanceAction,
) -> bool:
    """Whether a transition ends at its start, as the limits of the vehicle do not apply either."""
    if isinstance(dynamics, LongitudinalDistanceAction | LateralDistanceAction):
        return dynamics.dynamic_constraints is None
    if isinstance(dynamics, LaneOffsetActionDynamics):
        return dynamics.dynamics_shape is DynamicsShape.STEP or dynamics.max_lateral_acc is None
    is_zero = dynamics.dynamics_dimension is not DynamicsDimension.RATE and dynamics.value == 0.0
    is_step = dynamics.dynamics_shape is DynamicsShape.STEP or is_zero
    return is_step and dynamics.following_mode is not FollowingMode.FOLLOW


class LaneOffsetAction(Element, content=ALL):
    """Action that changes the lateral offset in the lane."""

    continuous: bool
    lane_offset_action_dynamics: LaneOffsetActionDynamics
    lane_offset_target: LaneOffsetTarget


class LateralDistanceAction(Element, content=ALL):
    """Action that keeps a lateral distance to an entity [m]."""

    entity_ref: EntityName
    continuous: bool
    freespace: bool
    distance: float | None = None
    displacement: LateralDisplacement | None = attribute(since="1.1")
    coordinate_system: CoordinateSystem | None = attribute(since="1.1")
    dynamic_constraints: DynamicConstraints | None = None


class LateralAction(Element, content=Choice(empty_until="1.2")):
    """Lateral action of an entity."""

    lane_change_action: LaneChangeAction | None = None
    lane_offset_action: LaneOffsetAction | None = None
    lateral_distance_action: LateralDistanceAction | None = None


class VisibilityAction(Element):
    """Action that sets the visibility of an entity in graphics, for traffic and for sensors."""

    graphics: bool
    sensors: bool
    traffic: bool
    sensor_reference_set: SensorReferenceSet | None = child(since="1.2")


class AbsoluteSpeed(Element, content=Choice(minimum=0)):
    """Final speed [m/s]."""

    value: float
    target_distance_steady_state: TargetDistanceSteadyState | None = child(since="1.1")
    target_time_steady_state: TargetTimeSteadyState | None = child(since="1.1")


class RelativeSpeedToMaster(Element, content=Choice(minimum=0)):
    """Final speed relative to the master: difference [m/s] or factor."""

    speed_target_value_type: SpeedTargetValueType
    value: float
    target_distance_steady_state: TargetDistanceSteadyState | None = child(since="1.1")
    target_time_steady_state: TargetTimeSteadyState | None = child(since="1.1")


class TargetDistanceSteadyState(Element):
    """Distance of the steady state at the final speed [m]."""

    distance: float


class TargetTimeSteadyState(Element):
    """Duration of the steady state at the final speed [s]."""

    time: float


class FinalSpeed(Element, content=Choice(empty_until="1.2")):
    """Final speed of a synchronization."""

    absolute_speed: AbsoluteSpeed | None = None
    relative_speed_to_master: RelativeSpeedToMaster | None = None


class SynchronizeAction(Element, content=ALL):
    """Action that reaches a position at the arrival time of the master; tolerances [m]."""

    master_entity_ref: EntityName
    target_tolerance_master: float | None = attribute(since="1.1")
    target_tolerance: float | None = attribute(since="1.1")
    target_position_master: Position
    target_position: Position
    final_speed: FinalSpeed | None = None


class TeleportAction(Element):
    """Action that teleports an entity to a position."""

    position: Position


class ConnectTrailerAction(Element):
    """Connection of a trailer."""

    trailer_ref: EntityName


class DisconnectTrailerAction(Element):
    """Disconnection of the trailer."""


class TrailerAction(Element, content=CHOICE):
    """Action that connects or disconnects a trailer."""

    connect_trailer_action: ConnectTrailerAction | None = None
    disconnect_trailer_action: DisconnectTrailerAction | None = None


class PrivateAction(Element, content=Choice(empty_until="1.2")):
    """Choice of one private action."""

    longitudinal_action: LongitudinalAction | None = None
    lateral_action: LateralAction | None = None
    visibility_action: VisibilityAction | None = None
    synchronize_action: SynchronizeAction | None = None
    activate_controller_action: ActivateControllerAction | None = child(deprecated="1.1")
    controller_action: ControllerAction | None = None
    teleport_action: TeleportAction | None = None
    routing_action: RoutingAction | None = None
    appearance_action: AppearanceAction | None = child(since="1.2")
    trailer_action: TrailerAction | None = child(since="1.3")
