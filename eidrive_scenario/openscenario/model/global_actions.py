"""Global actions: environment and weather, traffic signals, entities, parameters, variables and traffic."""

from __future__ import annotations

from datetime import datetime
from typing import Any

from eidrive_scenario.openscenario.model.declarations import (
    CatalogReference,
    EntityName,
    File,
    MonitorName,
    ParameterDeclarations,
    ParameterName,
    Properties,
    SignalControllerName,
    VariableName,
)
from eidrive_scenario.openscenario.model.element import ALL, Choice, Element, about, attribute, child, text
from eidrive_scenario.openscenario.model.entities import BoundingBox
from eidrive_scenario.openscenario.model.entity_enumerations import (
    CloudState,
    FractionalCloudCover,
    PrecipitationType,
    Wetness,
)
from eidrive_scenario.openscenario.model.enumerations import TrafficSignalSemantics
from eidrive_scenario.openscenario.model.positions import Position
from eidrive_scenario.openscenario.model.traffic import TrafficAction


class TimeOfDay(Element):
    """Date and time, and whether the time advances."""

    animation: bool
    date_time: datetime


class Sun(Element):
    """Sun with azimuth and elevation [rad] and illuminance [lx]."""

    azimuth: float
    elevation: float
    intensity: float | None = attribute(deprecated="1.2", required_until="1.1")
    illuminance: float | None = attribute(since="1.2")


class Fog(Element, content=ALL):
    """Fog with visual range [m], optionally in a bounding box."""

    visual_range: float
    bounding_box: BoundingBox | None = None


class Precipitation(Element):
    """Precipitation intensity [mm/h]."""

    precipitation_type: PrecipitationType
    intensity: float | None = attribute(deprecated="1.1", required_until="1.0")
    precipitation_intensity: float | None = attribute(since="1.1")


class Wind(Element):
    """Wind with direction of flow [rad] and speed [m/s]."""

    direction: float
    speed: float


class DomeImage(Element):
    """Image of the sky; azimuth offset [rad]."""

    azimuth_offset: float | None = None
    dome_file: File


class Weather(Element, content=ALL):
    """Weather; pressure [Pa], temperature [K]."""

    cloud_state: CloudState | None = attribute(deprecated="1.2", required_until="1.0")
    atmospheric_pressure: float | None = attribute(since="1.1")
    temperature: float | None = attribute(since="1.1")
    fractional_cloud_cover: FractionalCloudCover | None = attribute(since="1.2")
    sun: Sun | None = child(required_until="1.0")
    fog: Fog | None = child(required_until="1.0")
    precipitation: Precipitation | None = child(required_until="1.0")
    wind: Wind | None = child(since="1.1")
    dome_image: DomeImage | None = child(since="1.2")


class RoadCondition(Element):
    """Friction of the road relative to the reference friction."""

    friction_scale_factor: float
    wetness: Wetness | None = attribute(since="1.2")
    properties: Properties | None = None


class Environment(Element, content=ALL):
    """Time of day, weather and road condition."""

    name: str
    parameter_declarations: ParameterDeclarations | None = None
    time_of_day: TimeOfDay | None = child(required_until="1.0")
    weather: Weather | None = child(required_until="1.0")
    road_condition: RoadCondition | None = child(required_until="1.0")


class EnvironmentAction(Element, content=Choice(empty_until="1.2")):
    """Action that sets the environment."""

    environment: Environment | None = None
    catalog_reference: CatalogReference | None = None


class TrafficSignalState(Element):
    """State of one signal."""

    state: str
    traffic_signal_id: str


class TrafficSignalGroupState(Element):
    """State of all signals of a controller."""

    state: str


class Phase(Element):
    """Phase of a controller; duration [s]."""

    duration: float
    name: str
    semantics: TrafficSignalSemantics | None = attribute(since="1.4")
    traffic_signal_state: tuple[TrafficSignalState, ...] = ()
    traffice_signal_group_state: TrafficSignalGroupState | None = child(since="1.2", until="1.2")
    traffic_signal_group_state: TrafficSignalGroupState | None = child(since="1.3")


class TrafficSignalController(Element):
    """Controller of signals; delay after the referenced controller [s]."""

    name: str
    delay: float | None = None
    reference: str | None = None
    phase: tuple[Phase, ...] = ()


class TrafficSignals(Element):
    """Signal controllers of a scenario."""

    traffic_signal_controller: tuple[TrafficSignalController, ...] = ()


class TrafficSignalStateAction(Element):
    """Action that sets the state of a signal."""

    name: str
    state: str


class TrafficSignalControllerAction(Element):
    """Action that sets the phase of a controller."""

    traffic_signal_controller_ref: SignalControllerName
    phase: str


class TrafficSignalAction(Element, content=Choice(empty_until="1.2")):
    """Action that sets a signal or a controller."""

    traffic_signal_controller_action: TrafficSignalControllerAction | None = None
    traffic_signal_state_action: TrafficSignalStateAction | None = None


class InfrastructureAction(Element, content=ALL):
    """Action of the infrastructure."""

    traffic_signal_action: TrafficSignalAction


class TrafficSignalCondition(Element):
    """Condition on the state of a signal."""

    name: str
    state: str


class TrafficSignalControllerCondition(Element):
    """Condition on the phase of a controller."""

    traffic_signal_controller_ref: SignalControllerName
    phase: str


class AddEntityAction(Element, content=ALL):
    """Addition of an entity at a position."""

    position: Position


class DeleteEntityAction(Element):
    """Removal of an entity."""


class EntityAction(Element, content=Choice(empty_until="1.2")):
    """Action that adds or removes an entity."""

    entity_ref: EntityName
    add_entity_action: AddEntityAction | None = None
    delete_entity_action: DeleteEntityAction | None = None


class ParameterSetAction(Element):
    """Assignment to a parameter (deprecated since 1.2: use a variable)."""

    value: str


class ParameterAddValueRule(Element):
    """Addition to a parameter."""

    value: float


class ParameterMultiplyByValueRule(Element):
    """Multiplication of a parameter."""

    value: float


class ModifyRule(Element, content=Choice(empty_until="1.2")):
    """Rule for the modification of a parameter."""

    add_value: ParameterAddValueRule | None = None
    multiply_by_value: ParameterMultiplyByValueRule | None = None


class ParameterModifyAction(Element, content=ALL):
    """Modification of a parameter (deprecated since 1.2: use a variable)."""

    rule: ModifyRule


class ParameterAction(Element, content=Choice(empty_until="1.2")):
    """Action that sets or modifies a parameter (deprecated since 1.2: use a variable)."""

    parameter_ref: ParameterName
    scope: Any = about(None)
    set_action: ParameterSetAction | None = child(deprecated="1.2")
    modify_action: ParameterModifyAction | None = child(deprecated="1.2")


class VariableSetAction(Element):
    """Assignment to a variable."""

    value: str


class VariableAddValueRule(Element):
    """Addition to a variable."""

    value: float


class VariableMultiplyByValueRule(Element):
    """Multiplication of a variable."""

    value: float


class VariableModifyRule(Element, content=Choice(empty_until="1.2")):
    """Rule for the modification of a variable."""

    add_value: VariableAddValueRule | None = None
    multiply_by_value: VariableMultiplyByValueRule | None = None


class VariableModifyAction(Element, content=ALL):
    """Modification of a variable."""

    rule: VariableModifyRule


class VariableAction(Element, content=Choice(empty_until="1.2")):
    """Action that sets or modifies a variable."""

    variable_ref: VariableName
    set_action: VariableSetAction | None = None
    modify_action: VariableModifyAction | None = None


class SetMonitorAction(Element):
    """Action that sets a monitor."""

    monitor_ref: MonitorName
    value: bool


class GlobalAction(Element, content=Choice(empty_until="1.2")):
    """Action that does not apply to a single entity."""

    environment_action: EnvironmentAction | None = None
    entity_action: EntityAction | None = None
    infrastructure_action: InfrastructureAction | None = None
    set_monitor_action: SetMonitorAction | None = child(since="1.3")
    parameter_action: ParameterAction | None = child(deprecated="1.2")
    traffic_action: TrafficAction | None = None
    variable_action: VariableAction | None = child(since="1.2")


class CustomCommandAction(Element):
    """Command to the engine; its type specifies the language."""

    type: str
    content: str = text()
    scope: Any = about(None)


class UserDefinedAction(Element):
    """Action that the standard does not define."""

    custom_command_action: CustomCommandAction
