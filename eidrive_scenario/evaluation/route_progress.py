"""Progress of an actor along a route given by points."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.tolerances import EPSILON
from eidrive_scenario.roads import RoadNetwork, RouteError

AHEAD, BEHIND = 30.0, 10.0
"""Distances along the route from the last place within which the next place is searched [m]; a longer step extends
them, backwards only if it leads nearer to the route by more than SAME, as routes there and back coincide."""
SAME = 1.0
"""Difference in the distance from the route up to which places are equally near [m]; the first one is the start."""
SPACING = 2.0
"""Maximum spacing of the points of a route over lanes [m]."""

Point = tuple[float, float]


class Place(NamedTuple):
    """Place on a route: distance along it, and horizontal distance of the actor from it [m]."""

    along: float
    away: float


class RouteProgress:
    """Places of an actor on a route in successive frames.

    Each place is searched near the last one, so that a route may cross or repeat itself.
    """

    def __init__(self, points: Array) -> None:
        plan = np.asarray(points, dtype=float)[:, :2]
        steps = np.hypot(*np.diff(plan, axis=0).T)
        kept = np.concatenate([[True], steps > 0.0])
        self._points = plan[kept]
        self._along = np.concatenate([[0.0], np.cumsum(steps[steps > 0.0])])
        self._last: float | None = None
        self._position = (0.0, 0.0)
        """Position of the actor at the last place [m]."""

    @property
    def length(self) -> float:
        """Length of the route [m]."""
        return float(self._along[-1])

    def place(self, x: float, y: float) -> Place:
        """Return the place of an actor, near that of the previous call."""
        along, away = self._projections(x, y)
        near = np.ones(len(away), dtype=bool)
        if self._last is not None:
            moved = math.dist(self._position, (x, y)) + EPSILON
            ahead = along <= self._last + max(AHEAD, moved)
            near, behind = (ahead & (along >= self._last - limit) for limit in (BEHIND, max(BEHIND, moved)))
            if away[near].min(initial=math.inf) > away[behind].min() + SAME:
                near = behind
        candidates = np.flatnonzero(near)
        nearest = float(away[candidates].min())
        limit = nearest + SAME if self._last is None else nearest
        index = int(candidates[away[candidates] <= limit][0])
        if self._last is None:  # the nearest point of the first pass near the actor
            part = candidates[(candidates >= index) & (along[candidates] <= along[index] + BEHIND)]
            index = int(part[np.argmin(away[part])])
        self._last, self._position = float(along[index]), (x, y)
        return Place(self._last, float(away[index]))

    def forget(self) -> None:
        """Forget the last place, after a teleport: the next one is searched on the whole route."""
        self._last = None

    def _projections(self, x: float, y: float) -> tuple[Array, Array]:
        """Return the distance along the route of the nearest point of each segment, and its distance from x, y."""
        if len(self._points) == 1:
            return np.zeros(1), np.hypot(*(self._points - (x, y)).T)
        begin, step = self._points[:-1], np.diff(self._points, axis=0)
        squared = (step**2).sum(axis=1)
        share = np.clip(((x - begin[:, 0]) * step[:, 0] + (y - begin[:, 1]) * step[:, 1]) / squared, 0.0, 1.0)
        foot = begin + share[:, None] * step
        return self._along[:-1] + share * np.sqrt(squared), np.hypot(foot[:, 0] - x, foot[:, 1] - y)


def route_through(points: Sequence[Point], roads: RoadNetwork | None) -> Array:
    """Return the points (M, 2) of the route through points: over the lanes where they lie on roads, else straight.

    Between two points without a route over lanes it is straight as well.
    """
    route = [point for start, end in pairwise(points) for point in _over_lanes(start, end, roads) or (start, end)]
    return np.array([(point[0], point[1]) for point in route])


def _over_lanes(start: Point, end: Point, roads: RoadNetwork | None) -> list[Sequence[float]]:
    if roads is None:
        return []
    a, b = roads.locate_at(*start), roads.locate_at(*end)
    if a is None or b is None or not (roads.on_road(a) and roads.on_road(b)):
        return []
    try:
        points: list[Sequence[float]] = roads.route(a, b).polyline(SPACING).tolist()
    except RouteError:
        return []
    return points if all(map(math.isfinite, points[0])) else []
