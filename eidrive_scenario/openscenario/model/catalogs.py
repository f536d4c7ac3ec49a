"""Catalogs, where they lie, and how an entry of one is named."""

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
    """An entry of a catalog, with values for its parameters."""

    catalog_name: str
    entry_name: str
    parameter_assignments: ParameterAssignments | None = None


@dataclass(frozen=True, kw_only=True)
class VehicleCatalogLocation(Element, content=ALL):
    """Where vehicle catalogs lie."""

    directory: Directory


@dataclass(frozen=True, kw_only=True)
class ControllerCatalogLocation(Element, content=ALL):
    """Where controller catalogs lie."""

    directory: Directory


@dataclass(frozen=True, kw_only=True)
class PedestrianCatalogLocation(Element, content=ALL):
    """Where pedestrian catalogs lie."""

    directory: Directory


@dataclass(frozen=True, kw_only=True)
class MiscObjectCatalogLocation(Element, content=ALL):
    """Where catalogs of miscellaneous objects lie."""

    directory: Directory


@dataclass(frozen=True, kw_only=True)
class EnvironmentCatalogLocation(Element, content=ALL):
    """Where environment catalogs lie."""

    directory: Directory


@dataclass(frozen=True, kw_only=True)
class ManeuverCatalogLocation(Element, content=ALL):
    """Where maneuver catalogs lie."""

    directory: Directory


@dataclass(frozen=True, kw_only=True)
class TrajectoryCatalogLocation(Element, content=ALL):
    """Where trajectory catalogs lie."""

    directory: Directory


@dataclass(frozen=True, kw_only=True)
class RouteCatalogLocation(Element, content=ALL):
    """Where route catalogs lie."""

    directory: Directory


@dataclass(frozen=True, kw_only=True)
class SensorCatalogLocation(Element, content=ALL):
    """Where sensor catalogs lie (1.2)."""

    directory: Directory


@dataclass(frozen=True, kw_only=True)
class CatalogLocations(Element, content=ALL):
    """Where the catalogs of a scenario lie, by kind."""

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
