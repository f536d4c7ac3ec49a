"""Criterion: completed share of the route of an actor."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

from pydantic import Field

from eidrive_criteria.folds import share_margin
from eidrive_criteria.routed import RouteCriterion, RouteSettings
from eidrive_scenario.api.common import EPSILON
from eidrive_scenario.api.criteria import Place, Verdict

START = 10.0
"""Distance from the start of the route up to which a part that begins there counts from the start [m]: routes begin at
the reference point of the actor, or a few meters beside its body."""
AWAY = 30.0
"""Distance from the route above which the actor completes nothing [m], as the default of `in_route`."""


class RouteCompletionSettings(RouteSettings):
    """Settings: `{of: Ego, at_least: 0.99, within: 10}` with a share, and the distance within [m] that may be left."""

    at_least: Annotated[float, Field(ge=0, le=1)] = 0.99
    within: Annotated[float, Field(gt=0)] | None = None


class RouteCompletion(RouteCriterion):
    """Criterion that fails if the actor completes less than a share `at_least` of its route.

    The completed distance is that from the place where the actor joins the route to the farthest one, or from the start
    of the route if it joins it up to 10 m after. Teleports and ways farther than 30 m from the route complete nothing.
    """

    settings_type = RouteCompletionSettings
    name = "route_completion"

    def __init__(self, settings: RouteCompletionSettings) -> None:
        super().__init__(settings)
        self._settings = settings
        self.demands_progress = settings.at_least > 0.0 or settings.within is not None
        self._parts: list[tuple[float, float]] = []
        """Begin and end of each completed part of the route [m]; another one begins where the actor joins again."""
        self._was_away = False

    def begin(self) -> None:
        self._parts = []

    def locate(self, time: float, place: Place, driven: float | None) -> None:
        is_away = place.away > AWAY
        if self._parts and driven is not None and not is_away and not self._was_away:
            begin, end = self._parts[-1]
            self._parts[-1] = begin, max(end, place.along)
        else:
            if self._parts and self._was_away:
                self._parts.pop()  # it has no length
            begin = 0.0 if place.along <= START and not is_away else place.along
            self._parts.append((begin, place.along))
        self._was_away = is_away

    def _share(self) -> float | None:
        if self.route is None or not self._parts:
            return None
        completed = farthest = 0.0
        for begin, end in sorted(self._parts):
            if end > farthest:
                completed += end - max(begin, farthest)
                farthest = end
        return min(completed / self.route.length, 1.0) if self.route.length > 0.0 else 1.0

    def verdict(self) -> Verdict:
        settings, value = self._settings, self._share()
        if value is None or self.route is None:
            return self.conclude(False, self.nothing(), limit=settings.at_least)
        left = self.route.length * (1.0 - value)
        arrived = settings.within is None or left <= settings.within + EPSILON
        completed = f"{self.of} completed {100 * value:.1f} % of its route of {self.route.length:.1f} m"
        return self.conclude(
            value >= settings.at_least - EPSILON and arrived,
            f"{completed}, {left:.1f} m were left",
            value=value,
            limit=settings.at_least,
        )

    def metrics(self) -> Mapping[str, float]:
        """Return the completed share, its margin, and the length of the route [m]."""
        value = self._share()
        if value is None or self.route is None:
            return {}
        metrics = {f"{self.name}.{self.of}": value, f"{self.name}.{self.of}.length": self.route.length}
        return metrics | share_margin(self.name, value, self._settings.at_least)
