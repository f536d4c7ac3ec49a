"""Catalogs, their locations, and references to their entries."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from eidrive_scenario.openscenario.model.content import ALL
from eidrive_scenario.openscenario.model.declarations import ParameterAssignments
from eidrive_scenario.openscenario.model.element import Element, attribute, child, children
from eidrive_scenario.openscenario.model.properties import Directory

if TYPE_CHECKING:
    from eidrive_scenario.openscenario.model.controllers import Controller
    from eidrive_scenario.openscenario.model.entities import MiscObject, Pedestrian
    from eidrive_scenario.openscenario.model.environment import Environment
    from eidrive_scenario.openscenario.model.routing import Route, Trajectory
    from eidrive_scenario.openscenario.model.sensors import Sensor
    from eidrive_scenario.openscenario.model.storyboard import Maneuver
    from eidrive_scenario.openscenario.model.vehicles import Vehicle


@dataclass(frozen=True, kw_only=True)
class CatalogReference(Element):
    """Reference to a catalog entry, with values of its parameters."""

    catalog_name: str
    entry_name: str
    parameter_assignments: ParameterAssignments | None = None


@dataclass(frozen=True, kw_only=True)
class VehicleCatalogLocation(Element, content=ALL):
    """Location of vehicle catalogs."""

    directory: Directory


@dataclass(frozen=True, kw_only=True)
class ControllerCatalogLocation(Element, content=ALL):
    """Location of controller catalogs."""

    directory: Directory


@dataclass(frozen=True, kw_only=True)
class PedestrianCatalogLocation(Element, content=ALL):
    """Location of pedestrian catalogs."""

    directory: Directory


@dataclass(frozen=True, kw_only=True)
class MiscObjectCatalogLocation(Element, content=ALL):
    """Location of catalogs of miscellaneous objects."""

    directory: Directory


@dataclass(frozen=True, kw_only=True)
class EnvironmentCatalogLocation(Element, content=ALL):
    """Location of environment catalogs."""

    directory: Directory


@dataclass(frozen=True, kw_only=True)
class ManeuverCatalogLocation(Element, content=ALL):
    """Location of maneuver catalogs."""

    directory: Directory


@dataclass(frozen=True, kw_only=True)
class TrajectoryCatalogLocation(Element, content=ALL):
    """Location of trajectory catalogs."""

    directory: Directory


@dataclass(frozen=True, kw_only=True)
class RouteCatalogLocation(Element, content=ALL):
    """Location of route catalogs."""

    directory: Directory


@dataclass(frozen=True, kw_only=True)
class SensorCatalogLocation(Element, content=ALL):
    """Location of sensor catalogs (1.2)."""

    directory: Directory


@dataclass(frozen=True, kw_only=True)
class CatalogLocations(Element, content=ALL):
    """Locations of the catalogs of a scenario, by kind."""

    vehicle_catalog: VehicleCatalogLocation | None = None
    controller_catalog: ControllerCatalogLocation | None = None
    pedestrian_catalog: PedestrianCatalogLocation | None = None
    misc_object_catalog: MiscObjectCatalogLocation | None = None
    environment_catalog: EnvironmentCatalogLocation | None = None
    maneuver_catalog: ManeuverCatalogLocation | None = None
    trajectory_catalog: TrajectoryCatalogLocation | None = None
    route_catalog: RouteCatalogLocation | None = None
    sensor_catalog: SensorCatalogLocation | None = child(since="1.2", until="1.2")


@dataclass(frozen=True, kw_only=True)
class Catalog(Element):
    """Entries that scenarios share."""

    name: str | None = attribute(required_since="1.3")
    vehicle: tuple[Vehicle, ...] = ()
    controller: tuple[Controller, ...] = ()
    pedestrian: tuple[Pedestrian, ...] = ()
    misc_object: tuple[MiscObject, ...] = ()
    environment: tuple[Environment, ...] = ()
    maneuver: tuple[Maneuver, ...] = ()
    trajectory: tuple[Trajectory, ...] = ()
    route: tuple[Route, ...] = ()
    sensor: tuple[Sensor, ...] = children(since="1.2", until="1.2")
