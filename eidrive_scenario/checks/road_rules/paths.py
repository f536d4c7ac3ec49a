"""Rules on ways: trajectories and waypoints off the road, routes that lead nowhere."""

from __future__ import annotations

import math
from collections.abc import Iterator

from eidrive_scenario.checks.road_rules.context import RoadLintContext
from eidrive_scenario.checks.scenario_rules import at
from eidrive_scenario.errors import Diagnostic, InputError
from eidrive_scenario.openscenario.model import (
    AssignRouteAction,
    FollowTrajectoryAction,
    Position,
    Route,
    RouteRef,
    Trajectory,
    TrajectoryRef,
    Vehicle,
)
from eidrive_scenario.roads import Pose
from eidrive_scenario.storyboard.kinematics.route import build_route
from eidrive_scenario.storyboard.kinematics.trajectory import TrajectoryCurve, sample_trajectory

MARGIN = 2.0
"""How far from the outermost lane a vehicle may be and still count as on the road [m]: a bay, a verge."""
SPACING = 2.0
"""Distance between the points of a trajectory that are looked at [m]."""
MAX_POINTS = 5000
"""Maximum number of these points: those of a trajectory of more than 10 km are further apart."""


class _Relative(Exception):
    """A position depends on where somebody is."""


def trajectories_off_road(context: RoadLintContext) -> Iterator[Diagnostic]:
    """A trajectory of a vehicle that leaves all roads."""
    if context.roads is None:
        return
    for action, actors in context.performances:
        for element in action.walk():
            if isinstance(element, FollowTrajectoryAction) and _vehicles(context, actors):
                trajectory = _trajectory(context, element.trajectory_ref or element)
                layout = _layout(context, trajectory) if trajectory is not None else None
                if trajectory is not None and layout is not None:
                    yield from _leaves(context, element, trajectory, layout)


def _leaves(
    context: RoadLintContext, action: FollowTrajectoryAction, trajectory: Trajectory, layout: TrajectoryCurve
) -> Iterator[Diagnostic]:
    count = min(max(2, math.ceil(layout.length / SPACING) + 1), MAX_POINTS)
    along = [layout.length * number / (count - 1) for number in range(count)]
    points = [layout.at(s) for s in along]
    outside = context.outside([point.x for point in points], [point.y for point in points])
    first = next((number for number, gap in enumerate(outside) if gap > MARGIN), None)
    if first is not None:
        where = points[first]
        yield at(
            action,
            f"the trajectory {trajectory.name!r} leaves the road after {along[first]:.0f} m, at x = {where.x:.1f}, "
            f"y = {where.y:.1f}; it gets {max(outside):.1f} m away from it",
            "move its points onto a lane, or check the road file",
        )


def _layout(context: RoadLintContext, trajectory: Trajectory) -> TrajectoryCurve | None:
    """The trajectory in the world, None where it depends on somebody or a point of it is nowhere."""

    def pose(position: Position) -> Pose:
        place = context.place(position)
        if place is None:
            raise _Relative
        return place.pose

    spline = trajectory.shape.clothoid_spline
    if spline is not None and spline.clothoid_spline_segment[0].position_start is None:
        return None
    try:
        return sample_trajectory(trajectory, pose)
    except (_Relative, InputError, ValueError, ZeroDivisionError):
        return None


def _trajectory(context: RoadLintContext, given: TrajectoryRef | FollowTrajectoryAction) -> Trajectory | None:
    if given.trajectory is not None or given.catalog_reference is None:
        return given.trajectory
    entry = context.scenario.entries.get(given.catalog_reference)
    return entry if isinstance(entry, Trajectory) else None


def waypoints_off_road(context: RoadLintContext) -> Iterator[Diagnostic]:
    """A waypoint beside the road."""
    if context.roads is None:
        return
    for route in _routes(context):
        for waypoint in route.waypoint:
            if id(waypoint.position) in context.unresolved or (place := context.place(waypoint.position)) is None:
                continue
            gap = context.outside([place.pose.x], [place.pose.y])[0]
            if gap > MARGIN:
                yield at(waypoint, f"the waypoint is {gap:.1f} m off the road", "move it onto a lane")


def impossible_routes(context: RoadLintContext) -> Iterator[Diagnostic]:
    """A route between whose waypoints no lanes lead."""
    if context.roads is None:
        return
    for route in _routes(context):
        positions = [waypoint.position for waypoint in route.waypoint]
        if any(id(position) in context.unresolved or context.place(position) is None for position in positions):
            continue
        try:
            build_route(route, context.roads, context.place, again=True)  # type: ignore[arg-type]
        except InputError as error:
            for diagnostic in error.diagnostics:
                yield at(route, diagnostic.message, diagnostic.hint)


def _routes(context: RoadLintContext) -> Iterator[Route]:
    """Routes that the scenario uses, each once."""
    routes = []
    for element in context.elements:
        if isinstance(element, AssignRouteAction | RouteRef):
            entry = element.route or (
                context.scenario.entries.get(element.catalog_reference) if element.catalog_reference else None
            )
            if isinstance(entry, Route):
                routes.append(entry)
    yield from {id(route): route for route in routes}.values()


def _vehicles(context: RoadLintContext, actors: tuple[str, ...]) -> bool:
    return any(isinstance(context.scenario.entities.get(name), Vehicle) for name in actors)
