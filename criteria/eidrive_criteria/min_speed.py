"""Criterion: minimum speed of an actor."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated

from pydantic import Field

from eidrive_scenario.api.common import TIME_TOLERANCE
from eidrive_scenario.api.criteria import Criterion, CriterionSettings, Frame, Verdict, actor_never_present


class MinSpeedSettings(CriterionSettings):
    """Settings: `{of: Ego, at_least: 5.0, after: 3.0}` with speed [m/s] and the time from which it is required [s].

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
        self._was_present = False
        self._slowest, self._when = math.inf, math.nan
        self._violated: float | None = None

    def observe(self, frame: Frame) -> None:
        view, settings = frame.view, self._settings
        row = view.rows.get(settings.of)
        if row is None:
            return
        self._was_present = True
        if view.time < settings.after - TIME_TOLERANCE:
            return
        speed = abs(float(view.speed[row]))
        if speed < self._slowest:
            self._slowest, self._when = speed, view.time
        if self._violated is None and settings.at_least is not None and speed < settings.at_least:
            self._violated = view.time

    def verdict(self) -> Verdict:
        of, measured = self._settings.of, math.isfinite(self._slowest)
        if measured:
            reason = f"{of} drove at least {self._slowest:.2f} m/s, slowest at {self._when:.2f} s"
        elif self._was_present:
            reason = f"{of} was not present from {self._settings.after:.2f} s on, so nothing was measured"
        else:
            reason = actor_never_present([of])
        return Verdict(
            name=self.name,
            passed=measured and self._violated is None,
            value=self._slowest if measured else None,
            limit=self._settings.at_least,
            unit=self.unit,
            first_violation=self._violated,
            reason=reason,
            fatal=self.fatal and self._violated is not None,
        )

    def metrics(self) -> Mapping[str, float]:
        """Return the minimum speed [m/s]."""
        return {f"min_speed.{self._settings.of}": self._slowest} if math.isfinite(self._slowest) else {}
