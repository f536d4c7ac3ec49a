"""Criterion: minimum driven distance of an actor."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

from pydantic import Field

from eidrive_criteria.folds import Deadline, falls_below
from eidrive_scenario.api.criteria import Criterion, CriterionSettings, Frame, Verdict, actor_never_present


class DrivenDistanceSettings(CriterionSettings):
    """Settings: `{of: Ego, at_least: 100, by: 30}` with distance [m] and deadline by [s].

    A fatal criterion ends the run at an expired deadline. Without `by` it is open until the end. Without `at_least` it
    only measures and passes.
    """

    of: str
    at_least: Annotated[float, Field(gt=0)] | None = None
    by: Annotated[float, Field(gt=0)] | None = None


class DrivenDistance(Criterion):
    """Criterion that passes once the actor has driven the distance `at_least`.

    The distance is the integral of the speed (trapezoidal rule), so that teleports do not count.
    """

    settings_type = DrivenDistanceSettings
    name = "driven_distance"
    unit = "m"

    def __init__(self, settings: DrivenDistanceSettings) -> None:
        super().__init__(settings)
        self._settings = settings
        self.subjects = (settings.of,)
        self.demands_progress = settings.at_least is not None
        self._distance = 0.0
        self._was_present = False
        self._last: tuple[float, float] | None = None
        """Time and speed in the previous frame [s, m/s]; None while the actor is absent."""
        self._deadline = Deadline(settings.by)

    def observe(self, frame: Frame) -> None:
        view = frame.view
        row = view.rows.get(self._settings.of)
        self._deadline.observe(view.time)
        if row is None:
            self._last = None
        if row is None or self._deadline.expired is not None:
            return
        self._was_present = True
        time, speed = view.time, abs(float(view.speed[row]))
        if self._last is not None:
            before, speed_before = self._last
            self._distance += (time - before) * (speed + speed_before) / 2
        self._last = time, speed

    def verdict(self) -> Verdict:
        of, limit, was_present = self._settings.of, self._settings.at_least, self._was_present
        passed = was_present and not falls_below(self._distance, limit)
        return self.conclude(
            passed,
            f"{of} drove {self._distance:.1f} m" if was_present else actor_never_present([of]),
            value=self._distance if was_present else None,
            limit=limit,
            first_violation=None if passed else self._deadline.expired,
        )

    def metrics(self) -> Mapping[str, float]:
        """Return the driven distance [m]."""
        return {f"{self.name}.{self._settings.of}": self._distance} if self._was_present else {}
