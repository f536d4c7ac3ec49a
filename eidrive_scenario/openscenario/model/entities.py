"""Entities of a scenario."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from eidrive_scenario.openscenario.model.bounding_box import BoundingBox
from eidrive_scenario.openscenario.model.catalogs import CatalogReference
from eidrive_scenario.openscenario.model.content import ALL, Choice, choice, sequence
from eidrive_scenario.openscenario.model.declarations import ParameterDeclarations
from eidrive_scenario.openscenario.model.element import Element, attribute, child, children
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


@dataclass(frozen=True, kw_only=True)
class EntityRef(Element):
    """Reference to an entity by its name."""

    entity_ref: EntityName


@dataclass(frozen=True, kw_only=True)
class ByType(Element):
    """Selection of all entities of a type."""

    object_type: ObjectType


@dataclass(frozen=True, kw_only=True)
class ByObjectType(Element):
    """Reference to any entity of a type."""

    type: ObjectType


@dataclass(frozen=True, kw_only=True)
class SelectedEntities(Element, content=Choice(empty_until="1.2")):
    """Members of a selection, by name or by type."""

    entity_ref: tuple[EntityRef, ...] = ()
    by_type: tuple[ByType, ...] = ()


@dataclass(frozen=True, kw_only=True)
class EntitySelection(Element):
    """Named group of entities."""

    name: str
    members: SelectedEntities


@dataclass(frozen=True, kw_only=True)
class ExternalObjectReference(Element):
    """Object that the road network or another tool defines."""

    name: str


@dataclass(frozen=True, kw_only=True)
class Pedestrian(Element, content=ALL):
    """Pedestrian, animal or wheelchair. Mass [kg]."""

    mass: float
    name: str
    pedestrian_category: PedestrianCategory
    model: str | None = attribute(deprecated="1.1", required_until="1.0")
    model3d: str | None = attribute(since="1.1")
    role: Role | None = attribute(since="1.3")
    parameter_declarations: ParameterDeclarations | None = None
    bounding_box: BoundingBox
    properties: Properties | None = child(required_until="1.2")


@dataclass(frozen=True, kw_only=True)
class MiscObject(Element, content=ALL):
    """Miscellaneous object. Mass [kg]."""

    mass: float
    misc_object_category: MiscObjectCategory
    name: str
    model3d: str | None = attribute(since="1.1")
    parameter_declarations: ParameterDeclarations | None = None
    bounding_box: BoundingBox
    properties: Properties | None = child(required_until="1.2")


@dataclass(frozen=True, kw_only=True)
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
    sensor: Sensor | None = child(since="1.2", until="1.2")
    object_controller: tuple[ObjectController, ...] = children(single_until="1.1")


@dataclass(frozen=True, kw_only=True)
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


@dataclass(frozen=True, kw_only=True)
class Entities(Element):
    """All entities and selections."""

    scenario_object: tuple[ScenarioObject, ...] = ()
    entity_selection: tuple[EntitySelection, ...] = ()
