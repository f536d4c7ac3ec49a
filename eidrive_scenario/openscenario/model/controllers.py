"""Controllers and the actions upon them."""

from __future__ import annotations

from dataclasses import dataclass

from eidrive_scenario.openscenario.model.catalogs import CatalogReference
from eidrive_scenario.openscenario.model.content import ALL, CHOICE, Changed, Choice
from eidrive_scenario.openscenario.model.declarations import ParameterDeclarations
from eidrive_scenario.openscenario.model.element import Element, attribute, child
from eidrive_scenario.openscenario.model.enumerations import AutomaticGearType, ControllerType
from eidrive_scenario.openscenario.model.properties import Properties
from eidrive_scenario.openscenario.model.scalars import ControllerName


@dataclass(frozen=True, kw_only=True)
class Controller(Element, content=ALL):
    """Who moves an entity; its properties are for the tool that provides it."""

    name: str
    controller_type: ControllerType | None = attribute(since="1.2")
    parameter_declarations: ParameterDeclarations | None = None
    properties: Properties | None = child(required_until="1.2")


@dataclass(frozen=True, kw_only=True)
class ObjectController(Element, content=Choice(empty_until="1.2")):
    """The controller of an entity, in place or from a catalog."""

    name: str | None = attribute(since="1.3")
    catalog_reference: CatalogReference | None = None
    controller: Controller | None = None


@dataclass(frozen=True, kw_only=True)
class ControllerDistributionEntry(Element, content=Choice(empty_until="1.2")):
    """A controller and its share."""

    weight: float
    controller: Controller | None = None
    catalog_reference: CatalogReference | None = None


@dataclass(frozen=True, kw_only=True)
class ControllerDistribution(Element):
    """Which controllers background traffic gets, by shares."""

    controller_distribution_entry: tuple[ControllerDistributionEntry, ...]


@dataclass(frozen=True, kw_only=True)
class AssignControllerAction(Element, content=Choice(minimum=0)):
    """Gives an entity a controller, and says which domains it takes at once."""

    activate_lateral: bool | None = attribute(since="1.1")
    activate_longitudinal: bool | None = attribute(since="1.1")
    activate_animation: bool | None = attribute(since="1.2")
    activate_lighting: bool | None = attribute(since="1.2")
    controller: Controller | None = child(deprecated="1.3")
    catalog_reference: CatalogReference | None = child(deprecated="1.3")
    object_controller: ObjectController | None = child(since="1.3")


@dataclass(frozen=True, kw_only=True)
class ActivateControllerAction(Element):
    """Turns a controller on or off, domain by domain; a domain left out stays as it is."""

    lateral: bool | None = None
    longitudinal: bool | None = None
    controller_ref: ControllerName | None = attribute(since="1.2", deprecated="1.3")
    animation: bool | None = attribute(since="1.2")
    lighting: bool | None = attribute(since="1.2")
    object_controller_ref: ControllerName | None = attribute(since="1.3")


@dataclass(frozen=True, kw_only=True)
class Brake(Element):
    """A brake's position: a share in [0, 1] or a force [N]; largest rate per second."""

    value: float
    max_rate: float | None = None


@dataclass(frozen=True, kw_only=True)
class ManualGear(Element):
    """A gear by number; negative is reverse, 0 is neutral."""

    number: int


@dataclass(frozen=True, kw_only=True)
class AutomaticGear(Element):
    """The position of an automatic transmission's lever."""

    gear: AutomaticGearType


@dataclass(frozen=True, kw_only=True)
class OverrideThrottleAction(Element):
    """Holds the throttle at a value in [0, 1]."""

    active: bool
    value: float
    max_rate: float | None = attribute(since="1.2")


@dataclass(frozen=True, kw_only=True)
class OverrideBrakeAction(Element, content=Choice(minimum=0)):
    """Holds the brake."""

    active: bool
    value: float | None = attribute(deprecated="1.2", required_until="1.1")
    brake_percent: Brake | None = child(since="1.2")
    brake_force: Brake | None = child(since="1.2")


@dataclass(frozen=True, kw_only=True)
class OverrideClutchAction(Element):
    """Holds the clutch at a value in [0, 1]."""

    active: bool
    value: float
    max_rate: float | None = attribute(since="1.2")


@dataclass(frozen=True, kw_only=True)
class OverrideParkingBrakeAction(Element, content=Choice(minimum=0)):
    """Holds the parking brake."""

    active: bool
    value: float | None = attribute(deprecated="1.2", required_until="1.1")
    brake_percent: Brake | None = child(since="1.2")
    brake_force: Brake | None = child(since="1.2")


@dataclass(frozen=True, kw_only=True)
class OverrideSteeringWheelAction(Element):
    """Holds the steering wheel [rad]; rate [rad/s], torque [Nm]."""

    active: bool
    value: float
    max_rate: float | None = attribute(since="1.2")
    max_torque: float | None = attribute(since="1.2")


@dataclass(frozen=True, kw_only=True)
class OverrideGearAction(Element, content=Choice(minimum=0)):
    """Holds the gear."""

    active: bool
    number: float | None = attribute(deprecated="1.2", required_until="1.1")
    manual_gear: ManualGear | None = child(since="1.2")
    automatic_gear: AutomaticGear | None = child(since="1.2")


@dataclass(frozen=True, kw_only=True)
class OverrideControllerValueAction(Element, content=ALL):
    """Holds pedals, wheel or gear against the controller's will."""

    throttle: OverrideThrottleAction | None = child(required_until="1.0")
    brake: OverrideBrakeAction | None = child(required_until="1.0")
    clutch: OverrideClutchAction | None = child(required_until="1.0")
    parking_brake: OverrideParkingBrakeAction | None = child(required_until="1.0")
    steering_wheel: OverrideSteeringWheelAction | None = child(required_until="1.0")
    gear: OverrideGearAction | None = child(required_until="1.0")


@dataclass(frozen=True, kw_only=True)
class ControllerAction(Element, content=Changed(ALL, "1.3", CHOICE)):
    """Assigns, overrides or activates controllers. Before 1.3 several at once are possible."""

    assign_controller_action: AssignControllerAction | None = child(required_until="1.0")
    override_controller_value_action: OverrideControllerValueAction | None = child(required_until="1.0")
    activate_controller_action: ActivateControllerAction | None = child(since="1.1")
