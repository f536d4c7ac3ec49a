"""Criterion: maximum speed of an actor."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

from pydantic import Field

from eidrive_criteria.folds import Extreme, conclude_extreme
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
        self._fastest = Extreme(settings.at_most, largest=True)

    def observe(self, frame: Frame) -> None:
        view = frame.view
        row = view.rows.get(self._settings.of)
        if row is not None:
            self._fastest.add(abs(float(view.speed[row])), view.time)

    def verdict(self) -> Verdict:
        of, fastest = self._settings.of, self._fastest
        if fastest.value is None:
            return self.conclude(False, actor_never_present([of]), limit=fastest.limit)
        reason = f"{of} drove up to {fastest.value:.2f} m/s at {fastest.when:.2f} s"
        return conclude_extreme(self, fastest, reason)

    def metrics(self) -> Mapping[str, float]:
        """Return the maximum speed [m/s]."""
        return {} if self._fastest.value is None else {f"max_speed.{self._settings.of}": self._fastest.value}
