"""Vehicles, their axles, limits and trailers."""

from __future__ import annotations

from typing import TYPE_CHECKING

from eidrive_scenario.openscenario.model.bounding_box import BoundingBox
from eidrive_scenario.openscenario.model.content import ALL, CHOICE
from eidrive_scenario.openscenario.model.declarations import ParameterDeclarations
from eidrive_scenario.openscenario.model.element import Element, attribute, child, element_type
from eidrive_scenario.openscenario.model.entity_enumerations import Role, VehicleCategory
from eidrive_scenario.openscenario.model.properties import Properties
from eidrive_scenario.openscenario.model.sensors import SensorAttachments

if TYPE_CHECKING:
    from eidrive_scenario.openscenario.model.entities import EntityRef, ScenarioObject


@element_type
class Axle(Element):
    """Axle: maximum steering angle [rad], position, track width and wheel diameter [m]."""

    max_steering: float
    position_x: float
    position_z: float
    track_width: float
    wheel_diameter: float


@element_type
class Axles(Element):
    """Axles of a vehicle."""

    front_axle: Axle | None = child(required_until="1.2")
    rear_axle: Axle
    additional_axle: tuple[Axle, ...] = ()


@element_type
class Performance(Element):
    """Limits of a vehicle: speed [m/s], acceleration and deceleration [m/s²], their rates [m/s³]."""

    max_acceleration: float
    max_deceleration: float
    max_speed: float
    max_acceleration_rate: float | None = attribute(since="1.2")
    max_deceleration_rate: float | None = attribute(since="1.2")


@element_type
class TrailerHitch(Element):
    """Position of the trailer hitch relative to the reference point [m]."""

    dx: float
    dz: float | None = None


@element_type
class TrailerCoupler(Element):
    """Position of the trailer coupler relative to the reference point [m]."""

    dx: float
    dz: float | None = None


@element_type
class Trailer(Element, content=CHOICE):
    """Trailer of a vehicle."""

    trailer: ScenarioObject | None = None
    trailer_ref: EntityRef | None = None


@element_type
class Vehicle(Element, content=ALL):
    """Vehicle with bounding box, limits and axles. Mass [kg]."""

    name: str
    vehicle_category: VehicleCategory
    mass: float | None = attribute(since="1.1")
    model3d: str | None = attribute(since="1.1")
    role: Role | None = attribute(since="1.2")
    vehicle_role: Role | None = attribute(since="1.2", until="1.2", deprecated="1.2")
    parameter_declarations: ParameterDeclarations | None = None
    bounding_box: BoundingBox
    performance: Performance
    axles: Axles
    properties: Properties | None = child(required_until="1.2")
    sensor_attachments: SensorAttachments | None = child(since="1.2", until="1.2", deprecated="1.2")
    trailer_hitch: TrailerHitch | None = child(since="1.3")
    trailer_coupler: TrailerCoupler | None = child(since="1.3")
    trailer: Trailer | None = child(since="1.3")
