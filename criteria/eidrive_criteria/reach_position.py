"""Criterion: arrival of an actor at a position."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated

from pydantic import Field

from eidrive_criteria.folds import Deadline, exceeds
from eidrive_scenario.api.criteria import Criterion, CriterionSettings, Frame, Verdict, actor_never_present


class ReachPositionSettings(CriterionSettings):
    """Settings: `{of: Ego, x: 42.0, y: -3.5, within: 2.0, by: 30}` with x, y, within [m], by [s].

    A fatal criterion ends the run at an expired deadline. Without `by` it is open until the end.
    """

    of: str
    x: float
    y: float
    within: Annotated[float, Field(gt=0)] = 2.0
    by: Annotated[float, Field(gt=0)] | None = None


class ReachPosition(Criterion):
    """Criterion that passes once the actor is within the tolerance of the position, before the deadline.

    The distance is horizontal and refers to the reference point of the actor.
    """

    settings_type = ReachPositionSettings
    name = "reach_position"
    unit = "m"
    demands_progress = True

    def __init__(self, settings: ReachPositionSettings) -> None:
        super().__init__(settings)
        self._settings = settings
        self.subjects = (settings.of,)
        self._nearest = math.inf
        self._reached: float | None = None
        self._deadline = Deadline(settings.by)

    def observe(self, frame: Frame) -> None:
        view, settings = frame.view, self._settings
        row = view.rows.get(settings.of)
        self._deadline.observe(view.time)
        if row is None or self._deadline.expired is not None:
            return
        x, y, _ = view.position[row].tolist()
        distance = math.hypot(x - settings.x, y - settings.y)
        self._nearest = min(self._nearest, distance)
        if self._reached is None and not exceeds(distance, settings.within):
            self._reached = view.time

    def verdict(self) -> Verdict:
        settings = self._settings
        target = f"({settings.x:.1f}, {settings.y:.1f})"
        if self._reached is not None:
            reason = f"{settings.of} reached {target} at {self._reached:.2f} s"
        elif math.isfinite(self._nearest):
            until = "" if settings.by is None else f" until {settings.by:.2f} s"
            reason = f"{settings.of} came no nearer to {target} than {self._nearest:.2f} m{until}"
        else:
            reason = actor_never_present([settings.of])
        return self.conclude(
            self._reached is not None,
            reason,
            value=self._nearest if math.isfinite(self._nearest) else None,
            limit=settings.within,
            first_violation=self._deadline.expired if self._reached is None else None,
        )

    def metrics(self) -> Mapping[str, float]:
        """Return the arrival time [s] and the share of the time left until the deadline, 1 without one.

        Empty without arrival. The nearest distance is no margin: a run that ends on arrival has that of the tolerance.
        """
        if self._reached is None:
            return {}
        by = self._settings.by
        margin = 1.0 if by is None else max(0.0, 1.0 - self._reached / by)
        return {f"{self.name}.time": self._reached, f"{self.name}.margin": margin}
