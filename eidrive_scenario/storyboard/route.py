"""Routes of the standard as routes over the lanes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from eidrive_scenario.errors import Problem, ScenarioError
from eidrive_scenario.openscenario import model
from eidrive_scenario.roads import LaneLocation, RoadNetwork, Route
from eidrive_scenario.storyboard.motion import Place


def route_of(
    route: model.Route,
    roads: RoadNetwork | None,
    resolve: Callable[[model.Position], Place],
    start: LaneLocation | None = None,
) -> Route:
    """The way through the waypoints of a route, from `start` if given. Raises ScenarioError, RouteError."""
    if roads is None:
        raise ScenarioError(Problem(f"route {route.name!r} needs a road network", "", route.source, route.line))
    places = [] if start is None else [start]
    for waypoint in route.waypoint:
        here = resolve(waypoint.position).location
        if here is None:
            raise ScenarioError(
                Problem("the waypoint is not on a road", "move it onto a lane", waypoint.source, waypoint.line)
            )
        places.append(here)
    return roads.route(places[0], places[-1], places[1:-1])


def waypoints_of(route: Route, spacing: float = 2.0) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """(M, 3) points along a route [m]."""
    points: np.ndarray[tuple[int, int], np.dtype[np.float64]] = route.polyline(spacing)
    return points
