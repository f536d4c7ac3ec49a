"""An actor must get somewhere: the length of its way."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

from pydantic import Field

from eidrive_scenario.api.common import TIME_TOLERANCE
from eidrive_scenario.api.criteria import Criterion, CriterionSettings, Frame, Verdict, actor_never_present


class DrivenDistanceSettings(CriterionSettings):
    """`{of: Ego, at_least: 100, by: 30}`: that far [m], until then [s].

    A fatal one ends the run when `by` has passed in vain; without `by` it stays open to the end.
    """

    of: str
    at_least: Annotated[float, Field(gt=0)]
    by: Annotated[float, Field(gt=0)] | None = None


class DrivenDistance(Criterion):
    """Passes once the actor has driven that far: its speed over time (trapezoidal rule), so that a jump counts not."""

    settings_type = DrivenDistanceSettings
    name = "driven_distance"

    def __init__(self, settings: DrivenDistanceSettings) -> None:
        super().__init__(settings)
        self._settings = settings
        self.subjects = (settings.of,)
        self._distance = 0.0
        self._seen = False
        self._last: tuple[float, float] | None = None
        """Time and speed [s, m/s] in the frame before; None where the actor was not in the world."""
        self._late = False

    def observe(self, frame: Frame) -> None:
        view = frame.view
        row, by = view.rows.get(self._settings.of), self._settings.by
        self._late = by is not None and view.time > by + TIME_TOLERANCE
        if row is None:
            self._last = None
        if row is None or self._late:
            return
        self._seen = True
        time, speed = view.time, abs(float(view.speed[row]))
        if self._last is not None:
            before, speed_before = self._last
            self._distance += (time - before) * (speed + speed_before) / 2
        self._last = time, speed

    def verdict(self) -> Verdict:
        of, limit, seen = self._settings.of, self._settings.at_least, self._seen
        return Verdict(
            name=self.name,
            passed=seen and self._distance >= limit,
            value=self._distance if seen else None,
            limit=limit,
            unit="m",
            first_violation=None,
            reason=f"{of} drove {self._distance:.1f} m" if seen else actor_never_present([of]),
            fatal=self.fatal and self._late,
        )

    def metrics(self) -> Mapping[str, float]:
        """The length of the way [m]."""
        return {f"driven_distance.{self._settings.of}": self._distance} if self._seen else {}
