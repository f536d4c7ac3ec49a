"""Entities of a scenario."""

from __future__ import annotations

from typing import TYPE_CHECKING

from eidrive_scenario.openscenario.model.bounding_box import BoundingBox
from eidrive_scenario.openscenario.model.catalogs import CatalogReference
from eidrive_scenario.openscenario.model.content import ALL, Choice, choice, sequence
from eidrive_scenario.openscenario.model.declarations import ParameterDeclarations
from eidrive_scenario.openscenario.model.element import Element, attribute, child, children, element_type
from eidrive_scenario.openscenario.model.entity_enumerations import (
    MiscObjectCategory,
    ObjectType,
    PedestrianCategory,
    Role,
)
from eidrive_scenario.openscenario.model.properties import Properties
from eidrive_scenario.openscenario.model.scalars import EntityName
from eidrive_scenario.openscenario.model.sensors import Sensor
from eidrive_scenario.openscenario.model.vehicles import Vehicle

if TYPE_CHECKING:
    from eidrive_scenario.openscenario.model.controllers import ObjectController


@element_type
class EntityRef(Element):
    """Reference to an entity by its name."""

    entity_ref: EntityName


@element_type
class ByType(Element):
    """Selection of all entities of a type."""

    object_type: ObjectType


@element_type
class ByObjectType(Element):
    """Reference to any entity of a type."""

    type: ObjectType


@element_type
class SelectedEntities(Element, content=Choice(empty_until="1.2")):
    """Members of a selection, by name or by type."""

    entity_ref: tuple[EntityRef, ...] = ()
    by_type: tuple[ByType, ...] = ()


@element_type
class EntitySelection(Element):
    """Named group of entities."""

    name: str
    members: SelectedEntities


@element_type
class ExternalObjectReference(Element):
    """Object that the road network or another tool defines."""

    name: str


@element_type
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


@element_type
class MiscObject(Element, content=ALL):
    """Miscellaneous object. Mass [kg]."""

    mass: float
    misc_object_category: MiscObjectCategory
    name: str
    model3d: str | None = attribute(since="1.1")
    parameter_declarations: ParameterDeclarations | None = None
    bounding_box: BoundingBox
    properties: Properties | None = child(required_until="1.2")


@element_type
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


@element_type
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


@element_type
class Entities(Element):
    """All entities and selections."""

    scenario_object: tuple[ScenarioObject, ...] = ()
    entity_selection: tuple[EntitySelection, ...] = ()
