"""Positions in all coordinate systems of the standard."""

from __future__ import annotations

from typing import TYPE_CHECKING

from eidrive_scenario.openscenario.model.declarations import CatalogReference, EntityName
from eidrive_scenario.openscenario.model.element import ALL, CHOICE, Choice, Element, attribute, child
from eidrive_scenario.openscenario.model.enumerations import LaneLayerType, ReferenceContext

if TYPE_CHECKING:
    from eidrive_scenario.openscenario.model.routing import Route, Trajectory


class Orientation(Element):
    """Heading, pitch and roll [rad], absolute or relative to the reference of the position.

    A missing type is relative in files since version 1.3, and absolute before.
    """

    h: float | None = None
    p: float | None = None
    r: float | None = None
    type: ReferenceContext | None = None


class WorldPosition(Element):
    """Point [m] and orientation [rad] in the world frame."""

    x: float
    y: float
    h: float | None = None
    p: float | None = None
    r: float | None = None
    z: float | None = None


class RelativeWorldPosition(Element, content=ALL):
    """Point with an offset from an entity along the world axes [m]."""

    entity_ref: EntityName
    dx: float
    dy: float
    dz: float | None = None
    orientation: Orientation | None = None


class RelativeObjectPosition(Element, content=ALL):
    """Point with an offset from an entity along its axes [m]."""

    entity_ref: EntityName
    dx: float
    dy: float
    dz: float | None = None
    orientation: Orientation | None = None


class RoadPosition(Element, content=ALL):
    """Point in road coordinates [m]."""

    road_id: str
    s: float
    t: float
    orientation: Orientation | None = None


class RelativeRoadPosition(Element, content=ALL):
    """Point with an offset from an entity in road coordinates [m]."""

    entity_ref: EntityName
    ds: float
    dt: float
    orientation: Orientation | None = None


class LanePosition(Element, content=ALL):
    """Point in a lane: s along the road, offset from the lane center [m]."""

    lane_id: str
    road_id: str
    s: float
    offset: float | None = None
    layer: LaneLayerType | None = attribute(since="1.4")
    orientation: Orientation | None = None


class RelativeLanePosition(Element, content=ALL):
    """Point relative to the lane of an entity; ds along the road, dsLane along the lane center [m]."""

    entity_ref: EntityName
    d_lane: int
    ds: float | None = attribute(required_until="1.0")
    offset: float | None = None
    ds_lane: float | None = attribute(since="1.1")
    orientation: Orientation | None = None


class PositionOfCurrentEntity(Element):
    """Point on the route at the current position of an entity."""

    entity_ref: EntityName


class PositionInRoadCoordinates(Element):
    """Point on the route: distance along it and lateral offset [m]."""

    path_s: float
    t: float


class PositionInLaneCoordinates(Element):
    """Point on the route: distance along it, lane, offset from the lane center [m]."""

    lane_id: str
    path_s: float
    lane_offset: float | None = None


class InRoutePosition(Element, content=Choice(empty_until="1.2")):
    """Choice of coordinates of a point on a route."""

    from_current_entity: PositionOfCurrentEntity | None = None
    from_road_coordinates: PositionInRoadCoordinates | None = None
    from_lane_coordinates: PositionInLaneCoordinates | None = None


class RouteRef(Element, content=Choice(empty_until="1.2")):
    """Route, defined in place or in a catalog."""

    route: Route | None = None
    catalog_reference: CatalogReference | None = None


class RoutePosition(Element, content=ALL):
    """Point on a route."""

    route_ref: RouteRef
    orientation: Orientation | None = None
    in_route_position: InRoutePosition


class TrajectoryRef(Element, content=CHOICE):
    """Trajectory, defined in place or in a catalog."""

    trajectory: Trajectory | None = None
    catalog_reference: CatalogReference | None = None


class TrajectoryPosition(Element, content=ALL):
    """Point relative to a trajectory: s along it, t to its left [m]."""

    s: float
    t: float | None = None
    orientation: Orientation | None = None
    trajectory_ref: TrajectoryRef


class GeoPosition(Element, content=ALL):
    """Geodetic point in degrees and meters; the older attributes are in radians."""

    latitude: float | None = attribute(deprecated="1.2", required_until="1.1")
    longitude: float | None = attribute(deprecated="1.2", required_until="1.1")
    height: float | None = attribute(deprecated="1.2")
    latitude_deg: float | None = attribute(since="1.2")
    longitude_deg: float | None = attribute(since="1.2")
    altitude: float | None = attribute(since="1.2")
    vertical_road_selection: int | None = attribute(since="1.3")
    orientation: Orientation | None = None


class Position(Element, content=Choice(empty_until="1.2")):
    """Position in one of the coordinate systems."""

    world_position: WorldPosition | None = None
    relative_world_position: RelativeWorldPosition | None = None
    relative_object_position: RelativeObjectPosition | None = None
    road_position: RoadPosition | None = None
    relative_road_position: RelativeRoadPosition | None = None
    lane_position: LanePosition | None = None
    relative_lane_position: RelativeLanePosition | None = None
    route_position: RoutePosition | None = None
    geo_position: GeoPosition | None = child(since="1.1")
    trajectory_position: TrajectoryPosition | None = child(since="1.1")
