"""What the criteria on a pair of actors share: the smallest value of a quantity between the two, held to a limit."""

from __future__ import annotations

import math
from abc import abstractmethod
from typing import Annotated, ClassVar, Self

from pydantic import Field, model_validator

from eidrive_scenario.api.common import WorldView
from eidrive_scenario.api.criteria import Criterion, CriterionSettings, Frame, Verdict, actor_never_present


class PairSettings(CriterionSettings):
    """`{of: Ego, to: Incoming, at_least: 3.5}`; without `at_least` the criterion measures and passes."""

    of: str
    to: str
    at_least: Annotated[float, Field(ge=0)] | None = None

    @model_validator(mode="after")
    def _two_actors(self) -> Self:
        if self.of == self.to:
            raise ValueError(f"of and to are both {self.of!r}: name two actors")
        return self


class PairCriterion(Criterion):
    """Fails where the quantity falls below `at_least`, or where the two actors are never there together."""

    unit: ClassVar[str]

    def __init__(self, settings: PairSettings) -> None:
        super().__init__(settings)
        self.of, self.to, self.limit = settings.of, settings.to, settings.at_least
        self.subjects = (settings.of, settings.to)
        self.smallest, self.when = math.inf, math.nan
        """The smallest value yet, infinity where there was none, and when it was so [s]."""
        self._missing = set(self.subjects)
        self._together = False
        self._violated: float | None = None

    @abstractmethod
    def measure(self, view: WorldView, of: int, to: int) -> float:
        """The quantity between the actors in these two rows; infinity where there is none now.

        Where it is not the smallest yet, anything between that and the quantity will do.
        """

    @abstractmethod
    def words(self) -> str:
        """What the smallest value says, or that there was none though both were there."""

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
            reason = self.words()
        else:
            apart = f"{self.of} and {self.to} were never there together"
            reason = actor_never_present(self._missing) if self._missing else apart
        return Verdict(
            name=self.name,
            passed=self._together and self._violated is None,
            value=self.smallest if math.isfinite(self.smallest) else None,
            limit=self.limit,
            unit=self.unit,
            first_violation=self._violated,
            reason=reason,
            fatal=self.fatal and self._violated is not None,
        )
