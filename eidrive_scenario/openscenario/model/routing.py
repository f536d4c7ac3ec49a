"""Routes and trajectories, and the actions that follow them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from eidrive_scenario.openscenario.model.declarations import CatalogReference, ParameterDeclarations, UnsignedInt
from eidrive_scenario.openscenario.model.element import ALL, Choice, Element, attribute, child, children
from eidrive_scenario.openscenario.model.enumerations import (
    FollowingMode,
    LaneLayerType,
    ReferenceContext,
    RouteStrategy,
)
from eidrive_scenario.openscenario.model.positions import Position, TrajectoryRef


class Waypoint(Element):
    """Point of a route and the strategy of the routing to it."""

    route_strategy: RouteStrategy
    position: Position


class Route(Element):
    """Route as ordered waypoints."""

    closed: bool
    name: str
    parameter_declarations: ParameterDeclarations | None = None
    waypoint: tuple[Waypoint, ...] = children(minimum=2)


class Motion(Element):
    """Motion at a point of a trajectory: speed [m/s] and acceleration [m/s²] along it."""

    speed_longitudinal: float | None = attribute(name="speed_longitudinal")
    acceleration_longitudinal: float | None = attribute(name="acceleration_longitudinal")


class Vertex(Element):
    """Vertex of a polyline; time [s]."""

    time: float | None = attribute(required_until="1.0")
    position: Position
    motion: Motion | None = child(since="1.4")


class Interpolation(Element):
    """Interpolation between the vertices of a polyline by the tool."""


class Polyline(Element):
    """Polyline between vertices."""

    vertex: tuple[Vertex, ...] = children(minimum=2)
    interpolation: Interpolation | None = child(since="1.4")


class Clothoid(Element):
    """Curve with linearly changing curvature [1/m]; length [m], times [s]."""

    curvature: float
    length: float
    curvature_dot: float | None = attribute(deprecated="1.1", required_until="1.0")
    start_time: float | None = None
    stop_time: float | None = None
    curvature_prime: float | None = attribute(since="1.1")
    position: Position
    motion_start: Motion | None = child(since="1.4")
    motion_end: Motion | None = child(since="1.4")


class ClothoidSplineSegment(Element):
    """Segment of a clothoid spline: curvatures [1/m], length [m], heading offset [rad], time [s]."""

    curvature_start: float
    curvature_end: float
    length: float
    h_offset: float | None = None
    time_start: float | None = None
    position_start: Position | None = None
    motion_start: Motion | None = child(since="1.4")


class ClothoidSpline(Element):
    """Sequence of clothoids; end time [s]."""

    time_end: float | None = None
    clothoid_spline_segment: tuple[ClothoidSplineSegment, ...]
    motion_end: Motion | None = child(since="1.4")


class ControlPoint(Element):
    """Control point of a NURBS; time [s]."""

    time: float | None = None
    weight: float | None = None
    position: Position


class Knot(Element):
    """Value of the knot vector."""

    value: float


class Nurbs(Element):
    """Non-uniform rational B-spline."""

    order: UnsignedInt
    control_point: tuple[ControlPoint, ...] = children(minimum=2)
    knot: tuple[Knot, ...] = children(minimum=2)


class Shape(Element, content=Choice(empty_until="1.2")):
    """Choice of the shape of a trajectory."""

    polyline: Polyline | None = None
    clothoid: Clothoid | None = None
    clothoid_spline: ClothoidSpline | None = child(since="1.3")
    nurbs: Nurbs | None = None


class Trajectory(Element):
    """Curve in space, optionally with times."""

    closed: bool
    name: str
    parameter_declarations: ParameterDeclarations | None = None
    shape: Shape


class None_(Element):
    """Time reference of a trajectory without timing."""


class Timing(Element):
    """Timing of a trajectory: absolute or relative, with scale and offset [s]."""

    domain_absolute_relative: ReferenceContext
    offset: float
    scale: float


class TimeReference(Element, content=Choice(empty_until="1.2")):
    """Choice whether the times of a trajectory apply."""

    none: None_ | None = None
    timing: Timing | None = None


class TrajectoryFollowingMode(Element):
    """Mode of following: exactly, or within the limits of the vehicle."""

    following_mode: FollowingMode


class AssignRouteAction(Element, content=Choice(empty_until="1.2")):
    """Action that assigns a route to an entity."""

    route: Route | None = None
    catalog_reference: CatalogReference | None = None


class FollowTrajectoryAction(Element, content=ALL):
    """Action that moves an entity along a trajectory; initial offset [m]."""

    initial_distance_offset: float | None = attribute(since="1.1")
    trajectory: Trajectory | None = child(deprecated="1.1")
    catalog_reference: CatalogReference | None = child(deprecated="1.1")
    time_reference: TimeReference
    trajectory_following_mode: TrajectoryFollowingMode
    trajectory_ref: TrajectoryRef | None = child(since="1.1")


class AcquirePositionAction(Element, content=ALL):
    """Action that routes an entity to a position."""

    position: Position


class RandomRouteAction(Element):
    """Action that lets the engine choose the route."""


class PreferredLaneLayerAction(Element):
    """Action that sets the lane layer that an entity prefers."""

    layer: LaneLayerType


class RoutingAction(Element, content=Choice(empty_until="1.2")):
    """Routing action of an entity."""

    assign_route_action: AssignRouteAction | None = None
    follow_trajectory_action: FollowTrajectoryAction | None = None
    acquire_position_action: AcquirePositionAction | None = None
    random_route_action: RandomRouteAction | None = child(since="1.3")
    preferred_lane_layer_action: PreferredLaneLayerAction | None = child(since="1.4")


TIME_ATTRIBUTES: Mapping[type[Element], str] = {
    Polyline: "the time of each vertex",
    Clothoid: "startTime and stopTime",
    ClothoidSpline: "timeEnd",
    Nurbs: "the time of each control point",
}
"""Attributes of a shape that specify its times."""


def has_times(shape: Element) -> bool:
    """Return True if a shape has all times that a Timing scales, and they are not all equal."""
    if isinstance(shape, Polyline):
        return _ascend([vertex.time for vertex in shape.vertex])
    if isinstance(shape, Nurbs):
        return _ascend([point.time for point in shape.control_point])
    if isinstance(shape, Clothoid):
        return _ascend([shape.start_time, shape.stop_time])
    if isinstance(shape, ClothoidSpline):
        first = shape.clothoid_spline_segment[0].time_start if shape.clothoid_spline_segment else None
        return _ascend([first or 0.0, shape.time_end])
    return False


def _ascend(times: Sequence[float | None]) -> bool:
    given = [time for time in times if time is not None]
    return len(given) == len(times) and len(given) > 1 and given[-1] > given[0]
