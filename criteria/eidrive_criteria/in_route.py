"""Criterion: distance of an actor from its route."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

from pydantic import Field

from eidrive_criteria.folds import Extreme, exceeds
from eidrive_criteria.routed import RouteCriterion, RouteSettings
from eidrive_scenario.api.criteria import Place, Verdict


class InRouteSettings(RouteSettings):
    """Settings: `{of: Ego, at_most: 30, beyond: 15, share: 0.3}` [m].

    beyond  distance from the route above which the way counts for `share` [m]
    share   maximum share of the length of the route that is driven at a distance above `beyond` from it
    """

    at_most: Annotated[float, Field(ge=0)] = 30.0
    beyond: Annotated[float, Field(ge=0)] = 15.0
    share: Annotated[float, Field(ge=0)] = 0.3


class InRoute(RouteCriterion):
    """Criterion that fails if the actor is farther than `at_most` from its route, or too often farther than `beyond`.

    The distance is horizontal, between the center of the body and the route near the last place on it.
    """

    settings_type = InRouteSettings
    name = "in_route"
    unit = "m"

    def __init__(self, settings: InRouteSettings) -> None:
        super().__init__(settings)
        self._settings = settings
        self._farthest = Extreme(settings.at_most, largest=True)
        self._off = 0.0
        """Distance driven beyond the tolerance on this route [m]."""
        self._violated: float | None = None

    def begin(self) -> None:
        self._off = 0.0

    def locate(self, time: float, place: Place, driven: float | None) -> None:
        self._farthest.add(place.away, time)
        if place.away > self._settings.beyond:
            self._off += driven or 0.0
        too_often = self.route is not None and exceeds(self._off, self._settings.share * self.route.length)
        if self._violated is None:
            self._violated = time if too_often else self._farthest.violated

    def verdict(self) -> Verdict:
        farthest, settings = self._farthest, self._settings
        if farthest.value is None:
            return self.conclude(False, self.nothing(), limit=settings.at_most)
        reason = f"{self.of} was up to {farthest.value:.1f} m from its route, at {farthest.when:.2f} s"
        if self._off > 0.0:
            reason += f", and drove {self._off:.1f} m farther than {settings.beyond:g} m from it"
        return self.conclude(
            self._violated is None,
            reason,
            value=farthest.value,
            limit=settings.at_most,
            first_violation=self._violated,
        )

    def metrics(self) -> Mapping[str, float]:
        """Return the largest distance and the distance driven beyond the tolerance [m]."""
        if self._farthest.value is None:
            return {}
        return {f"{self.name}.{self.of}": self._farthest.value, f"{self.name}.{self.of}.off_route": self._off}
