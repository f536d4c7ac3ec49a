"""Criterion: longest time in which an actor does not advance."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

from pydantic import Field

from eidrive_scenario.api.common import TIME_TOLERANCE
from eidrive_scenario.api.criteria import Criterion, CriterionSettings, Frame, Verdict, actor_never_present


class ActorBlockedSettings(CriterionSettings):
    """Settings: `{of: Ego, at_most: 180, below: 0.1}` with the time [s] and the speed of a blocked actor [m/s]."""

    of: str
    at_most: Annotated[float, Field(gt=0)] = 180.0
    below: Annotated[float, Field(gt=0)] = 0.1


class ActorBlocked(Criterion):
    """Criterion that fails if the actor drives slower than `below` for longer than `at_most` without a break."""

    settings_type = ActorBlockedSettings
    name = "actor_blocked"
    unit = "s"

    def __init__(self, settings: ActorBlockedSettings) -> None:
        super().__init__(settings)
        self._settings = settings
        self.subjects = (settings.of,)
        self._was_present = False
        self._since: float | None = None
        self._longest, self._start = 0.0, 0.0
        self._violated: float | None = None

    def observe(self, frame: Frame) -> None:
        view, settings = frame.view, self._settings
        row = view.rows.get(settings.of)
        if row is None or abs(float(view.speed[row])) >= settings.below:
            self._was_present = self._was_present or row is not None
            self._since = None
            return
        self._was_present = True
        self._since = view.time if self._since is None else self._since
        blocked = view.time - self._since
        if blocked > self._longest:
            self._longest, self._start = blocked, self._since
        if self._violated is None and blocked > settings.at_most + TIME_TOLERANCE:
            self._violated = view.time

    def verdict(self) -> Verdict:
        of = self._settings.of
        if not self._was_present:
            reason = actor_never_present([of])
        elif self._longest > 0.0:
            reason = f"{of} was blocked for {self._longest:.2f} s from {self._start:.2f} s on"
        else:
            reason = f"{of} was never blocked"
        return Verdict(
            name=self.name,
            passed=self._was_present and self._violated is None,
            value=self._longest if self._was_present else None,
            limit=self._settings.at_most,
            unit=self.unit,
            first_violation=self._violated,
            reason=reason,
            fatal=self.fatal and self._violated is not None,
        )

    def metrics(self) -> Mapping[str, float]:
        """Return the longest time in which the actor was blocked [s]."""
        return {f"{self.name}.{self._settings.of}": self._longest} if self._was_present else {}
