"""AssignRouteAction, AcquirePositionAction, RandomRouteAction and PreferredLaneLayerAction: routes of actors."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from functools import partial

import numpy as np
from msgspec.structs import replace
from py_trees.common import Status

from eidrive_scenario.api.actions import (
    LONGEST_WAY,
    ActionBehaviour,
    Goal,
    ResolvedPosition,
    build_route,
    faces_traffic,
    facing,
    model,
    random_route,
    rejoin_route,
    resolve_position,
    target_lane,
    uniform_branch_selector,
)
from eidrive_scenario.api.common import (
    EidriveError,
    LaneLocation,
    Pose,
    RoadNetwork,
    Route,
    RouteError,
    generator,
)

POINTS_APART = 2.0
"""Maximum spacing of the points of a path that is handed to a controller [m]."""
RANDOM_ROUTE_LENGTH = 5000.0
"""Length of a random route for a vehicle with an active controller [m]."""


class AssignRouteAction(ActionBehaviour):
    """Assignment of a route over the lanes. It selects the branch at junctions.

    An active controller receives the points of the route. A closed route continues from its last waypoint to the first
    one. An actor that faces against the driving direction of its lane, or reverses, may have a route against it.
    """

    immediate = True
    action: model.AssignRouteAction

    def update(self) -> Status:
        """Assign the route, from the current location if a path leads from there."""
        route = self.action.route or self.context.catalog_entry(self.action.catalog_reference, model.Route, self.action)
        here = self.context.location(self.actor.name) if self.actor.present else None
        roads, seed = self.context.roads, self.context.seed

        def resolve(position: model.Position) -> ResolvedPosition:
            return resolve_position(position, self.context, self.actor.name)

        build = partial(build_route, route, roads, resolve, seed=seed, again=True)
        try:
            path = build(here)
        except EidriveError:
            if here is not None and (path_of_waypoints := self._attempt(build)) is not None:
                path = path_of_waypoints
                message = f"no way leads from {self.actor.name!r} to route {route.name!r}"
                self.warn(message, "start the action on the way to its first waypoint")
            else:
                wrong_way = self._attempt(partial(build, here, against_traffic=True))
                if wrong_way is None or not self._may_drive_against_traffic(resolve(route.waypoint[0].position)):
                    raise
                path = wrong_way
                warn_of_wrong_way(self, f"route {route.name!r}")
        assign_route(self, path)
        return Status.SUCCESS

    @staticmethod
    def _attempt(build: Callable[[], Route]) -> Route | None:
        """Return a route, or None if there is none."""
        try:
            return build()
        except EidriveError:
            return None

    def _may_drive_against_traffic(self, first: ResolvedPosition) -> bool:
        """Whether the actor moves against the driving direction of its lane, or its first waypoint faces against it."""
        roads = self.context.roads
        return roads is not None and (moves_against_traffic(self) or faces_traffic(roads, first))

    def describe(self) -> str:
        """Describe the route."""
        if self.action.route is not None:
            return f"route {self.action.route.name} over {len(self.action.route.waypoint)} waypoints"
        return "route from a catalog"


class AcquirePositionAction(ActionBehaviour):
    """Shortest route to a position over the lanes; for a vehicle with a driver off the road a straight line."""

    immediate = True
    action: model.AcquirePositionAction

    def update(self) -> Status:
        """Assign the route. Raise ScenarioError if none exists."""
        target = resolve_position(self.action.position, self.context, self.actor.name)
        here = self.context.location(self.actor.name)
        if self.context.roads is not None and here is not None and target.location is not None:
            try:
                there = target_lane(self.context.roads, here, self.action.position, target.location)
                route = self._route(self.context.roads, here, there)
            except RouteError as error:
                raise self.error(error.diagnostics[0].message, error.diagnostics[0].hint) from None
            assign_route(self, route)
        elif self.actor.driven:
            start = self.actor.motion.pose
            check_way(self, math.hypot(target.pose.x - start.x, target.pose.y - start.y))
            goal = self.actor.goal
            self.actor.set_goal(replace(goal or Goal(), path=None, lap=None, waypoints=np.array([target.pose[:3]])))
        elif self.context.roads is not None and target.location is None:
            raise self.error("the position is not on a road", "move it onto a lane")
        else:
            message = f"{self.actor.name!r} is not on a road: it does not turn to the position"
            self.warn(message, "place the entity on a lane")
        return Status.SUCCESS

    def _route(self, roads: RoadNetwork, here: LaneLocation, there: LaneLocation) -> Route:
        """Return the route to a location, if need be against the traffic. Raise RouteError if there is none."""
        try:
            return roads.route(here, there)
        except RouteError as error:
            if not moves_against_traffic(self):
                raise
            try:
                route = roads.route(here, there, against_traffic=True)
            except RouteError:
                raise error from None
            warn_of_wrong_way(self, "the way to the position")
            return route

    def describe(self) -> str:
        """Describe the position."""
        return f"drive to {describe_position(self.action.position)}"


class RandomRouteAction(ActionBehaviour):
    """Random choice of branches: at each junction one of the branches with equal probability.

    An active controller receives such a route of several kilometers as its path. The choice depends on the seed of the
    run.
    """

    immediate = True
    action: model.RandomRouteAction

    def configure(self) -> None:
        """Require a road network."""
        self._starts = 0
        self._roads = self.require_roads()

    def initialise(self) -> None:
        """Count the start, so that each start draws a separate route."""
        self._starts += 1

    def update(self) -> Status:
        """Discard the route and select branches at random."""
        actor, roads = self.actor, self._roads
        choose = uniform_branch_selector(generator(self.context.seed, "random route", actor.name, self._starts))
        actor.motion.set_route(None, choose)
        here = self.context.location(actor.name)
        if actor.driven and here is not None:
            way = random_route(roads, here, RANDOM_ROUTE_LENGTH, choose)
            actor.set_goal(replace(actor.goal or Goal(), path=way.polyline(POINTS_APART), lap=None, is_route=True))
        return Status.SUCCESS

    def describe(self) -> str:
        """Describe the action."""
        return "drive about at random"


class PreferredLaneLayerAction(ActionBehaviour):
    """Preference for the permanent lanes, the only ones of a road network; it completes at once."""

    immediate = True
    action: model.PreferredLaneLayerAction

    def update(self) -> Status:
        """Complete."""
        return Status.SUCCESS

    def describe(self) -> str:
        """Describe the lane layer."""
        return f"prefer {self.action.layer.value} lanes"


def moves_against_traffic(behaviour: ActionBehaviour) -> bool:
    """Return True if the actor faces against the driving direction of its lane, or has a negative speed."""
    context, name = behaviour.context, behaviour.actor.name
    here = context.location(name) if behaviour.actor.present else None
    return here is not None and (context.speed(name) < 0.0 or facing(context, name, here) < 0)


def warn_of_wrong_way(behaviour: ActionBehaviour, way: str) -> None:
    """Add a warning to the result: a route leads against the driving direction of its lanes."""
    effect = f"{behaviour.actor.name!r} drives it in the lanes of its waypoints"
    hint = "for a drive with the traffic, reverse the waypoints or move them to other lanes"
    behaviour.warn(f"{way} leads against the driving direction: {effect}", hint)


def assign_route(behaviour: ActionBehaviour, route: Route) -> None:
    """Assign a route to the actor."""
    actor = behaviour.actor
    actor.motion.set_route(route)
    if actor.driven:
        check_way(behaviour, route.length)
        lap = None if route.onward is None else route.onward.polyline(POINTS_APART)
        path = route.polyline(POINTS_APART)
        actor.set_goal(replace(actor.goal or Goal(), path=path, lap=lap, is_route=True))


def check_way(behaviour: ActionBehaviour, length: float) -> None:
    """Raise ScenarioError if a way that is requested of a driven vehicle is longer than LONGEST_WAY [m]."""
    if not length <= LONGEST_WAY:
        message = f"the way to the destination has a length of {length / 1000.0:,.0f} km"
        hint = f"a driven vehicle accepts at most {LONGEST_WAY / 1000.0:.0f} km: check the position"
        raise behaviour.error(message, hint)


def resume_route(behaviour: ActionBehaviour, place: ResolvedPosition, before: Pose | None) -> None:
    """Plan a new way to the next waypoint of the route of a driven actor if the route does not lead along a position.

    The waypoints between the previous pose and the destination remain, all of them if the actor was absent. Without a
    way the actor follows its lane, with a warning.
    """
    actor, roads = behaviour.actor, behaviour.context.roads
    goal, route = actor.goal, actor.motion.route
    if roads is None or place.location is None or not actor.driven or goal is None or not goal.is_route:
        return
    x, y, _, heading, *_ = place.pose
    if route is None or goal.leads_along(x, y, heading):
        return
    try:
        way = rejoin_route(roads, place.location, route, before)
    except RouteError:
        message = f"no way leads to the destination of the route of {actor.name!r}: it follows its lane"
        behaviour.warn(message, "teleport it to a lane from which its destination can be reached")
        actor.motion.set_route(None)
        actor.set_goal(replace(goal, path=None, lap=None, is_route=False))
    else:
        assign_route(behaviour, dataclasses.replace(way, lap=route.onward))


def describe_position(position: model.Position) -> str:
    """Describe frame and values of a position, as `LanePosition road 0 lane -3 s 50`."""
    frame = position.chosen()
    words = [type(frame).__name__]
    for name, value in vars(frame).items():
        if isinstance(value, str | int | float) and name not in ("line", "source"):
            words.append(
                f"{name.removesuffix('_id').removesuffix('_ref')} {value if isinstance(value, str) else f'{value:g}'}"
            )
    return " ".join(words)
