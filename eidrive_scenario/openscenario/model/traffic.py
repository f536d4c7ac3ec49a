"""Background traffic: composition, sources, sinks, swarms and areas."""

from __future__ import annotations

from typing import TYPE_CHECKING

from eidrive_scenario.openscenario.model.controllers import ControllerDistribution
from eidrive_scenario.openscenario.model.declarations import (
    CatalogReference,
    EntityName,
    ParameterDeclarations,
    Properties,
    UnsignedInt,
)
from eidrive_scenario.openscenario.model.element import (
    ALL,
    CHOICE,
    SEQUENCE,
    Changed,
    Choice,
    Element,
    attribute,
    child,
    children,
    choice,
    sequence,
)
from eidrive_scenario.openscenario.model.entities import ScenarioObjectTemplate
from eidrive_scenario.openscenario.model.entity_enumerations import Role, VehicleCategory
from eidrive_scenario.openscenario.model.positions import Position

if TYPE_CHECKING:
    from eidrive_scenario.openscenario.model.distributions import Range


class CentralSwarmObject(Element):
    """Central entity of a swarm."""

    entity_ref: EntityName


class VehicleCategoryDistributionEntry(Element):
    """Category of vehicles and its share."""

    category: VehicleCategory
    weight: float


class VehicleCategoryDistribution(Element):
    """Categories of vehicles, by shares."""

    vehicle_category_distribution_entry: tuple[VehicleCategoryDistributionEntry, ...]


class VehicleRoleDistributionEntry(Element):
    """Role of vehicles and its share."""

    role: Role
    weight: float


class VehicleRoleDistribution(Element):
    """Roles of vehicles, by shares."""

    vehicle_role_distribution_entry: tuple[VehicleRoleDistributionEntry, ...]


class TrafficDefinition(Element, content=ALL):
    """Composition of traffic (before 1.3)."""

    name: str
    vehicle_category_distribution: VehicleCategoryDistribution
    vehicle_role_distribution: VehicleRoleDistribution | None = child(since="1.2")
    controller_distribution: ControllerDistribution


class EntityDistributionEntry(Element):
    """Entity template and its share."""

    weight: float
    scenario_object_template: ScenarioObjectTemplate


class EntityDistribution(Element):
    """Entity templates, by shares."""

    entity_distribution_entry: tuple[EntityDistributionEntry, ...]


class TrafficDistributionEntry(Element):
    """Kind of traffic and its share."""

    weight: float
    name: str | None = attribute(since="1.4")
    entity_distribution: EntityDistribution
    properties: Properties | None = None
    parameter_declarations: ParameterDeclarations | None = child(since="1.4")


class TrafficDistribution(
    Element,
    content=Changed(
        SEQUENCE,
        "1.4",
        Choice(
            (
                sequence(choice("traffic_distribution_entry"), "catalog_references"),
                sequence(choice("catalog_references"), "traffic_distribution_entry"),
            )
        ),
    ),
):
    """Composition of traffic, by shares."""

    traffic_distribution_entry: tuple[TrafficDistributionEntry, ...] = children(required_until="1.3")
    catalog_references: tuple[CatalogReference, ...] = children(since="1.4")


class AreaDistribution(Element):
    """Shares of a swarm in front, behind, left and right (1.2)."""

    front: float
    rear: float
    left: float
    right: float


class DirectionOfTravelDistribution(Element):
    """Shares of a swarm in the same and in the opposite direction."""

    same: float
    opposite: float


class TrafficSourceAction(Element, content=ALL):
    """Source of traffic at a position: radius [m], rate [1/s], speed [m/s]."""

    radius: float
    rate: float
    velocity: float | None = attribute(deprecated="1.2")
    speed: float | None = attribute(since="1.2")
    position: Position
    traffic_definition: TrafficDefinition | None = child(deprecated="1.3", required_until="1.2")
    traffic_distribution: TrafficDistribution | None = child(since="1.3")


class TrafficSinkAction(Element, content=ALL):
    """Sink of traffic at a position: radius [m], rate [1/s]."""

    radius: float
    rate: float | None = None
    position: Position
    traffic_definition: TrafficDefinition | None = child(deprecated="1.3")


class TrafficSwarmAction(Element, content=ALL):
    """Swarm of traffic around an entity, between two ellipses [m]."""

    inner_radius: float
    number_of_vehicles: UnsignedInt
    offset: float
    semi_major_axis: float
    semi_minor_axis: float
    velocity: float | None = attribute(deprecated="1.2")
    central_object: CentralSwarmObject
    traffic_definition: TrafficDefinition | None = child(deprecated="1.3", required_until="1.2")
    speed_range: Range | None = child(since="1.2", until="1.2", deprecated="1.2")
    area_distribution: AreaDistribution | None = child(since="1.2", until="1.2", deprecated="1.2")
    traffic_distribution: TrafficDistribution | None = child(since="1.3")
    initial_speed_range: Range | None = child(since="1.2")
    direction_of_travel_distribution: DirectionOfTravelDistribution | None = child(since="1.2")


class Lane(Element):
    """Lane by its id."""

    id: int


class RoadCursor(Element):
    """Position along a road [m], and the lanes there."""

    road_id: str
    s: float | None = None
    lane: tuple[Lane, ...] = ()


class RoadRange(Element):
    """Road section between cursors; length [m]."""

    length: float | None = None
    road_cursor: tuple[RoadCursor, ...] = children(minimum=2)


class Polygon(Element):
    """Area by the corners of a polygon."""

    position: tuple[Position, ...] = children(minimum=3)


class TrafficArea(Element, content=CHOICE):
    """Area of traffic."""

    polygon: Polygon | None = None
    road_range: tuple[RoadRange, ...] = ()


class TrafficAreaAction(Element, content=ALL):
    """Action that keeps a number of entities in an area."""

    number_of_entities: UnsignedInt
    continuous: bool
    traffic_distribution: TrafficDistribution
    traffic_area: TrafficArea


class TrafficStopAction(Element):
    """Stop of the traffic of a name."""


class TrafficAction(Element, content=Choice(empty_until="1.2")):
    """Action that starts or stops background traffic."""

    traffic_name: str | None = attribute(since="1.1")
    traffic_source_action: TrafficSourceAction | None = None
    traffic_sink_action: TrafficSinkAction | None = None
    traffic_swarm_action: TrafficSwarmAction | None = None
    traffic_area_action: TrafficAreaAction | None = child(since="1.3")
    traffic_stop_action: TrafficStopAction | None = child(since="1.1")
