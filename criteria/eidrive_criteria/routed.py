"""Base class of criteria on an actor and its route."""

from __future__ import annotations

from abc import abstractmethod
from typing import Annotated, Self

from pydantic import Field, model_validator

from eidrive_criteria.folds import FollowedCriterion
from eidrive_scenario.api.common import RoadNetwork
from eidrive_scenario.api.criteria import (
    CriterionSettings,
    Frame,
    Place,
    RouteProgress,
    Step,
    actor_never_present,
    route_through,
)

Point = tuple[float, float]


class RouteSettings(CriterionSettings):
    """Settings: `{of: Ego}` for the route that the scenario requests, `{of: Ego, route: [[0, 0], [90, 5]]}`.

    route  points x, y [m]; on roads the route between them follows the lanes
    """

    of: str
    route: Annotated[tuple[Point, ...], Field(min_length=2, max_length=1000)] | None = None

    @model_validator(mode="after")
    def _has_a_length(self) -> Self:
        if self.route is not None and len(set(self.route)) == 1:
            raise ValueError(f"'route' has no length (got {self.route[0]} only; expected different points)")
        return self


class RouteCriterion(FollowedCriterion):
    """Criterion on the places of an actor on its route. A later request replaces the route. No route is a failure."""

    def __init__(self, settings: RouteSettings) -> None:
        super().__init__(settings, settings.of)
        self._given = settings.route
        self.needs_route = settings.route is None
        self.route: RouteProgress | None = None
        if self._given is not None:
            self.route = RouteProgress(route_through(self._given, None))

    def bind(self, roads: RoadNetwork | None) -> None:
        super().bind(roads)
        if self._given is not None:
            self.route = RouteProgress(route_through(self._given, roads))

    @abstractmethod
    def begin(self) -> None:
        """Start the evaluation of a new route."""

    @abstractmethod
    def locate(self, time: float, place: Place, driven: float | None) -> None:
        """Process the place on the route in one frame.

        driven  distance since the previous frame [m]; None in the first one and after a teleport
        """

    def observe(self, frame: Frame) -> None:
        if self._given is None and self.of in frame.routes:
            self.route = RouteProgress(frame.routes[self.of])
            self.begin()
        super().observe(frame)

    def interrupt(self) -> None:
        if self.route is not None:
            self.route.forget()

    def follow(self, frame: Frame, row: int, step: Step | None) -> None:
        if self.route is not None:
            x, y, *_ = frame.view.plain_boxes[row]
            self.locate(frame.view.time, self.route.place(x, y), None if step is None else step.distance)

    def nothing(self) -> str:
        """Return the reason of a verdict without a place on a route."""
        if not self.was_present:
            return actor_never_present([self.of])
        return f"no route was requested of {self.of} (AssignRouteAction, AcquirePositionAction, or setting 'route')"
