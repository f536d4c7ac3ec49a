"""Root of a file: its header and one of the three kinds of documents."""

from __future__ import annotations

from datetime import datetime

from eidrive_scenario.openscenario.model.catalogs import Catalog, CatalogLocations
from eidrive_scenario.openscenario.model.content import choice, sequence
from eidrive_scenario.openscenario.model.declarations import (
    MonitorDeclarations,
    ParameterDeclarations,
    VariableDeclarations,
)
from eidrive_scenario.openscenario.model.distributions import ParameterValueDistribution
from eidrive_scenario.openscenario.model.element import Element, child, children, element_type, text
from eidrive_scenario.openscenario.model.entities import Entities
from eidrive_scenario.openscenario.model.positions import Position
from eidrive_scenario.openscenario.model.properties import File, Properties
from eidrive_scenario.openscenario.model.scalars import UnsignedShort
from eidrive_scenario.openscenario.model.signals import TrafficSignals
from eidrive_scenario.openscenario.model.storyboard import Storyboard


@element_type
class License(Element):
    """License of the file, optionally with its text."""

    name: str
    resource: str | None = None
    spdx_id: str | None = None
    content: str = text()


@element_type
class FileHeader(Element):
    """Author, date and revision of the standard of the file."""

    author: str
    date: datetime
    description: str
    rev_major: UnsignedShort
    rev_minor: UnsignedShort
    license: License | None = child(since="1.1")
    properties: Properties | None = child(since="1.2")


@element_type
class UsedArea(Element):
    """Area of the world that the scenario uses."""

    position: tuple[Position, ...] = children(minimum=2)


@element_type
class RoadNetwork(Element):
    """Road file, scene graph file and traffic signals."""

    logic_file: File | None = None
    scene_graph_file: File | None = None
    traffic_signals: TrafficSignals | None = None
    used_area: UsedArea | None = child(since="1.1")


@element_type
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
