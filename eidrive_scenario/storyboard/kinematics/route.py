"""Routes of the standard as routes over the lanes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from eidrive_scenario.errors import Diagnostic, ScenarioError
from eidrive_scenario.openscenario import model
from eidrive_scenario.randomness import generator
from eidrive_scenario.roads import (
    Cost,
    LaneLocation,
    RoadNetwork,
    Route,
    RouteError,
    fastest,
    fewest_junctions,
    random_costs,
)
from eidrive_scenario.storyboard.kinematics.motion_state import ResolvedPosition

HERE = 0.01
"""Who is this near to the first waypoint of a closed route is on it [m]."""


def build_route(
    route: model.Route,
    roads: RoadNetwork | None,
    resolve: Callable[[model.Position], ResolvedPosition],
    start: LaneLocation | None = None,
    *,
    seed: int = 0,
    again: bool = False,
) -> Route:
    """The way through the waypoints of a route, from `start` if given. Raises ScenarioError.

    Each waypoint's strategy chooses the way to it; of the random one the seed and the route's name decide. With `again`
    a closed route comes back to its first waypoint; from `start` a way leads there, and the closed route is its lap.
    """
    if roads is None:
        raise ScenarioError(Diagnostic(f"route {route.name!r} needs a road network", "", route.source, route.line))
    places = []
    for waypoint in route.waypoint:
        here = resolve(waypoint.position).location
        if here is None:
            raise ScenarioError(
                Diagnostic("the waypoint is not on a road", "move it onto a lane", waypoint.source, waypoint.line)
            )
        places.append(here)
    costs = [_cost(route, number, roads, seed) for number in range(len(places))]
    try:
        return _through(places, roads, costs, start, closed=again and route.closed)
    except RouteError as error:
        what = "round the closed" if again and route.closed else "along the"
        message = f"no way leads {what} route {route.name!r}: {error.diagnostics[0].message}"
        hint = "change its waypoints" + (', or say closed="false"' if again and route.closed else "")
        raise ScenarioError(Diagnostic(message, hint, route.source, route.line)) from error


def _through(
    places: Sequence[LaneLocation],
    roads: RoadNetwork,
    costs: Sequence[Cost | None],
    start: LaneLocation | None,
    *,
    closed: bool,
) -> Route:
    if not closed:
        if start is not None:
            return roads.route(start, places[-1], places[:-1], costs)
        return roads.route(places[0], places[-1], places[1:-1], costs[1:])
    lap = replace(roads.route(places[0], places[0], places[1:], [*costs[1:], costs[0]]), closed=True)
    if start is None or (start[:2] == places[0][:2] and abs(start.s - places[0].s) < HERE):
        return lap
    return replace(roads.route(start, places[0], costs=costs[:1]), lap=lap)


def _cost(route: model.Route, number: int, roads: RoadNetwork, seed: int) -> Cost | None:
    """What counts on the way to a waypoint; None is the length."""
    strategy = route.waypoint[number].route_strategy
    if strategy is model.RouteStrategy.FASTEST:
        return fastest(roads)
    if strategy is model.RouteStrategy.LEAST_INTERSECTIONS:
        return fewest_junctions(roads)
    if strategy is model.RouteStrategy.RANDOM:
        return random_costs(roads, generator(seed, "route", route.name, number))
    return None
