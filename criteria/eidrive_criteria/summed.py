"""Base class of criteria that sum a time, a distance or a number of events in a state that is not allowed."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import Annotated, ClassVar

from pydantic import Field

from eidrive_scenario.api.common import RoadNetwork, WorldView
from eidrive_scenario.api.criteria import (
    Continuity,
    Criterion,
    CriterionSettings,
    Frame,
    LaneTracker,
    Verdict,
    actor_never_present,
)


class SummedSettings(CriterionSettings):
    """Settings: `{of: Ego, at_most: 0.5}` in the unit of the criterion."""

    of: str
    at_most: Annotated[float, Field(ge=0)] = 0.0


class SummedCriterion(Criterion):
    """Criterion that fails if a sum exceeds `at_most`; with `at_most` 0 a single frame in the state fails it."""

    needs_roads = True
    state: ClassVar[str]
    """Predicate of the state in reasons, which follows the name of the actor."""

    def __init__(self, settings: SummedSettings) -> None:
        super().__init__(settings)
        self.of, self.at_most = settings.of, settings.at_most
        self.subjects = (settings.of,)
        self._sum = 0.0
        self._was_present = False
        self._first: float | None = None
        """First time in the state [s]."""
        self._violated: float | None = None
        self._continuity = Continuity()

    def bind(self, roads: RoadNetwork | None) -> None:
        super().bind(roads)
        if roads is not None:
            self.lanes = LaneTracker(roads)

    @abstractmethod
    def increment(self, view: WorldView, row: int, duration: float, distance: float) -> float | None:
        """Return the amount to add since the previous frame, None outside the state.

        duration, distance  since the previous frame [s, m]; 0 in the first one and after a teleport
        """

    def interrupt(self) -> None:
        """Forget the state of the previous frame, after an absence or a teleport."""

    def observe(self, frame: Frame) -> None:
        view = frame.view
        row = view.rows.get(self.of)
        step = self._continuity.step(view, row)
        if step is None:
            self.lanes.forget()
            self.interrupt()
        if row is None:
            return
        self._was_present = True
        added = self.increment(view, row, *(step or (0.0, 0.0)))
        if added is None:
            return
        self._first = view.time if self._first is None else self._first
        self._sum += added
        if self._violated is None and (self._sum > self.at_most or self.at_most == 0.0):
            self._violated = view.time

    def verdict(self) -> Verdict:
        if not self._was_present:
            reason = actor_never_present([self.of])
        elif self._first is None:
            reason = f"{self.of} never {self.state}"
        else:
            amount = f"{self._sum:.2f} {self.unit}" if self.unit else f"{self._sum:.0f} times"
            reason = f"{self.of} {self.state}: {amount}, first at {self._first:.2f} s"
        return Verdict(
            name=self.name,
            passed=self._was_present and self._violated is None,
            value=self._sum if self._was_present else None,
            limit=self.at_most,
            unit=self.unit,
            first_violation=self._violated,
            reason=reason,
            fatal=self.fatal and self._violated is not None,
        )

    def metrics(self) -> Mapping[str, float]:
        """Return the sum."""
        return {f"{self.name}.{self.of}": self._sum} if self._was_present else {}
