"""Private actions: actions of one entity."""

from __future__ import annotations

from eidrive_scenario.openscenario.model.appearance import AppearanceAction
from eidrive_scenario.openscenario.model.content import ALL, CHOICE, Choice
from eidrive_scenario.openscenario.model.controllers import ActivateControllerAction, ControllerAction
from eidrive_scenario.openscenario.model.element import Element, attribute, child, element_type
from eidrive_scenario.openscenario.model.enumerations import SpeedTargetValueType
from eidrive_scenario.openscenario.model.lateral import LateralAction
from eidrive_scenario.openscenario.model.longitudinal import LongitudinalAction
from eidrive_scenario.openscenario.model.positions import Position
from eidrive_scenario.openscenario.model.routing import RoutingAction
from eidrive_scenario.openscenario.model.scalars import EntityName
from eidrive_scenario.openscenario.model.sensors import SensorReferenceSet


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
