"""Conversion of routes of the standard into routes over lanes, and random routes: at each junction one branch."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from itertools import accumulate

import numpy as np

from eidrive_scenario.base.randomness import generator
from eidrive_scenario.errors import Diagnostic, ScenarioError
from eidrive_scenario.openscenario import model
from eidrive_scenario.roads import (
    Branch,
    BranchSelector,
    Cost,
    LaneKey,
    LaneLocation,
    Pose,
    RoadNetwork,
    Route,
    RouteError,
    fastest,
    fewest_junctions,
    lanes_near,
    random_costs,
    select_lanes,
)
from eidrive_scenario.roads.routing.route import concatenate_routes
from eidrive_scenario.storyboard.kinematics.motion_state import ResolvedPosition

_OF_NO_LANE = (
    model.WorldPosition, model.RelativeWorldPosition, model.RelativeObjectPosition,
    model.GeoPosition, model.TrajectoryPosition,
)  # fmt: skip
"""Positions by coordinates, which may be on each of several lanes that overlap there."""
AT_WAYPOINT = 0.01
"""Maximum distance at which an actor is at the first waypoint of a closed route [m]."""


def build_route(
    route: model.Route,
    roads: RoadNetwork | None,
    resolve: Callable[[model.Position], ResolvedPosition],
    start: LaneLocation | None = None,
    *,
    seed: int = 0,
    again: bool = False,
    against_traffic: bool = False,
) -> Route:
    """Return the route through the waypoints, from `start` if given. Raise ScenarioError if there is none.

    The strategy of each waypoint determines the route to it; the random strategy depends on the seed and the name of
    the route. With `again` a closed route returns to its first waypoint. From `start` a route leads to that waypoint,
    or to the second one if `start` is between both, and the closed route is its lap. With `against_traffic` it leads
    against the driving direction of the lanes.
    """
    if roads is None:
        message = f"route {route.name!r}: the scenario has no road network"
        raise ScenarioError(Diagnostic.at(route, message, "specify one in RoadNetwork/LogicFile"))
    places = []
    for waypoint in route.waypoint:
        here = resolve(waypoint.position).location
        if here is None:
            message = "Waypoint: the position is not on a road"
            raise ScenarioError(Diagnostic.at(waypoint, message, "move it onto a lane"))
        places.append(_lanes_of(roads, waypoint.position, here))
    costs = [_cost(route, number, roads, seed) for number in range(len(places))]
    try:
        connect = partial(roads.route, against_traffic=against_traffic)
        waypoints = select_lanes(roads, places, costs[1:], against_traffic=against_traffic)
        return _connect_waypoints(waypoints, connect, costs, start, closed=again and route.closed)
    except RouteError as error:
        (cause,) = error.diagnostics
        kind = "closed route" if again and route.closed else "route"
        message = f"{kind} {route.name!r} is not drivable: {cause.message}"
        reopened = ', or set closed="false"' if again and route.closed else ""
        hint = f"{cause.hint}, or " * bool(cause.rule) + f"change its waypoints{reopened}"
        raise ScenarioError(Diagnostic.at(route, message, hint)) from error


def target_lane(
    roads: RoadNetwork, start: LaneLocation, position: model.Position, location: LaneLocation
) -> LaneLocation:
    """Return the lane of a position to which the route is the shortest, where lanes overlap.

    location  lane location to which the position resolves
    """
    return select_lanes(roads, [[start], _lanes_of(roads, position, location)])[-1]


def _lanes_of(roads: RoadNetwork, position: model.Position, location: LaneLocation) -> list[LaneLocation]:
    frame = position.chosen()
    if not isinstance(frame, _OF_NO_LANE):
        return [location]
    return lanes_near(roads, location, on_all_levels=isinstance(frame, model.WorldPosition) and frame.z is None)


def faces_traffic(roads: RoadNetwork, position: ResolvedPosition) -> bool:
    """Return True if a pose faces against the driving direction of its lane."""
    here = position.location
    return here is not None and math.cos(position.pose.h - roads.pose(here).h) < 0.0


def _connect_waypoints(
    waypoints: Sequence[LaneLocation],
    connect: Callable[..., Route],
    costs: Sequence[Cost | None],
    start: LaneLocation | None,
    *,
    closed: bool,
) -> Route:
    if start is not None and len(waypoints) > 1:
        behind = connect(waypoints[0], waypoints[1], costs=costs[1:2]).distance(start, waypoints[0])
        passed = int(behind is not None and behind[0] < -AT_WAYPOINT)
    else:
        passed = 0
    if not closed:
        if start is not None:
            return connect(start, waypoints[-1], waypoints[passed:-1], costs[passed:])
        return connect(waypoints[0], waypoints[-1], waypoints[1:-1], costs[1:])
    lap = replace(connect(waypoints[0], waypoints[0], waypoints[1:], [*costs[1:], costs[0]]), closed=True)
    if start is None or (start[:2] == waypoints[0][:2] and abs(start.s - waypoints[0].s) < AT_WAYPOINT):
        return lap
    if passed:
        return replace(connect(start, waypoints[0], waypoints[1:], [*costs[1:], costs[0]]), lap=lap)
    return replace(connect(start, waypoints[0], costs=costs[:1]), lap=lap)


def rejoin_route(roads: RoadNetwork, here: LaneLocation, route: Route, before: Pose | None) -> Route:
    """Return a route to the next waypoint of a route and along the rest of it. Raise RouteError if there is none.

    before  last pose of the actor on the route; None for an actor that was absent, which has all waypoints ahead
    """
    parts = route.parts or (route,)
    if before is None:
        waypoint, ahead = route.start, parts
    else:
        along, _ = route.project(before.x, before.y)
        reached = sum(end <= along for end in accumulate(part.length for part in parts[:-1]))
        waypoint, ahead = parts[reached].end, parts[reached + 1 :]
    if route.against_traffic:  # The way to the waypoint may lead with the traffic
        *via, end = waypoint, *(part.end for part in ahead)
        return roads.route(here, end, via)
    return concatenate_routes([roads.route(here, waypoint), *ahead])


def _cost(route: model.Route, number: int, roads: RoadNetwork, seed: int) -> Cost | None:
    """Return the cost function of the route to a waypoint; None for the length."""
    strategy = route.waypoint[number].route_strategy
    if strategy is model.RouteStrategy.FASTEST:
        return fastest(roads)
    if strategy is model.RouteStrategy.LEAST_INTERSECTIONS:
        return fewest_junctions(roads)
    if strategy is model.RouteStrategy.RANDOM:
        return random_costs(roads, generator(seed, "route", route.name, number))
    return None


def uniform_branch_selector(generator: np.random.Generator) -> BranchSelector:
    """Return a selector that draws a branch at each junction."""

    def select_branch(branches: Sequence[Branch]) -> Branch:
        return branches[int(generator.integers(len(branches)))]

    return select_branch


def random_route(roads: RoadNetwork, start: LaneLocation, length: float, select_branch: BranchSelector) -> Route:
    """Return a route from a location, at least `length` [m] long unless the road ends before."""
    direction = roads.driving_direction(start.road, start.lane)
    section = roads.road(start.road).section_at(start.s)
    key = LaneKey(start.road, section.index, start.lane)
    remaining = length - ((section.end - start.s) if direction > 0 else (start.s - section.s))
    lanes = [key]
    while remaining > 0.0:
        branches = roads.movement.branches(key, direction)
        if not branches:
            break
        branch = branches[0] if len(branches) == 1 else select_branch(branches)
        if branch.lane in lanes[-2:]:
            break
        key, direction = branch.lane, branch.direction
        lanes.append(key)
        section = roads.road(key.road).sections[key.section]
        remaining -= section.length
    end = section.end if direction > 0 else section.s
    return Route(roads.tables, tuple(lanes), start, LaneLocation(key.road, key.lane, end, 0.0, 0.0))
