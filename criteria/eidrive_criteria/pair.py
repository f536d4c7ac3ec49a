"""Base class of criteria on a pair of actors: minimum of a quantity between both, compared with a limit."""

from __future__ import annotations

import math
from abc import abstractmethod
from typing import Annotated, Self

from pydantic import Field, model_validator

from eidrive_scenario.api.common import WorldView
from eidrive_scenario.api.criteria import Criterion, CriterionSettings, Frame, Verdict, actor_never_present


class PairSettings(CriterionSettings):
    """Settings: `{of: Ego, to: Incoming, at_least: 3.5}`. Without `at_least` the criterion only measures and passes."""

    of: str
    to: str
    at_least: Annotated[float, Field(ge=0)] | None = None

    @model_validator(mode="after")
    def _two_actors(self) -> Self:
        if self.of == self.to:
            raise ValueError(f"'of' and 'to' are equal (got {self.of!r}; expected two actors)")
        return self


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
        value = self.measure(view, of, to)
        if value < self.smallest:
            self.smallest, self.when = value, view.time
        if self._violated is None and self.limit is not None and value < self.limit:
            self._violated = view.time

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
