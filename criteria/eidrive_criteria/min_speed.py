"""Criterion: minimum speed of an actor."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

from pydantic import Field

from eidrive_criteria.folds import Extreme, conclude_extreme
from eidrive_scenario.api.common import TIME_TOLERANCE
from eidrive_scenario.api.criteria import Criterion, CriterionSettings, Frame, Verdict, actor_never_present


class MinSpeedSettings(CriterionSettings):
    """Settings: `{of: Ego, at_least: 5.0, after: 3.0}` with speed [m/s], required after [s].

    Without `at_least` the criterion only measures and passes.
    """

    of: str
    at_least: Annotated[float, Field(ge=0)] | None = None
    after: Annotated[float, Field(ge=0)] = 0.0


class MinSpeed(Criterion):
    """Criterion that fails if the absolute speed of the actor falls below `at_least` at or after the time `after`."""

    settings_type = MinSpeedSettings
    name = "min_speed"
    unit = "m/s"

    def __init__(self, settings: MinSpeedSettings) -> None:
        super().__init__(settings)
        self._settings = settings
        self.subjects = (settings.of,)
        self.demands_progress = bool(settings.at_least)
        self._was_present = False
        self._slowest = Extreme(settings.at_least, largest=False)

    def observe(self, frame: Frame) -> None:
        view, settings = frame.view, self._settings
        row = view.rows.get(settings.of)
        if row is None:
            return
        self._was_present = True
        if view.time >= settings.after - TIME_TOLERANCE:
            self._slowest.add(abs(float(view.speed[row])), view.time)

    def verdict(self) -> Verdict:
        of, slowest = self._settings.of, self._slowest
        if slowest.value is not None:
            reason = f"{of} drove at least {slowest.value:.2f} m/s, slowest at {slowest.when:.2f} s"
        elif self._was_present:
            reason = f"{of} was not present from {self._settings.after:.2f} s on, so nothing was measured"
        else:
            reason = actor_never_present([of])
        return conclude_extreme(self, slowest, reason, measured=slowest.value is not None)

    def metrics(self) -> Mapping[str, float]:
        """Return the minimum speed [m/s]."""
        return {} if self._slowest.value is None else {f"{self.name}.{self._settings.of}": self._slowest.value}
