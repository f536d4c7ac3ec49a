"""Entities of a scenario."""

from __future__ import annotations

from typing import TYPE_CHECKING

from eidrive_scenario.openscenario.model.declarations import (
    CatalogReference,
    EntityName,
    ParameterDeclarations,
    Properties,
    SensorName,
)
from eidrive_scenario.openscenario.model.element import (
    ALL,
    CHOICE,
    Choice,
    Element,
    attribute,
    child,
    children,
    choice,
    sequence,
)
from eidrive_scenario.openscenario.model.entity_enumerations import (
    MiscObjectCategory,
    ObjectType,
    PedestrianCategory,
    Role,
    SensorCategory,
    VehicleCategory,
)

if TYPE_CHECKING:
    from eidrive_scenario.openscenario.model.controllers import ObjectController
    from eidrive_scenario.openscenario.model.positions import RelativeObjectPosition


class Center(Element):
    """Center of the box in the frame of the object [m]."""

    x: float
    y: float
    z: float


class Dimensions(Element):
    """Dimensions of the box [m]."""

    height: float
    length: float
    width: float


class BoundingBox(Element, content=ALL):
    """Bounding box, parallel to the axes of the object frame."""

    center: Center
    dimensions: Dimensions


class Sensor(Element):
    """Sensor and its field of view [rad]."""

    sensor_category: SensorCategory
    name: str
    horizontal_fov: float = attribute(name="horizontalFOV", required=True)
    vertical_fov: float = attribute(name="verticalFOV", required=True)
    parameter_declarations: ParameterDeclarations | None = None
    properties: Properties


class SensorAttachment(Element):
    """Mounting position of a sensor on the vehicle."""

    sensor_ref: SensorName
    mounting_position: RelativeObjectPosition


class SensorAttachments(Element):
    """Sensors of a vehicle."""

    sensor_attachment: tuple[SensorAttachment, ...] = ()


class SensorReference(Element):
    """Reference to a sensor by its name."""

    name: str


class SensorReferenceSet(Element):
    """References to sensors by their names."""

    sensor_reference: tuple[SensorReference, ...]


class Axle(Element):
    """Axle: maximum steering angle [rad], position, track width and wheel diameter [m]."""

    max_steering: float
    position_x: float
    position_z: float
    track_width: float
    wheel_diameter: float


class Axles(Element):
    """Axles of a vehicle."""

    front_axle: Axle | None = child(required_until="1.2")
    rear_axle: Axle
    additional_axle: tuple[Axle, ...] = ()


class Performance(Element):
    """Limits of a vehicle: speed [m/s], acceleration and deceleration [m/s²], their rates [m/s³]."""

    max_acceleration: float
    max_deceleration: float
    max_speed: float
    max_acceleration_rate: float | None = attribute(since="1.2")
    max_deceleration_rate: float | None = attribute(since="1.2")


class TrailerHitch(Element):
    """Position of the trailer hitch relative to the reference point [m]."""

    dx: float
    dz: float | None = None


class TrailerCoupler(Element):
    """Position of the trailer coupler relative to the reference point [m]."""

    dx: float
    dz: float | None = None


class Trailer(Element, content=CHOICE):
    """Trailer of a vehicle."""

    trailer: ScenarioObject | None = None
    trailer_ref: EntityRef | None = None


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


class EntityRef(Element):
    """Reference to an entity by its name."""

    entity_ref: EntityName


class ByType(Element):
    """Selection of all entities of a type."""

    object_type: ObjectType


class ByObjectType(Element):
    """Reference to any entity of a type."""

    type: ObjectType


class SelectedEntities(Element, content=Choice(empty_until="1.2")):
    """Members of a selection, by name or by type."""

    entity_ref: tuple[EntityRef, ...] = ()
    by_type: tuple[ByType, ...] = ()


class EntitySelection(Element):
    """Named group of entities."""

    name: str
    members: SelectedEntities


class ExternalObjectReference(Element):
    """Object that the road network or another tool defines."""

    name: str


class Pedestrian(Element, content=ALL):
    """Pedestrian, animal or wheelchair. Mass [kg]."""

    mass: float
    name: str
    pedestrian_category: PedestrianCategory
    model: str | None = attribute(deprecated="1.1", required_until="1.0")
    model3d: str | None = attribute(since="1.1")
    role: Role | None = attribute(since="1.2")
    parameter_declarations: ParameterDeclarations | None = None
    bounding_box: BoundingBox
    properties: Properties | None = child(required_until="1.2")


class MiscObject(Element, content=ALL):
    """Miscellaneous object. Mass [kg]."""

    mass: float
    misc_object_category: MiscObjectCategory
    name: str
    model3d: str | None = attribute(since="1.1")
    parameter_declarations: ParameterDeclarations | None = None
    bounding_box: BoundingBox
    properties: Properties | None = child(required_until="1.2")


class ScenarioObject(
    Element,
    content=sequence(
        choice(
            "catalog_reference",
            "vehicle",
            "pedestrian",
            "misc_object",
            "external_object_reference",
            "sensor",
            empty_until="1.2",
        ),
        "object_controller",
    ),
):
    """Named entity and its controllers."""

    name: str
    catalog_reference: CatalogReference | None = None
    vehicle: Vehicle | None = None
    pedestrian: Pedestrian | None = None
    misc_object: MiscObject | None = None
    external_object_reference: ExternalObjectReference | None = child(since="1.1")
    sensor: Sensor | None = child(since="1.2", until="1.2", deprecated="1.2")
    object_controller: tuple[ObjectController, ...] = children(single_until="1.1")


class ScenarioObjectTemplate(
    Element,
    content=sequence(
        choice("catalog_reference", "vehicle", "pedestrian", "misc_object", "external_object_reference"),
        "object_controller",
    ),
):
    """Unnamed entity template of background traffic."""

    catalog_reference: CatalogReference | None = None
    vehicle: Vehicle | None = None
    pedestrian: Pedestrian | None = None
    misc_object: MiscObject | None = None
    external_object_reference: ExternalObjectReference | None = None
    object_controller: tuple[ObjectController, ...] = ()


class Entities(Element):
    """All entities and selections."""

    scenario_object: tuple[ScenarioObject, ...] = ()
    entity_selection: tuple[EntitySelection, ...] = ()
