"""Criterion: longest time in which an actor does not advance."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

from pydantic import Field

from eidrive_criteria.folds import Extreme, conclude_extreme
from eidrive_scenario.api.criteria import Criterion, CriterionSettings, Frame, Verdict, actor_never_present


class ActorBlockedSettings(CriterionSettings):
    """Settings: `{of: Ego, at_most: 180, below: 0.1}` with the time at_most [s] and the speed below [m/s]."""

    of: str
    at_most: Annotated[float, Field(gt=0)] = 180.0
    below: Annotated[float, Field(gt=0)] = 0.1


class ActorBlocked(Criterion):
    """Criterion that fails if the actor drives slower than `below` for longer than `at_most` without a break."""

    settings_type = ActorBlockedSettings
    name = "actor_blocked"
    unit = "s"
    demands_progress = True

    def __init__(self, settings: ActorBlockedSettings) -> None:
        super().__init__(settings)
        self._settings = settings
        self.subjects = (settings.of,)
        self._since: float | None = None
        self._longest = Extreme(settings.at_most, largest=True)

    def observe(self, frame: Frame) -> None:
        view, settings = frame.view, self._settings
        row = view.rows.get(settings.of)
        if row is None or abs(float(view.speed[row])) >= settings.below:
            self._since = None
            if row is not None:
                self._longest.add(0.0, view.time)
            return
        self._since = view.time if self._since is None else self._since
        self._longest.add(view.time - self._since, view.time)

    def verdict(self) -> Verdict:
        of, longest = self._settings.of, self._longest
        if longest.value is None:
            reason = actor_never_present([of])
        elif longest.value > 0.0:
            reason = f"{of} was blocked for {longest.value:.2f} s from {longest.when - longest.value:.2f} s on"
        else:
            reason = f"{of} was never blocked"
        return conclude_extreme(self, longest, reason, measured=longest.value is not None)

    def metrics(self) -> Mapping[str, float]:
        """Return the longest time in which the actor was blocked [s]."""
        return {} if self._longest.value is None else {f"{self.name}.{self._settings.of}": self._longest.value}
