"""Base class of criteria that sum a time, a distance or a number of events in a state that is not allowed."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import Annotated, ClassVar

from pydantic import Field

from eidrive_criteria.followed import FollowedCriterion
from eidrive_scenario.api.common import RoadNetwork, WorldView
from eidrive_scenario.api.criteria import (
    CriterionSettings,
    Frame,
    LaneTracker,
    Step,
    Verdict,
    actor_never_present,
)


class SummedSettings(CriterionSettings):
    """Settings: `{of: Ego, at_most: 0.5}` in the unit of the criterion."""

    of: str
    at_most: Annotated[float, Field(ge=0)] = 0.0


class SummedCriterion(FollowedCriterion):
    """Criterion that fails if a sum exceeds `at_most`; with `at_most` 0 a single frame in the state fails it."""

    needs_roads = True
    state: ClassVar[str]
    """Predicate of the state in reasons, which follows the name of the actor."""

    def __init__(self, settings: SummedSettings) -> None:
        super().__init__(settings, settings.of)
        self.at_most = settings.at_most
        self._sum = 0.0
        self._first: float | None = None
        """First time in the state [s]."""
        self._violated: float | None = None

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
        self.lanes.forget()

    def follow(self, frame: Frame, row: int, step: Step | None) -> None:
        time = frame.view.time
        added = self.increment(frame.view, row, *(step or (0.0, 0.0)))
        if added is None:
            return
        self._first = time if self._first is None else self._first
        self._sum += added
        if self._violated is None and (self._sum > self.at_most or self.at_most == 0.0):
            self._violated = time

    def verdict(self) -> Verdict:
        if not self.was_present:
            reason = actor_never_present([self.of])
        elif self._first is None:
            reason = f"{self.of} never {self.state}"
        else:
            amount = f"{self._sum:.2f} {self.unit}" if self.unit else f"{self._sum:.0f} times"
            reason = f"{self.of} {self.state}: {amount}, first at {self._first:.2f} s"
        return self.conclude(
            self.was_present and self._violated is None,
            reason,
            value=self._sum if self.was_present else None,
            limit=self.at_most,
            first_violation=self._violated,
        )

    def metrics(self) -> Mapping[str, float]:
        """Return the sum."""
        return {f"{self.name}.{self.of}": self._sum} if self.was_present else {}
