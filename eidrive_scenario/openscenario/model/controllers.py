"""Controllers and controller actions."""

from __future__ import annotations

from eidrive_scenario.openscenario.model.declarations import (
    CatalogReference,
    ControllerName,
    ParameterDeclarations,
    Properties,
)
from eidrive_scenario.openscenario.model.element import ALL, CHOICE, Changed, Choice, Element, attribute, child
from eidrive_scenario.openscenario.model.entity_enumerations import ControllerType
from eidrive_scenario.openscenario.model.enumerations import AutomaticGearType


class Controller(Element, content=ALL):
    """Controller of an entity; its properties are specific to the tool that provides it."""

    name: str
    controller_type: ControllerType | None = attribute(since="1.2")
    parameter_declarations: ParameterDeclarations | None = None
    properties: Properties | None = child(required_until="1.2")


class ObjectController(Element, content=Choice(empty_until="1.2")):
    """Controller of an entity, defined in place or in a catalog."""

    name: str | None = attribute(since="1.3")
    catalog_reference: CatalogReference | None = None
    controller: Controller | None = None


class ControllerDistributionEntry(Element, content=Choice(empty_until="1.2")):
    """Controller and its share."""

    weight: float
    controller: Controller | None = None
    catalog_reference: CatalogReference | None = None


class ControllerDistribution(Element):
    """Controllers of background traffic, by shares."""

    controller_distribution_entry: tuple[ControllerDistributionEntry, ...]


class AssignControllerAction(Element, content=Choice(minimum=0)):
    """Action that assigns a controller to an entity, and optionally activates its domains."""

    activate_lateral: bool | None = attribute(since="1.1")
    activate_longitudinal: bool | None = attribute(since="1.1")
    activate_animation: bool | None = attribute(since="1.2")
    activate_lighting: bool | None = attribute(since="1.2")
    controller: Controller | None = child(deprecated="1.3")
    catalog_reference: CatalogReference | None = child(deprecated="1.3")
    object_controller: ObjectController | None = child(since="1.3")


class ActivateControllerAction(Element):
    """Action that activates or deactivates a controller per domain; an omitted domain does not change."""

    lateral: bool | None = None
    longitudinal: bool | None = None
    controller_ref: ControllerName | None = attribute(since="1.2", deprecated="1.3")
    animation: bool | None = attribute(since="1.2")
    lighting: bool | None = attribute(since="1.2")
    object_controller_ref: ControllerName | None = attribute(since="1.3")


class Brake(Element):
    """Brake input: share in [0, 1] or force [N]; maximum rate [1/s, N/s]."""

    value: float
    max_rate: float | None = None


class ManualGear(Element):
    """Gear by number; negative for reverse, 0 for neutral."""

    number: int


class AutomaticGear(Element):
    """Lever position of an automatic transmission."""

    gear: AutomaticGearType


class OverrideThrottleAction(Element):
    """Override of the throttle by a value in [0, 1]."""

    active: bool
    value: float
    max_rate: float | None = attribute(since="1.2")


class OverrideBrakeAction(Element, content=Choice(minimum=0)):
    """Override of the brake."""

    active: bool
    value: float | None = attribute(deprecated="1.2", required_until="1.1")
    brake_percent: Brake | None = child(since="1.2")
    brake_force: Brake | None = child(since="1.2")


class OverrideClutchAction(Element):
    """Override of the clutch by a value in [0, 1]."""

    active: bool
    value: float
    max_rate: float | None = attribute(since="1.2")


class OverrideParkingBrakeAction(Element, content=Choice(minimum=0)):
    """Override of the parking brake."""

    active: bool
    value: float | None = attribute(deprecated="1.2", required_until="1.1")
    brake_percent: Brake | None = child(since="1.2")
    brake_force: Brake | None = child(since="1.2")


class OverrideSteeringWheelAction(Element):
    """Override of the steering wheel angle [rad]; maximum rate [rad/s], torque [Nm]."""

    active: bool
    value: float
    max_rate: float | None = attribute(since="1.2")
    max_torque: float | None = attribute(since="1.2")


class OverrideGearAction(Element, content=Choice(minimum=0)):
    """Override of the gear."""

    active: bool
    number: float | None = attribute(deprecated="1.2", required_until="1.1")
    manual_gear: ManualGear | None = child(since="1.2")
    automatic_gear: AutomaticGear | None = child(since="1.2")


class OverrideControllerValueAction(Element, content=ALL):
    """Action that overrides pedals, steering wheel or gear of the controller."""

    throttle: OverrideThrottleAction | None = child(required_until="1.0")
    brake: OverrideBrakeAction | None = child(required_until="1.0")
    clutch: OverrideClutchAction | None = child(required_until="1.0")
    parking_brake: OverrideParkingBrakeAction | None = child(required_until="1.0")
    steering_wheel: OverrideSteeringWheelAction | None = child(required_until="1.0")
    gear: OverrideGearAction | None = child(required_until="1.0")


class ControllerAction(Element, content=Changed(ALL, "1.3", CHOICE)):
    """Action that assigns, overrides or activates controllers; before 1.3 a combination is allowed."""

    assign_controller_action: AssignControllerAction | None = child(required_until="1.0")
    override_controller_value_action: OverrideControllerValueAction | None = child(required_until="1.0")
    activate_controller_action: ActivateControllerAction | None = child(since="1.1")
