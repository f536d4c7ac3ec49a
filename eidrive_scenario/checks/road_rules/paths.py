"""Rules about trajectories and waypoints outside of roads, and about impossible routes."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import partial

from eidrive_scenario.checks.road_rules.context import RoadLintContext
from eidrive_scenario.checks.rule import at
from eidrive_scenario.errors import Diagnostic, InputError
from eidrive_scenario.openscenario.model import (
    AcquirePositionAction,
    AssignRouteAction,
    FollowTrajectoryAction,
    Position,
    Route,
    RouteRef,
    TeleportAction,
    Trajectory,
    Vehicle,
    Waypoint,
)
from eidrive_scenario.roads import Pose, RoadNetwork
from eidrive_scenario.storyboard.kinematics.route import build_route, faces_traffic
from eidrive_scenario.storyboard.kinematics.trajectory import TrajectoryCurve
from eidrive_scenario.storyboard.kinematics.trajectory_sampling import sample_trajectory

MARGIN = 2.0
"""Maximum distance from the outermost lane that counts as on the road [m], for bays and verges."""
SPACING = 2.0
"""Distance between the checked points of a trajectory [m]."""
MAX_POINTS = 5000
"""Maximum number of checked points; their distance is larger on trajectories of more than 10 km."""


class _RelativePosition(Exception):
    """Position that depends on the pose of an entity."""


def trajectories_off_road(context: RoadLintContext) -> Iterator[Diagnostic]:
    """Yield trajectories of vehicles that leave all roads."""
    if context.roads is None:
        return
    for action, actors in context.performances:
        for element in action.walk():
            if isinstance(element, FollowTrajectoryAction) and _vehicles(context, actors):
                trajectory = context.trajectory(element)
                curve = _curve(context, trajectory) if trajectory is not None else None
                if trajectory is not None and curve is not None:
                    yield from _departure(context, element, trajectory, curve)


def _departure(
    context: RoadLintContext, action: FollowTrajectoryAction, trajectory: Trajectory, curve: TrajectoryCurve
) -> Iterator[Diagnostic]:
    """Yield a diagnostic at the first point of a curve outside of the road."""
    count = min(max(2, math.ceil(curve.length / SPACING) + 1), MAX_POINTS)
    distances = [curve.length * number / (count - 1) for number in range(count)]
    points = [curve.at(s) for s in distances]
    outside = context.outside([point.x for point in points], [point.y for point in points])
    first = next((number for number, gap in enumerate(outside) if gap > MARGIN), None)
    if first is not None:
        point = points[first]
        yield at(
            action,
            f"trajectory {trajectory.name!r} leaves the road after {distances[first]:.0f} m, at x = {point.x:.1f}, "
            f"y = {point.y:.1f}; its maximum distance from the road is {max(outside):.1f} m",
            "move its points onto a lane, or check the road file",
        )


def _curve(context: RoadLintContext, trajectory: Trajectory) -> TrajectoryCurve | None:
    """Return the trajectory in the world frame; None if a point depends on an entity or cannot be resolved."""

    def pose(position: Position) -> Pose:
        place = context.place(position)
        if place is None:
            raise _RelativePosition
        return place.pose

    spline = trajectory.shape.clothoid_spline
    if spline is not None and spline.clothoid_spline_segment[0].position_start is None:
        return None
    try:
        return sample_trajectory(trajectory, pose)
    except (_RelativePosition, InputError, ValueError, ZeroDivisionError):
        return None


def waypoints_off_road(context: RoadLintContext) -> Iterator[Diagnostic]:
    """Yield waypoints and destinations outside of the road."""
    if context.roads is None:
        return
    waypoints: list[Waypoint | AcquirePositionAction] = [one for route in _routes(context) for one in route.waypoint]
    waypoints += [element for element in context.elements if isinstance(element, AcquirePositionAction)]
    for waypoint in waypoints:
        if id(waypoint.position) in context.unresolved or (place := context.place(waypoint.position)) is None:
            continue
        gap = context.outside([place.pose.x], [place.pose.y])[0]
        if gap > MARGIN:
            what = "waypoint" if isinstance(waypoint, Waypoint) else "destination"
            yield at(waypoint, f"the {what} is {gap:.1f} m outside the road", "move it onto a lane")


def impossible_routes(context: RoadLintContext) -> Iterator[Diagnostic]:
    """Yield routes whose waypoints are not connected by lanes."""
    if context.roads is None:
        return
    for route in _routes(context):
        positions = [waypoint.position for waypoint in route.waypoint]
        if any(id(position) in context.unresolved or context.place(position) is None for position in positions):
            continue
        build = partial(build_route, route, context.roads, context.place, again=True)  # type: ignore[arg-type]
        try:
            build()
        except InputError as error:
            if not (_has_wrong_way_driver(context, context.roads, route) and _is_drivable(build)):
                for diagnostic in error.diagnostics:
                    yield at(route, diagnostic.message, diagnostic.hint)


def _is_drivable(build: Callable[..., object]) -> bool:
    """Return True if a route can be driven against the traffic."""
    try:
        build(against_traffic=True)
    except InputError:
        return False
    return True


def _has_wrong_way_driver(context: RoadLintContext, roads: RoadNetwork, route: Route) -> bool:
    """Return True if the first waypoint, or a position to which an actor of the route is teleported, faces traffic."""
    drivers = {
        name
        for action, actors in context.performances
        if any(isinstance(one, AssignRouteAction) and _route_of(context, one) is route for one in action.walk())
        for name in actors
    }
    positions = [route.waypoint[0].position]
    for action, actors in context.performances:
        if drivers.intersection(actors):
            positions += [one.position for one in action.walk() if isinstance(one, TeleportAction)]
    resolved = [context.place(position) for position in positions if id(position) not in context.unresolved]
    return any(faces_traffic(roads, place) for place in resolved if place is not None)


def _routes(context: RoadLintContext) -> Iterator[Route]:
    """Yield the routes that the scenario uses, each once."""
    routes = []
    for element in context.elements:
        if isinstance(element, AssignRouteAction | RouteRef):
            route = _route_of(context, element)
            if route is not None:
                routes.append(route)
    yield from {id(route): route for route in routes}.values()


def _route_of(context: RoadLintContext, element: AssignRouteAction | RouteRef) -> Route | None:
    """Return the route of an element, possibly from a catalog; None if it is missing."""
    reference = element.catalog_reference
    entry = element.route or (context.scenario.entries.get(reference) if reference else None)
    return entry if isinstance(entry, Route) else None


def _vehicles(context: RoadLintContext, actors: tuple[str, ...]) -> bool:
    return any(isinstance(context.scenario.entities.get(name), Vehicle) for name in actors)
