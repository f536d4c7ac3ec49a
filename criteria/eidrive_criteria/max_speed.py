"""Criterion: maximum speed of an actor."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated

from pydantic import Field

from eidrive_scenario.api.criteria import Criterion, CriterionSettings, Frame, Verdict, actor_never_present


class MaxSpeedSettings(CriterionSettings):
    """Settings: `{of: Ego, at_most: 13.9}` [m/s]. Without `at_most` the criterion only measures and passes."""

    of: str
    at_most: Annotated[float, Field(gt=0)] | None = None


class MaxSpeed(Criterion):
    """Criterion that fails if the absolute speed of the actor along its heading exceeds `at_most`."""

    settings_type = MaxSpeedSettings
    name = "max_speed"
    unit = "m/s"

    def __init__(self, settings: MaxSpeedSettings) -> None:
        super().__init__(settings)
        self._settings = settings
        self.subjects = (settings.of,)
        self._fastest, self._when = -math.inf, math.nan
        self._violated: float | None = None

    def observe(self, frame: Frame) -> None:
        view = frame.view
        row = view.rows.get(self._settings.of)
        if row is None:
            return
        speed, limit = abs(float(view.speed[row])), self._settings.at_most
        if speed > self._fastest:
            self._fastest, self._when = speed, view.time
        if self._violated is None and limit is not None and speed > limit:
            self._violated = view.time

    def verdict(self) -> Verdict:
        of, was_present = self._settings.of, math.isfinite(self._fastest)
        reason = (
            f"{of} drove up to {self._fastest:.2f} m/s at {self._when:.2f} s"
            if was_present
            else actor_never_present([of])
        )
        return Verdict(
            name=self.name,
            passed=was_present and self._violated is None,
            value=self._fastest if was_present else None,
            limit=self._settings.at_most,
            unit=self.unit,
            first_violation=self._violated,
            reason=reason,
            fatal=self.fatal and self._violated is not None,
        )

    def metrics(self) -> Mapping[str, float]:
        """Return the maximum speed [m/s]."""
        return {f"max_speed.{self._settings.of}": self._fastest} if math.isfinite(self._fastest) else {}
