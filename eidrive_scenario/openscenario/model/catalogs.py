"""Catalogs, their locations, and references to their entries."""

from __future__ import annotations

from typing import TYPE_CHECKING

from eidrive_scenario.openscenario.model.content import ALL
from eidrive_scenario.openscenario.model.declarations import ParameterAssignments
from eidrive_scenario.openscenario.model.element import Element, attribute, child, children, element_type
from eidrive_scenario.openscenario.model.properties import Directory

if TYPE_CHECKING:
    from eidrive_scenario.openscenario.model.controllers import Controller
    from eidrive_scenario.openscenario.model.entities import MiscObject, Pedestrian
    from eidrive_scenario.openscenario.model.environment import Environment
    from eidrive_scenario.openscenario.model.routing import Route, Trajectory
    from eidrive_scenario.openscenario.model.sensors import Sensor
    from eidrive_scenario.openscenario.model.storyboard import Maneuver
    from eidrive_scenario.openscenario.model.traffic import TrafficDistributionEntry
    from eidrive_scenario.openscenario.model.vehicles import Vehicle


@element_type
class CatalogReference(Element):
    """Reference to a catalog entry, with values of its parameters."""

    catalog_name: str
    entry_name: str
    parameter_assignments: ParameterAssignments | None = None


@element_type
class VehicleCatalogLocation(Element, content=ALL):
    """Location of vehicle catalogs."""

    directory: Directory


@element_type
class ControllerCatalogLocation(Element, content=ALL):
    """Location of controller catalogs."""

    directory: Directory


@element_type
class PedestrianCatalogLocation(Element, content=ALL):
    """Location of pedestrian catalogs."""

    directory: Directory


@element_type
class MiscObjectCatalogLocation(Element, content=ALL):
    """Location of catalogs of miscellaneous objects."""

    directory: Directory


@element_type
class EnvironmentCatalogLocation(Element, content=ALL):
    """Location of environment catalogs."""

    directory: Directory


@element_type
class ManeuverCatalogLocation(Element, content=ALL):
    """Location of maneuver catalogs."""

    directory: Directory


@element_type
class TrajectoryCatalogLocation(Element, content=ALL):
    """Location of trajectory catalogs."""

    directory: Directory


@element_type
class RouteCatalogLocation(Element, content=ALL):
    """Location of route catalogs."""

    directory: Directory


@element_type
class SensorCatalogLocation(Element, content=ALL):
    """Location of sensor catalogs (1.2)."""

    directory: Directory


@element_type
class TrafficDistributionEntryCatalogLocation(Element):
    """Location of catalogs of kinds of traffic."""

    directory: Directory


@element_type
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
    sensor_catalog: SensorCatalogLocation | None = child(since="1.2", until="1.2", deprecated="1.2")
    traffic_distribution_entry_catalog: TrafficDistributionEntryCatalogLocation | None = child(since="1.4")


@element_type
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
    traffic_distribution_entry: tuple[TrafficDistributionEntry, ...] = children(since="1.4")
