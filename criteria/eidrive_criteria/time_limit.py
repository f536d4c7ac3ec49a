"""Criterion: maximum duration of a run."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from eidrive_scenario.api.common import TIME_TOLERANCE
from eidrive_scenario.api.criteria import Criterion, CriterionSettings, Frame, Verdict


class TimeLimitSettings(CriterionSettings):
    """Settings: `{within: 60}`, within [s]. Its stop trigger or its storyboard has to end the run by then."""

    within: Annotated[float, Field(gt=0)]
    fatal: bool = True


class TimeLimit(Criterion):
    """Criterion that fails if the simulated time exceeds `within` [s]. By default it then ends the run."""

    settings_type = TimeLimitSettings
    name = "time_limit"
    unit = "s"

    def __init__(self, settings: TimeLimitSettings) -> None:
        super().__init__(settings)
        self._within = settings.within
        self._time = 0.0
        self._violated: float | None = None

    def observe(self, frame: Frame) -> None:
        self._time = frame.view.time
        # Time is tick * dt: its rounding error must not fail a run that ends exactly at the limit.
        if self._violated is None and self._time > self._within + TIME_TOLERANCE:
            self._violated = self._time

    def verdict(self) -> Verdict:
        passed = self._violated is None
        verb = "lasted" if passed else "had not ended by itself after"
        return self.conclude(
            passed,
            f"the run {verb} {self._time:.2f} s",
            value=self._time,
            limit=self._within,
            first_violation=self._violated,
        )
