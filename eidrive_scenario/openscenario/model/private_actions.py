"""Private actions, which apply to one entity: longitudinal, lateral and all others."""

from __future__ import annotations

from eidrive_scenario.openscenario.model.appearance import AppearanceAction
from eidrive_scenario.openscenario.model.controllers import ActivateControllerAction, ControllerAction
from eidrive_scenario.openscenario.model.declarations import EntityName
from eidrive_scenario.openscenario.model.element import ALL, CHOICE, Choice, Element, attribute, child, element_type
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


@element_type
class DynamicConstraints(Element):
    """Limits of speed [m/s], acceleration and deceleration [m/s²] and their rates [m/s³]."""

    max_acceleration: float | None = None
    max_deceleration: float | None = None
    max_speed: float | None = None
    max_acceleration_rate: float | None = attribute(since="1.2")
    max_deceleration_rate: float | None = attribute(since="1.2")


@element_type
class TransitionDynamics(Element):
    """Dynamics of a transition: shape, and time [s], distance [m] or rate."""

    dynamics_dimension: DynamicsDimension
    dynamics_shape: DynamicsShape
    value: float
    following_mode: FollowingMode | None = attribute(since="1.2")


@element_type
class AbsoluteTargetSpeed(Element):
    """Target speed [m/s]."""

    value: float


@element_type
class RelativeTargetSpeed(Element):
    """Target speed relative to an entity: difference [m/s] or factor."""

    entity_ref: EntityName
    continuous: bool
    speed_target_value_type: SpeedTargetValueType
    value: float


@element_type
class SpeedActionTarget(Element, content=Choice(empty_until="1.2")):
    """Target of a speed action."""

    relative_target_speed: RelativeTargetSpeed | None = None
    absolute_target_speed: AbsoluteTargetSpeed | None = None


@element_type
class SpeedAction(Element, content=ALL):
    """Action that changes the speed of an entity."""

    speed_action_dynamics: TransitionDynamics
    speed_action_target: SpeedActionTarget


@element_type
class SpeedProfileEntry(Element):
    """Speed [m/s] and duration of the transition to it [s]."""

    speed: float
    time: float | None = None


@element_type
class SpeedProfileAction(Element):
    """Action with a series of speeds."""

    following_mode: FollowingMode
    entity_ref: EntityName | None = attribute(since="1.2")
    dynamic_constraints: DynamicConstraints | None = None
    entity_ref_element: EntityRef | None = child(until="1.2", deprecated="1.2", name="EntityRef")
    speed_profile_entry: tuple[SpeedProfileEntry, ...]


@element_type
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


@element_type
class LongitudinalAction(Element, content=Choice(empty_until="1.2")):
    """Longitudinal action of an entity."""

    speed_action: SpeedAction | None = None
    longitudinal_distance_action: LongitudinalDistanceAction | None = None
    speed_profile_action: SpeedProfileAction | None = child(since="1.2")


@element_type
class AbsoluteTargetLane(Element):
    """Target lane by its id."""

    value: str
    layer: LaneLayerType | None = attribute(since="1.4")


@element_type
class RelativeTargetLane(Element):
    """Target lane relative to the lane of an entity."""

    entity_ref: EntityName
    value: int
    layer: LaneLayerType | None = attribute(since="1.4")


@element_type
class LaneChangeTarget(Element, content=Choice(empty_until="1.2")):
    """Target of a lane change."""

    relative_target_lane: RelativeTargetLane | None = None
    absolute_target_lane: AbsoluteTargetLane | None = None


@element_type
class LaneChangeAction(Element, content=ALL):
    """Action that changes the lane; offset from the lane center [m]."""

    target_lane_offset: float | None = None
    lane_change_action_dynamics: TransitionDynamics
    lane_change_target: LaneChangeTarget


@element_type
class AbsoluteTargetLaneOffset(Element):
    """Target offset from the lane center [m]."""

    value: float


@element_type
class RelativeTargetLaneOffset(Element):
    """Target offset relative to an entity [m]."""

    entity_ref: EntityName
    value: float


@element_type
class LaneOffsetTarget(Element, content=Choice(empty_until="1.2")):
    """Target of a lane offset."""

    relative_target_lane_offset: RelativeTargetLaneOffset | None = None
    absolute_target_lane_offset: AbsoluteTargetLaneOffset | None = None


@element_type
class LaneOffsetActionDynamics(Element):
    """Dynamics of a lane offset; maximum lateral acceleration [m/s²]."""

    dynamics_shape: DynamicsShape
    max_lateral_acc: float | None = None


@element_type
class LaneOffsetAction(Element, content=ALL):
    """Action that changes the lateral offset in the lane."""

    continuous: bool
    lane_offset_action_dynamics: LaneOffsetActionDynamics
    lane_offset_target: LaneOffsetTarget


@element_type
class LateralDistanceAction(Element, content=ALL):
    """Action that keeps a lateral distance to an entity [m]."""

    entity_ref: EntityName
    continuous: bool
    freespace: bool
    distance: float | None = None
    displacement: LateralDisplacement | None = attribute(since="1.1")
    coordinate_system: CoordinateSystem | None = attribute(since="1.1")
    dynamic_constraints: DynamicConstraints | None = None


@element_type
class LateralAction(Element, content=Choice(empty_until="1.2")):
    """Lateral action of an entity."""

    lane_change_action: LaneChangeAction | None = None
    lane_offset_action: LaneOffsetAction | None = None
    lateral_distance_action: LateralDistanceAction | None = None


@element_type
class VisibilityAction(Element):
    """Action that sets the visibility of an entity in graphics, for traffic and for sensors."""

    graphics: bool
    sensors: bool
    traffic: bool
    sensor_reference_set: SensorReferenceSet | None = child(since="1.2")


@element_type
class AbsoluteSpeed(Element, content=Choice(minimum=0)):
    """Final speed [m/s]."""

    value: float
    target_distance_steady_state: TargetDistanceSteadyState | None = child(since="1.1")
    target_time_steady_state: TargetTimeSteadyState | None = child(since="1.1")


@element_type
class RelativeSpeedToMaster(Element, content=Choice(minimum=0)):
    """Final speed relative to the master: difference [m/s] or factor."""

    speed_target_value_type: SpeedTargetValueType
    value: float
    target_distance_steady_state: TargetDistanceSteadyState | None = child(since="1.1")
    target_time_steady_state: TargetTimeSteadyState | None = child(since="1.1")


@element_type
class TargetDistanceSteadyState(Element):
    """Distance of the steady state at the final speed [m]."""

    distance: float


@element_type
class TargetTimeSteadyState(Element):
    """Duration of the steady state at the final speed [s]."""

    time: float


@element_type
class FinalSpeed(Element, content=Choice(empty_until="1.2")):
    """Final speed of a synchronization."""

    absolute_speed: AbsoluteSpeed | None = None
    relative_speed_to_master: RelativeSpeedToMaster | None = None


@element_type
class SynchronizeAction(Element, content=ALL):
    """Action that reaches a position at the arrival time of the master; tolerances [m]."""

    master_entity_ref: EntityName
    target_tolerance_master: float | None = attribute(since="1.1")
    target_tolerance: float | None = attribute(since="1.1")
    target_position_master: Position
    target_position: Position
    final_speed: FinalSpeed | None = None


@element_type
class TeleportAction(Element):
    """Action that teleports an entity to a position."""

    position: Position


@element_type
class ConnectTrailerAction(Element):
    """Connection of a trailer."""

    trailer_ref: EntityName


@element_type
class DisconnectTrailerAction(Element):
    """Disconnection of the trailer."""


@element_type
class TrailerAction(Element, content=CHOICE):
    """Action that connects or disconnects a trailer."""

    connect_trailer_action: ConnectTrailerAction | None = None
    disconnect_trailer_action: DisconnectTrailerAction | None = None


@element_type
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
