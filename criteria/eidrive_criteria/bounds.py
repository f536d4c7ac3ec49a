"""Settings of criteria on a value with a lower and an upper limit."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, model_validator

from eidrive_scenario.api.criteria import CriterionSettings


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
        return self.at_least is not None and value < self.at_least

    def is_above(self, value: float) -> bool:
        """Return whether a value is above the upper limit."""
        return self.at_most is not None and value > self.at_most

    def limit_of(self, value: float | None) -> float | None:
        """Return the limit that a verdict states: the violated one, else the lower one if there is one."""
        if self.at_least is None or (value is not None and self.is_above(value)):
            return self.at_most
        return self.at_least
