"""Criterion: brakings of a station without a cause."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

from pydantic import Field

from eidrive_scenario.api.common import counted
from eidrive_scenario.api.criteria import Criterion, CriterionSettings, FalseTracks, Frame, Verdict, actor_never_present


class FalseBrakingSettings(CriterionSettings):
    """Settings: `{of: Ego, at_most: 0, harder_than: 3.0}` with a number of brakings, and harder_than [m/s²]."""

    of: str
    at_most: Annotated[int, Field(ge=0, le=10**9)] = 0
    harder_than: Annotated[float, Field(gt=0)] = 3.0


class FalseBraking(Criterion):
    """Criterion that fails if a station brakes more than `at_most` times for objects that do not exist.

    A braking is a series of frames in which the plan overrides its speeds by a braking, or decelerates harder than
    `harder_than`. It has no cause if all objects that the plan states as its reason in the first frame are false.
    """

    settings_type = FalseBrakingSettings
    name = "false_braking"

    def __init__(self, settings: FalseBrakingSettings) -> None:
        super().__init__(settings)
        self._settings = settings
        self.subjects = (settings.of,)
        self._tracks = FalseTracks(settings.harder_than)
        self._was_present = self._plans = False
        self._violated: float | None = None

    def observe(self, frame: Frame) -> None:
        of, step = self._settings.of, frame.steps.get(self._settings.of)
        self._was_present = self._was_present or of in frame.view.rows
        if step is None or step.plan is None:
            return
        self._plans = True
        self._tracks.observe(frame, {of: 0.0})
        if self._violated is None and self._tracks.brakings(of).without_cause > self._settings.at_most:
            self._violated = frame.view.time

    def verdict(self) -> Verdict:
        of, limit = self._settings.of, float(self._settings.at_most)
        if not self._plans:
            reason = f"{of} has no planner" if self._was_present else actor_never_present([of])
            return self.conclude(False, reason, limit=limit)
        brakings = self._tracks.brakings(of)
        times = counted(brakings.number, "time")
        return self.conclude(
            self._violated is None,
            f"{of} braked {times}, {counted(brakings.without_cause, 'time')} without a cause",
            value=float(brakings.without_cause),
            limit=limit,
            first_violation=self._violated,
        )

    def metrics(self) -> Mapping[str, float]:
        """Return the numbers of all brakings and of those without a cause."""
        if not self._plans:
            return {}
        brakings = self._tracks.brakings(self._settings.of)
        name = f"{self.name}.{self._settings.of}"
        return {f"{name}.brakings": float(brakings.number), f"{name}.without_cause": float(brakings.without_cause)}
