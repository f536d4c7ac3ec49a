"""Folds that criteria share: limits of a value, its extreme, samples, steps of one actor, sums in a forbidden state."""

from __future__ import annotations

import math
from abc import abstractmethod
from array import array
from collections.abc import Mapping, Sequence
from typing import Annotated, ClassVar, Literal, Self, TypeVar

import numpy as np
from pydantic import Field, model_validator

from eidrive_scenario.api.common import EPSILON, TIME_TOLERANCE, RoadNetwork, WorldView, counted
from eidrive_scenario.api.criteria import (
    Continuity,
    Criterion,
    CriterionSettings,
    Frame,
    LaneTracker,
    Step,
    Verdict,
    actor_never_present,
)

TwoActors = TypeVar("TwoActors", bound=CriterionSettings)


def exceeds(value: float, limit: float | None) -> bool:
    """Return whether a value exceeds a limit, None for no limit, by more than the rounding error of its calculation."""
    return limit is not None and value > limit + EPSILON


def falls_below(value: float, limit: float | None) -> bool:
    """Return whether a value is below a limit, None for no limit, by more than the rounding error."""
    return limit is not None and value < limit - EPSILON


class Deadline:
    """Time of the first frame after a deadline.

    expired  this time [s]; None before it, and without a deadline
    """

    def __init__(self, by: float | None) -> None:
        self._by = by
        self.expired: float | None = None

    def observe(self, time: float) -> None:
        """Process the time of one frame [s]."""
        if self.expired is None and self._by is not None and time > self._by + TIME_TOLERANCE:
            self.expired = time


class BoundedSettings(CriterionSettings):
    """Settings: `{at_least: 1, at_most: 3}` in the unit of the criterion, which passes without limits."""

    at_least: Annotated[float, Field(ge=0)] | None = None
    at_most: Annotated[float, Field(ge=0)] | None = None

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.at_least is not None and self.at_most is not None and self.at_least > self.at_most:
            raise ValueError(f"'at_least' exceeds 'at_most' (got {self.at_least} > {self.at_most})")
        return self

    def allows(self, value: float) -> bool:
        """Return whether a value is within the limits."""
        return not self.is_below(value) and not self.is_above(value)

    def is_below(self, value: float) -> bool:
        """Return whether a value is below the lower limit."""
        return falls_below(value, self.at_least)

    def is_above(self, value: float) -> bool:
        """Return whether a value is above the upper limit."""
        return exceeds(value, self.at_most)

    def limit_of(self, value: float | None) -> float | None:
        """Return the limit that a verdict states: the one nearer to the value, so a violated one; without a value the
        lower one if there is one.
        """
        if self.at_least is None or self.at_most is None or value is None:
            return self.at_most if self.at_least is None else self.at_least
        return min(self.at_least, self.at_most, key=lambda limit: abs(value - limit))


def share_margin(name: str, share: float, at_least: float | None) -> dict[str, float]:
    """Return the metric `margin` of a share with a minimum: 0 at the minimum and 1 at a share of 1, the best one.

    Empty without a minimum.
    """
    if not at_least:
        return {}
    return {f"{name}.margin": (share - at_least) / (1.0 - at_least) if at_least < 1.0 else share}


def require_two_actors(settings: TwoActors) -> TwoActors:
    """Return settings whose actors `of` and `to` differ. It is a validator of pydantic: it raises ValueError."""
    of, to = getattr(settings, "of", None), getattr(settings, "to", None)
    if of == to:
        raise ValueError(f"'of' and 'to' are equal (got {of!r}; expected two actors)")
    return settings


class Extreme:
    """Largest or smallest value with its time [s], and the time of the first value beyond the limit."""

    def __init__(self, limit: float | None, *, largest: bool) -> None:
        self.limit = limit
        self._largest = largest
        self.value: float | None = None
        """The extreme; None before the first value."""
        self.when = math.nan
        self.violated: float | None = None
        """Time of the first violation [s]; None without one."""

    def add(self, value: float, time: float) -> bool:
        """Add a value, and return whether it is the new extreme."""
        violates = exceeds if self._largest else falls_below
        if self.violated is None and violates(value, self.limit):
            self.violated = time
        if self.value is not None and (value <= self.value if self._largest else value >= self.value):
            return False
        self.value, self.when = value, time
        return True


def conclude_extreme(criterion: Criterion, extreme: Extreme, reason: str, *, measured: bool = True) -> Verdict:
    """Return the verdict on an extreme: failed by a violation, or unless it was `measured`."""
    return criterion.conclude(
        measured and extreme.violated is None,
        reason,
        value=extreme.value,
        limit=extreme.limit,
        first_violation=extreme.violated,
    )


Measure = Literal["mean", "p95", "max"]
PHRASES: Mapping[Measure, str] = {"mean": "on average", "p95": "at the 95th percentile", "max": "at most"}


class Sample:
    """Numbers of a run, of which one measure is limited; only a violation by the maximum has a time."""

    def __init__(self, measure: Measure, limit: float | None) -> None:
        self._measure, self._limit = measure, limit
        self._numbers = array("d")
        self._violated: float | None = None

    def add(self, numbers: Sequence[float], time: float) -> None:
        """Add numbers of a time [s]."""
        self._numbers.extend(numbers)
        if self._measure == "max" and self._violated is None:
            self._violated = time if any(exceeds(number, self._limit) for number in numbers) else None

    def values(self) -> dict[Measure, float]:
        """Return the value of each measure; empty without a number."""
        if not self._numbers:
            return {}
        numbers = np.array(self._numbers)
        return {"mean": float(numbers.mean()), "p95": float(np.percentile(numbers, 95)), "max": float(numbers.max())}

    @property
    def value(self) -> float | None:
        """Value of the limited measure; None without a number."""
        return self.values().get(self._measure)

    def conclude(self, criterion: Criterion, reason: str, *, measured: bool) -> Verdict:
        """Return the verdict on the sample: failed by a violation, or unless it was `measured`."""
        value, limit = self.value, self._limit
        passed = measured and not (value is not None and exceeds(value, limit))
        return criterion.conclude(passed, reason, value=value, limit=limit, first_violation=self._violated)


class FollowedCriterion(Criterion):
    """Criterion on one actor. Its motion since the previous frame excludes absences and teleports."""

    def __init__(self, settings: CriterionSettings, of: str) -> None:
        super().__init__(settings)
        self.of = of
        self.subjects = (of,)
        self.was_present = False
        """Whether the actor was in a frame."""
        self._continuity = Continuity()

    def interrupt(self) -> None:
        """Forget the previous frame, after an absence or a teleport, and before the first frame."""

    @abstractmethod
    def follow(self, frame: Frame, row: int, step: Step | None) -> None:
        """Process a frame with the actor in a row. `step` is the motion since the previous frame; None without it."""

    def observe(self, frame: Frame) -> None:
        row = frame.view.rows.get(self.of)
        step = self._continuity.step(frame.view, row)
        if step is None:
            self.interrupt()
        if row is not None:
            self.was_present = True
            self.follow(frame, row, step)


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
        if self._violated is None and (exceeds(self._sum, self.at_most) or self.at_most == 0.0):
            self._violated = time

    def verdict(self) -> Verdict:
        if not self.was_present:
            reason = actor_never_present([self.of])
        elif self._first is None:
            reason = f"{self.of} never {self.state}"
        else:
            amount = f"{self._sum:.2f} {self.unit}" if self.unit else counted(round(self._sum), "time")
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
