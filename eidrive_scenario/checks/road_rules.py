"""Rules of `eidrive check` about the road file, and about positions, lanes, signals and paths on it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from functools import cached_property, partial
from pathlib import Path

import numpy as np

from eidrive_scenario.checks.rule import Level, Rule, at
from eidrive_scenario.checks.scenario_rules.context import LintContext
from eidrive_scenario.driving.station_declarations import declared_settings
from eidrive_scenario.driving.station_warnings import areas_off_road, lights_out_of_view
from eidrive_scenario.errors import Diagnostic, InputError, suggestion
from eidrive_scenario.openscenario import Scenario, model
from eidrive_scenario.openscenario.values.scalars import lane_number
from eidrive_scenario.roads import Pose, PositionError, RoadNetwork
from eidrive_scenario.roads.model.map_warnings import MapRule
from eidrive_scenario.storyboard.context.contexts import EntityAbsentError
from eidrive_scenario.storyboard.context.runtime_context import RuntimeContext
from eidrive_scenario.storyboard.kinematics.motion_state import ResolvedPosition
from eidrive_scenario.storyboard.kinematics.route import build_route, faces_traffic
from eidrive_scenario.storyboard.kinematics.trajectory import TrajectoryCurve
from eidrive_scenario.storyboard.kinematics.trajectory_sampling import sample_trajectory
from eidrive_scenario.storyboard.positions.resolution import referenced_entities, resolve_position


class RoadLintContext(LintContext):
    """Lint context of a scenario with its road network, without actors in the world."""

    def __init__(self, scenario: Scenario, roads: RoadNetwork | None, added: tuple[str | Path, ...] = ()) -> None:
        super().__init__(scenario, added)
        self.roads = roads
        self.context = RuntimeContext(scenario, roads, dt=0.0, seed=0)

    def resolve(self, position: model.Position) -> ResolvedPosition | None:
        """Return the resolved position; None if it depends on an entity. Raise InputError if it does not exist."""
        if referenced_entities(position):
            return None
        try:
            return resolve_position(position, self.context)
        except (EntityAbsentError, ValueError):
            return None

    @cached_property
    def unresolved(self) -> dict[int, InputError]:
        """Return the errors of positions that cannot be resolved, by identity of the position."""
        errors = {}
        for position in self.of(model.Position):
            try:
                self.resolve(position)
            except InputError as error:
                errors[id(position)] = error
        return errors

    def outside(self, x: list[float], y: list[float]) -> list[float]:
        """Return the distances of points from the edge of the nearest road [m]; 0 on a road."""
        assert self.roads is not None
        distances: list[float] = self.roads.locate(x, y, reach=np.inf).outside.tolist()
        return distances


def map_warning_rule(name: str) -> Callable[[RoadNetwork], Iterator[Diagnostic]]:
    """Return the check of a rule whose violations the road network reports itself."""
    return lambda roads: (diagnostic for diagnostic in roads.map_warnings if diagnostic.rule == name)


def _invalid_geo_reference(roads: RoadNetwork) -> Iterator[Diagnostic]:
    if not roads.header.geo_reference:
        return
    try:
        _ = roads.geo_reference
    except PositionError as error:
        for diagnostic in error.diagnostics:
            yield replace(diagnostic, message=f"{diagnostic.message}; no GeoPosition can be resolved")


ROAD_FILE_RULES: tuple[Rule[RoadNetwork], ...] = (
    *(Rule(rule.id, Level.WARNING, rule.value, map_warning_rule(rule.id)) for rule in MapRule),
    Rule("geo-reference", Level.WARNING, "a geoReference that cannot be used", _invalid_geo_reference),
)
"""Rules that need only the road file."""


LENGTH_TOLERANCE = 0.01
"""Maximum rounding error of the length of a road in its file [m]."""
_ADDRESS = "="
"""Part of signal references of ScenarioRunner, such as `pos=x,y` or `id=7`."""


def unresolvable_positions(context: RoadLintContext) -> Iterator[Diagnostic]:
    """Yield positions on a road or lane that does not exist."""
    yield from dict.fromkeys(diagnostic for error in context.unresolved.values() for diagnostic in error.diagnostics)


def s_out_of_range(context: RoadLintContext) -> Iterator[Diagnostic]:
    """Yield positions with an s outside the road; a run uses the end of the road, as other engines do."""
    for element in context.elements:
        if context.roads is None or not isinstance(element, model.LanePosition | model.RoadPosition):
            continue
        road = context.roads.roads.get(element.road_id)
        if road is not None and not -LENGTH_TOLERANCE <= element.s <= road.length + LENGTH_TOLERANCE:
            message = f"s = {element.s:g} is outside road {road.id!r}, which is {road.length:.2f} m long"
            yield at(element, message, "the end of the road is used; specify an s on the road")


def unknown_lanes(context: RoadLintContext) -> Iterator[Diagnostic]:
    """Yield lane changes to a lane that no road has."""
    if context.roads is None:
        return
    lanes = {number for road in context.roads.roads.values() for part in road.sections for number in part.lanes} - {0}
    for action in context.of(model.LaneChangeAction):
        target = action.lane_change_target.absolute_target_lane
        lane = None if target is None else lane_number(target.value)
        if target is None or lane is None:
            continue  # Other texts are errors of the run setup.
        if lane not in lanes:
            shown = ", ".join(str(lane) for lane in sorted(lanes))
            yield at(target, f"lane {target.value!r} exists on no road", f"known: {shown}")


def unknown_signals(context: RoadLintContext) -> Iterator[Diagnostic]:
    """Yield traffic signals that the road network does not contain."""
    if context.roads is None:
        return
    signals = set(context.roads.signals)
    for element in context.elements:
        match element:
            case (
                model.TrafficSignalState(traffic_signal_id=name)
                | model.TrafficSignalStateAction(name=name)
                | model.TrafficSignalCondition(name=name)
            ) if name not in signals and _ADDRESS not in name:
                hint = suggestion(name, signals) if signals else "the road file defines none"
                yield at(element, f"traffic signal {name!r} does not exist in the road network", hint)


def conflict_areas_off_road(context: RoadLintContext) -> Iterator[Diagnostic]:
    """Yield conflict areas without a part on a road; invalid settings are reported by the run setup."""
    with suppress(InputError):
        yield from areas_off_road(context.scenario, declared_settings(context.scenario), context.roads)


def unseen_lights(context: RoadLintContext) -> Iterator[Diagnostic]:
    """Yield vehicles that obey traffic lights and have none in view; invalid settings are reported by the run setup."""
    with suppress(InputError):
        yield from lights_out_of_view(context.scenario, declared_settings(context.scenario), context.roads)


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
            if isinstance(element, model.FollowTrajectoryAction) and _vehicles(context, actors):
                trajectory = context.trajectory(element)
                curve = _curve(context, trajectory) if trajectory is not None else None
                if trajectory is not None and curve is not None:
                    yield from _departure(context, element, trajectory, curve)


def _departure(
    context: RoadLintContext, action: model.FollowTrajectoryAction, trajectory: model.Trajectory, curve: TrajectoryCurve
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


def _curve(context: RoadLintContext, trajectory: model.Trajectory) -> TrajectoryCurve | None:
    """Return the trajectory in the world frame; None if a point depends on an entity or cannot be resolved."""

    def pose(position: model.Position) -> Pose:
        resolved = context.resolve(position)
        if resolved is None:
            raise _RelativePosition
        return resolved.pose

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
    waypoints: list[model.Waypoint | model.AcquirePositionAction] = []
    waypoints += [waypoint for route in _routes(context) for waypoint in route.waypoint]
    waypoints += context.of(model.AcquirePositionAction)
    for waypoint in waypoints:
        if id(waypoint.position) in context.unresolved or (resolved := context.resolve(waypoint.position)) is None:
            continue
        gap = context.outside([resolved.pose.x], [resolved.pose.y])[0]
        if gap > MARGIN:
            what = "waypoint" if isinstance(waypoint, model.Waypoint) else "destination"
            yield at(waypoint, f"the {what} is {gap:.1f} m outside the road", "move it onto a lane")


def impossible_routes(context: RoadLintContext) -> Iterator[Diagnostic]:
    """Yield routes whose waypoints are not connected by lanes."""
    if context.roads is None:
        return
    for route in _routes(context):
        positions = [waypoint.position for waypoint in route.waypoint]
        if any(id(position) in context.unresolved or context.resolve(position) is None for position in positions):
            continue
        build = partial(build_route, route, context.roads, context.resolve, again=True)  # type: ignore[arg-type]
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


def _has_wrong_way_driver(context: RoadLintContext, roads: RoadNetwork, route: model.Route) -> bool:
    """Return True if the first waypoint, or a position to which an actor of the route is teleported, faces traffic."""
    drivers = {
        name
        for action, actors in context.performances
        if any(
            isinstance(part, model.AssignRouteAction) and _route_of(context, part) is route for part in action.walk()
        )
        for name in actors
    }
    positions = [route.waypoint[0].position]
    for action, actors in context.performances:
        if drivers.intersection(actors):
            positions += [part.position for part in action.walk() if isinstance(part, model.TeleportAction)]
    resolved = [context.resolve(position) for position in positions if id(position) not in context.unresolved]
    return any(faces_traffic(roads, position) for position in resolved if position is not None)


def _routes(context: RoadLintContext) -> Iterator[model.Route]:
    """Yield the routes that the scenario uses, each once."""
    routes = [
        _route_of(context, element)
        for element in context.elements
        if isinstance(element, model.AssignRouteAction | model.RouteRef)
    ]
    yield from {id(route): route for route in routes if route is not None}.values()


def _route_of(context: RoadLintContext, element: model.AssignRouteAction | model.RouteRef) -> model.Route | None:
    """Return the route of an element, possibly from a catalog; None if it is missing."""
    reference = element.catalog_reference
    entry = element.route or (context.scenario.entries.get(reference) if reference else None)
    return entry if isinstance(entry, model.Route) else None


def _vehicles(context: RoadLintContext, actors: tuple[str, ...]) -> bool:
    return any(isinstance(context.scenario.entities.get(name), model.Vehicle) for name in actors)


ROAD_RULES: tuple[Rule[RoadLintContext], ...] = (
    Rule(
        "unresolvable-position",
        Level.ERROR,
        "a position that the road network does not contain",
        unresolvable_positions,
    ),
    Rule("s-out-of-range", Level.WARNING, "an s beyond the end of its road", s_out_of_range),
    Rule("no-route", Level.ERROR, "a route whose waypoints no lanes connect", impossible_routes),
    Rule("unknown-lane", Level.WARNING, "a lane change to a lane that no road has", unknown_lanes),
    Rule("unknown-signal", Level.WARNING, "a traffic signal that no road has", unknown_signals),
    Rule("trajectory-off-road", Level.WARNING, "a trajectory that leaves the road", trajectories_off_road),
    Rule("waypoint-off-road", Level.WARNING, "a waypoint or a destination outside the road", waypoints_off_road),
    Rule("conflict-area-off-road", Level.WARNING, "a conflict area outside the road", conflict_areas_off_road),
    Rule("unseen-lights", Level.WARNING, "a vehicle that obeys lights and has none in view", unseen_lights),
)
"""Rules that need a scenario and its road network."""
