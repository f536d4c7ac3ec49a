"""Criterion: average speed of an actor."""

from __future__ import annotations

from collections.abc import Mapping

from eidrive_criteria.folds import BoundedSettings
from eidrive_scenario.api.criteria import Criterion, Frame, Verdict, actor_never_present


class AverageSpeedSettings(BoundedSettings):
    """Settings: `{of: Ego, at_least: 5.0, at_most: 14.0}` [m/s]. Without limits it only measures and passes."""

    of: str


class AverageSpeed(Criterion):
    """Criterion that fails if the average speed over the time in which the actor is present is outside the limits.

    The average is driven distance (trapezoidal rule, so that teleports do not count) over time; with a single frame it
    is the speed in it. It is compared at the end only.
    """

    settings_type = AverageSpeedSettings
    name = "average_speed"
    unit = "m/s"

    def __init__(self, settings: AverageSpeedSettings) -> None:
        super().__init__(settings)
        self._settings = settings
        self.subjects = (settings.of,)
        self.demands_progress = bool(settings.at_least)
        self._distance = self._duration = 0.0
        self._only: float | None = None
        """Speed in the first frame [m/s]."""
        self._last: tuple[float, float] | None = None

    def observe(self, frame: Frame) -> None:
        view = frame.view
        row = view.rows.get(self._settings.of)
        if row is None:
            self._last = None
            return
        time, speed = view.time, abs(float(view.speed[row]))
        if self._last is not None:
            self._duration += time - self._last[0]
            self._distance += (time - self._last[0]) * (speed + self._last[1]) / 2.0
        self._only = speed if self._only is None else self._only
        self._last = time, speed

    def _average(self) -> float | None:
        return self._distance / self._duration if self._duration > 0.0 else self._only

    def verdict(self) -> Verdict:
        settings, average = self._settings, self._average()
        reason = actor_never_present([settings.of])
        if average is not None:
            reason = f"{settings.of} drove {average:.2f} m/s on average over {self._duration:.2f} s"
        return self.conclude(
            average is not None and settings.allows(average), reason, value=average, limit=settings.limit_of(average)
        )

    def metrics(self) -> Mapping[str, float]:
        """Return the average speed [m/s]."""
        average = self._average()
        return {} if average is None else {f"average_speed.{self._settings.of}": average}
