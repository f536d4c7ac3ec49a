"""Root of a file: its header and one of the three kinds of documents; catalogs and their locations."""

from __future__ import annotations

from datetime import datetime
from typing import TYPE_CHECKING

from eidrive_scenario.openscenario.model.declarations import (
    Directory,
    File,
    MonitorDeclarations,
    ParameterDeclarations,
    Properties,
    UnsignedShort,
    VariableDeclarations,
)
from eidrive_scenario.openscenario.model.distributions import ParameterValueDistribution
from eidrive_scenario.openscenario.model.element import ALL, Element, attribute, child, children, choice, sequence, text
from eidrive_scenario.openscenario.model.entities import Entities
from eidrive_scenario.openscenario.model.global_actions import TrafficSignals
from eidrive_scenario.openscenario.model.positions import Position
from eidrive_scenario.openscenario.model.storyboard import Storyboard

if TYPE_CHECKING:
    from eidrive_scenario.openscenario.model.controllers import Controller
    from eidrive_scenario.openscenario.model.entities import MiscObject, Pedestrian, Sensor, Vehicle
    from eidrive_scenario.openscenario.model.global_actions import Environment
    from eidrive_scenario.openscenario.model.routing import Route, Trajectory
    from eidrive_scenario.openscenario.model.storyboard import Maneuver
    from eidrive_scenario.openscenario.model.traffic import TrafficDistributionEntry


class CatalogLocation(Element, content=ALL):
    """Location of the catalogs of one kind; the schema has a type of the same content for each kind."""

    directory: Directory


class CatalogLocations(Element, content=ALL):
    """Locations of the catalogs of a scenario, by kind."""

    vehicle_catalog: CatalogLocation | None = None
    controller_catalog: CatalogLocation | None = None
    pedestrian_catalog: CatalogLocation | None = None
    misc_object_catalog: CatalogLocation | None = None
    environment_catalog: CatalogLocation | None = None
    maneuver_catalog: CatalogLocation | None = None
    trajectory_catalog: CatalogLocation | None = None
    route_catalog: CatalogLocation | None = None
    sensor_catalog: CatalogLocation | None = child(since="1.2", until="1.2", deprecated="1.2")
    traffic_distribution_entry_catalog: CatalogLocation | None = child(since="1.4")


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


class License(Element):
    """License of the file, optionally with its text."""

    name: str
    resource: str | None = None
    spdx_id: str | None = None
    content: str = text()


class FileHeader(Element):
    """Author, date and revision of the standard of the file."""

    author: str
    date: datetime
    description: str
    rev_major: UnsignedShort
    rev_minor: UnsignedShort
    license: License | None = child(since="1.1")
    properties: Properties | None = child(since="1.2")


class UsedArea(Element):
    """Area of the world that the scenario uses."""

    position: tuple[Position, ...] = children(minimum=2)


class RoadNetwork(Element):
    """Road file, scene graph file and traffic signals."""

    logic_file: File | None = None
    scene_graph_file: File | None = None
    traffic_signals: TrafficSignals | None = None
    used_area: UsedArea | None = child(since="1.1")


class OpenScenario(
    Element,
    content=sequence(
        "file_header",
        choice(
            sequence(
                "parameter_declarations",
                "variable_declarations",
                "monitor_declarations",
                "catalog_locations",
                "road_network",
                "entities",
                "storyboard",
            ),
            "catalog",
            "parameter_value_distribution",
        ),
    ),
):
    """Scenario, catalog, or parameter value distribution."""

    file_header: FileHeader
    parameter_declarations: ParameterDeclarations | None = None
    variable_declarations: VariableDeclarations | None = child(since="1.2")
    monitor_declarations: MonitorDeclarations | None = child(since="1.3")
    catalog_locations: CatalogLocations | None = child(required=True)
    road_network: RoadNetwork | None = child(required=True)
    entities: Entities | None = child(required=True)
    storyboard: Storyboard | None = child(required=True)
    catalog: Catalog | None = None
    parameter_value_distribution: ParameterValueDistribution | None = child(since="1.1")
