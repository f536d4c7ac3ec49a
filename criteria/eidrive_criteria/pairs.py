"""Base classes of criteria on an actor and another one: any other actor, or the leader in its lane."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping
from typing import Annotated, ClassVar

from pydantic import Field, model_validator

from eidrive_criteria.folds import Extreme, conclude_extreme, falls_below, require_two_actors
from eidrive_scenario.api.common import RoadNetwork, WorldView
from eidrive_scenario.api.criteria import (
    Criterion,
    CriterionSettings,
    Frame,
    Relation,
    Surroundings,
    Verdict,
    actor_never_present,
)


def has_contact(view: WorldView, of: str, to: str) -> bool:
    """Return whether two actors touched during the step before the view; they may be apart at its end."""
    return any({contact.first, contact.second} == {of, to} for contact in view.contacts)


class PairSettings(CriterionSettings):
    """Settings: `{of: Ego, to: Incoming, at_least: 3.5}`. Without `at_least` the criterion only measures and passes."""

    of: str
    to: str
    at_least: Annotated[float, Field(ge=0)] | None = None

    _two_actors = model_validator(mode="after")(require_two_actors)


class PairCriterion(Criterion):
    """Criterion that fails if a quantity falls below `at_least`.

    It also fails if both actors are never present at the same time.
    """

    def __init__(self, settings: PairSettings) -> None:
        super().__init__(settings)
        self.of, self.to, self.limit = settings.of, settings.to, settings.at_least
        self.subjects = (settings.of, settings.to)
        self.smallest, self.when = math.inf, math.nan
        """Minimum so far, infinite without a value, and its time [s]."""
        self._missing = set(self.subjects)
        self._together = False
        self._violated: float | None = None

    @abstractmethod
    def measure(self, view: WorldView, of: int, to: int) -> float:
        """Return the quantity between the actors in two rows of the view; infinite if there is none now.

        If it exceeds the minimum so far, any value between that minimum and the quantity is allowed.
        """

    @abstractmethod
    def describe_smallest(self) -> str:
        """Describe the minimum, or its absence although both actors were present."""

    def observe(self, frame: Frame) -> None:
        view = frame.view
        if self._missing:
            self._missing.difference_update(view.names)
        of, to = view.rows.get(self.of), view.rows.get(self.to)
        if of is None or to is None:
            return
        self._together = True
        self._add(self.measure(view, of, to), view.time)

    def _add(self, value: float, time: float) -> None:
        if value < self.smallest:
            self.smallest, self.when = value, time
        if self._violated is None and falls_below(value, self.limit):
            self._violated = time

    def verdict(self) -> Verdict:
        if self._together:
            reason = self.describe_smallest()
        else:
            apart = f"{self.of} and {self.to} were never present at the same time"
            reason = actor_never_present(self._missing) if self._missing else apart
        return self.conclude(
            self._together and self._violated is None,
            reason,
            value=self.smallest if math.isfinite(self.smallest) else None,
            limit=self.limit,
            first_violation=self._violated,
        )

    def metrics(self) -> Mapping[str, float]:
        """Return the minimum; empty without a value."""
        return {f"{self.name}.{self.of}.{self.to}": self.smallest} if math.isfinite(self.smallest) else {}


class SurroundedCriterion(Criterion):
    """Criterion on an actor and those around it, or only one of them, in the coordinates of the lane of the actor."""

    def __init__(self, settings: CriterionSettings, of: str, to: str | None) -> None:
        super().__init__(settings)
        self.of = of
        self.others = None if to is None else (to,)
        """Names of the evaluated others; None for all."""
        self.subjects = (of, *(self.others or ()))
        self.missing = set(self.subjects)
        """Required actors that were never present so far."""
        self.surroundings = Surroundings(None)

    def bind(self, roads: RoadNetwork | None) -> None:
        super().bind(roads)
        self.surroundings = Surroundings(roads)


class LeaderSettings(CriterionSettings):
    """Settings: `{of: Ego}` for the nearest actor ahead in the path of the actor, `{of: Ego, to: Lead}` for one actor
    while it is ahead in that path.
    """

    of: str
    to: str | None = None

    _two_actors = model_validator(mode="after")(require_two_actors)


class LeaderCriterion(SurroundedCriterion):
    """Criterion on a quantity of an actor and its leader.

    A criterion with a minimum fails below `limit`, one with a maximum above it. Without a leader it passes; its value
    is then None.
    """

    quantity: ClassVar[str]
    """Description of the quantity for reasons."""
    largest: ClassVar[bool] = False
    """Whether the extreme is a maximum."""
    in_contact: ClassVar[float | None] = None
    """Quantity in a crash with the leader; None for that of the frame."""

    def __init__(self, settings: LeaderSettings, limit: float | None) -> None:
        super().__init__(settings, settings.of, settings.to)
        self._target = settings.to or "an actor"
        self._extreme = Extreme(limit, largest=self.largest)
        self._leader = self._other = ""
        """Leader in the last frame, and that of the extreme."""
        self._was_led = False
        """Whether there was a leader so far."""

    @abstractmethod
    def measure(self, leader: Relation) -> float | None:
        """Return the quantity with regard to the leader; None if it is not defined now."""

    def observe(self, frame: Frame) -> None:
        view = frame.view
        if self.missing:
            self.missing.difference_update(view.names)
        leader = self.surroundings.leader(view, self.of, self.others)
        self._was_led = self._was_led or leader is not None
        value, other = (self.measure(leader), leader.other) if leader is not None else (None, "")
        if self.in_contact is not None:
            # Bodies with a contact within the step may be apart, and beside each other, at its end.
            for name in (self._leader, other):
                if has_contact(view, self.of, name):
                    value, other = self.in_contact, name
            self._leader = leader.other if leader is not None else ""
        if value is None:
            return
        if self._extreme.add(value, view.time):
            self._other = other
        if self._extreme.violated is not None:
            self.violated_with = self.violated_with or other

    def verdict(self) -> Verdict:
        if self.missing:
            reason = actor_never_present(self.missing)
        elif self._extreme.value is None and self._was_led:
            reason = f"the {self.quantity} of {self.of} to {self._target} ahead in its path was never defined"
        elif self._extreme.value is None:
            reason = f"{self.of} never had {self._target} ahead in its path, so there is no {self.quantity}"
        else:
            value = f"{self._extreme.value:.2f} {self.unit}"
            reason = f"{self.quantity} of {self.of} to {self._other} was {value} at {self._extreme.when:.2f} s"
        return conclude_extreme(self, self._extreme, reason, measured=not self.missing)

    def metrics(self) -> Mapping[str, float]:
        """Return the extreme and its time [s]; empty without a value."""
        if self._extreme.value is None:
            return {}
        return {f"{self.name}.{self.of}": self._extreme.value, f"{self.name}.{self.of}.time": self._extreme.when}
