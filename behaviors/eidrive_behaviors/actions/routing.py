"""AssignRouteAction and AcquirePositionAction: where an actor goes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from py_trees.common import Status

from eidrive_behaviors.actions.teleport import position_in_words
from eidrive_scenario.api.actions import (
    ActionBehaviour,
    Goal,
    RuntimeContext,
    build_route,
    model,
    random_route,
    resolve_position,
    uniform_branch_selector,
)
from eidrive_scenario.api.common import EidriveError, Route, RouteError, generator

RANDOM_WAY = 5000.0
"""Length of the way that a vehicle which drives itself gets for a random route [m]."""


class AssignRouteAction(ActionBehaviour):
    """Gives the actor a route over the lanes. At forks it takes the route's way; who drives itself gets its points.

    A closed route goes on from its last waypoint to its first, again and again.
    """

    immediate = True
    action: model.AssignRouteAction

    def update(self) -> Status:
        """Lay the route out, from where the actor is if there is a way from there."""
        route = self.action.route or self.context.catalog_entry(self.action.catalog_reference, model.Route, self.action)
        here = self.context.location(self.actor.name) if self.actor.present else None
        roads, seed = self.context.roads, self.context.seed

        def place(position: model.Position) -> object:
            return resolve_position(position, self.context, self.actor.name)

        try:
            found = build_route(route, roads, place, here, seed=seed, again=True)  # type: ignore[arg-type]
        except EidriveError:
            if here is None:
                raise
            found = build_route(route, roads, place, seed=seed, again=True)  # type: ignore[arg-type]
        follow(self, found)
        return Status.SUCCESS

    def describe(self) -> str:
        """Which one."""
        if self.action.route is not None:
            return f"route {self.action.route.name} over {len(self.action.route.waypoint)} waypoints"
        return "route from a catalog"


class AcquirePositionAction(ActionBehaviour):
    """Routes the actor to a position, by the shortest way over the lanes; without roads straight to it."""

    immediate = True
    action: model.AcquirePositionAction

    def update(self) -> Status:
        """Lay the route out. Raises ScenarioError where there is none."""
        place = resolve_position(self.action.position, self.context, self.actor.name)
        here = self.context.location(self.actor.name)
        if self.context.roads is not None and here is not None and place.location is not None:
            try:
                route = self.context.roads.route(here, place.location)
            except RouteError as error:
                raise self.error(f"finds {error.diagnostics[0].message}", error.diagnostics[0].hint) from None
            follow(self, route)
        elif self.actor.driven:
            goal = self.actor.goal
            self.actor.goal = replace(goal or Goal(), path=None, lap=None, waypoints=np.array([place.pose[:3]]))
        return Status.SUCCESS

    def describe(self) -> str:
        """Where to."""
        return f"drive to {position_in_words(self.action.position)}"


class RandomRouteAction(ActionBehaviour):
    """Lets the actor drive about: at each fork it takes one of the branches, all as likely, from now on.

    Who drives itself gets a way of that kind of some kilometers as its path. The run's seed decides.
    """

    immediate = True
    action: model.RandomRouteAction

    def __init__(
        self,
        action: model.RandomRouteAction,
        context: RuntimeContext,
        *,
        actor: str | None = None,
        parent: model.Element | None = None,
    ) -> None:
        super().__init__(action, context, actor=actor, parent=parent)
        self._starts = 0
        if context.roads is None:
            raise self.error("needs a road network", "name one in RoadNetwork/LogicFile")

    def initialise(self) -> None:
        """Each start draws a way of its own."""
        self._starts += 1

    def update(self) -> Status:
        """Forget the route, and choose at random."""
        actor, roads = self.actor, self.context.roads
        choose = uniform_branch_selector(generator(self.context.seed, "random route", actor.name, self._starts))
        actor.motion.route, actor.motion.branch_selector = None, choose
        here = self.context.location(actor.name)
        if actor.driven and roads is not None and here is not None:
            way = random_route(roads, here, RANDOM_WAY, choose)
            actor.goal = replace(actor.goal or Goal(), path=way.polyline(2.0), lap=None)
        return Status.SUCCESS

    def describe(self) -> str:
        """What it does."""
        return "drive about at random"


def follow(behaviour: ActionBehaviour, route: Route) -> None:
    """Make a route the actor's own."""
    actor = behaviour.actor
    actor.motion.route, actor.motion.branch_selector = route, None
    if actor.driven:
        lap = None if route.onward is None else route.onward.polyline(2.0)
        actor.goal = replace(actor.goal or Goal(), path=route.polyline(2.0), lap=lap)
