"""Routes that the scenario requests of actors, as points."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from eidrive_scenario.arrays import Array
from eidrive_scenario.roads import Route
from eidrive_scenario.storyboard.kinematics.actor import Actor

POINTS_APART = 2.0
"""Maximum spacing of the points of a route [m]."""
NO_ROUTES: Mapping[str, Array] = MappingProxyType({})


class RequestedRoutes:
    """Routes by AssignRouteAction and AcquirePositionAction: over lanes, or through waypoints without roads."""

    def __init__(self) -> None:
        self._last: dict[str, object] = {}
        """Last route, or waypoints, of each actor."""

    def changes(self, actors: Mapping[str, Actor]) -> Mapping[str, Array]:
        """Return the points (M, 3) of the routes that were requested since the last call, by actor [m].

        The lap that follows a closed route is no new route.
        """
        found: dict[str, Array] = {}
        for name, actor in actors.items():
            request: object = actor.motion.route
            if request is None:
                goal = actor.goal
                if goal is None or goal.waypoints is None:
                    continue
                request = goal.waypoints
            last = self._last.get(name)
            if request is last:
                continue
            self._last[name] = request
            if isinstance(request, Route):
                if not isinstance(last, Route) or last.lap is not request:
                    found[name] = request.polyline(POINTS_APART)
            else:
                found[name] = np.concatenate([np.array([actor.motion.pose[:3]]), request])
        return found or NO_ROUTES
