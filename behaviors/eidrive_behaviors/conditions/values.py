"""Conditions on parameters, variables and external values."""

from __future__ import annotations

import operator
import re
from abc import abstractmethod
from collections.abc import Callable, Mapping
from datetime import UTC, datetime

from eidrive_scenario.api.actions import (
    Condition,
    ConditionContext,
    Measure,
    describe_rule,
    model,
    relation,
    satisfies_rule,
)

BOOLEANS = {"true": 1.0, "false": 0.0}
"""Numeric values of booleans."""
ALPHABETICAL: Mapping[model.Rule, Callable[[str, str], bool]] = {
    model.Rule.EQUAL_TO: operator.eq,
    model.Rule.NOT_EQUAL_TO: operator.ne,
    model.Rule.GREATER_THAN: operator.gt,
    model.Rule.GREATER_OR_EQUAL: operator.ge,
    model.Rule.LESS_THAN: operator.lt,
    model.Rule.LESS_OR_EQUAL: operator.le,
}
NUMBER = re.compile(r"[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?|[+-]?INF", re.ASCII)
"""Number in XML notation, which excludes Python's own ones, such as 1_000."""
DATE_TIME = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(?:\.\d+)?(?:Z|[+-]\d\d:\d\d)?", re.ASCII)


def satisfies(text: str | None, rule: model.Rule, limit: str) -> bool:
    """Compare two texts by a rule: as numbers or instants if both are such, else in alphabetical order."""
    if text is None:
        return False
    for convert in (_number, _instant):
        first, second = convert(text), convert(limit)
        if first is not None and second is not None:
            return satisfies_rule(first, rule, second)
    return ALPHABETICAL[rule](text, limit)


def _number(text: str) -> float | None:
    """Return a number in XML notation; None for Python's own notations, as 1_000, and for other text."""
    plain = text.strip()
    return float(plain) if NUMBER.fullmatch(plain) else BOOLEANS.get(plain.lower())


def _instant(text: str) -> float | None:
    """Return a date and time in seconds, in UTC without a time zone; None for other text."""
    if not DATE_TIME.fullmatch(text.strip()):
        return None
    try:
        moment = datetime.fromisoformat(text.strip())
    except ValueError:
        return None
    return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()


class TextCondition(Condition):
    """Base class of conditions that compare the text of a named value with that of the element."""

    element: model.ParameterCondition | model.VariableCondition | model.UserDefinedValueCondition

    @property
    @abstractmethod
    def label(self) -> str:
        """Kind and name of the value."""

    @abstractmethod
    def current(self, context: ConditionContext) -> str | None:
        """Return the current text; None without one, by which no rule is fulfilled."""

    def holds(self, context: ConditionContext) -> bool:
        """Compare the value."""
        return satisfies(self.current(context), self.element.rule, self.element.value)

    def explain(self, context: ConditionContext) -> str:
        """Describe the current value."""
        sign = relation(self.element.rule, self.holds(context))
        return f"{self.label} = {self.current(context)} {sign} {self.element.value}"

    def describe(self) -> str:
        """Describe rule and limit."""
        return f"{self.label} {describe_rule(self.element.rule)} {self.element.value}"

    def measures(self, context: ConditionContext) -> tuple[Measure, ...]:
        """Return the value if it and the limit are numbers."""
        value, limit = _number(self.current(context) or ""), _number(self.element.value)
        return () if value is None or limit is None else (Measure("", value, self.element.rule, limit, ""),)


class ParameterCondition(TextCondition):
    """Value of a parameter, including changes by ParameterActions."""

    instant = True
    element: model.ParameterCondition

    @property
    def label(self) -> str:
        """Kind and name of the value."""
        return f"parameter {self.element.parameter_ref}"

    def current(self, context: ConditionContext) -> str | None:
        """Return the current value."""
        return context.parameter(self.element)


class VariableCondition(TextCondition):
    """Value of a variable."""

    instant = True
    element: model.VariableCondition

    @property
    def label(self) -> str:
        """Kind and name of the value."""
        return f"variable {self.element.variable_ref}"

    def current(self, context: ConditionContext) -> str | None:
        """Return the current value."""
        return context.variables.get(self.element.variable_ref)


class UserDefinedValueCondition(TextCondition):
    """Value that is set from outside the scenario. Without a value the condition is false."""

    element: model.UserDefinedValueCondition

    def bind(self, context: ConditionContext) -> None:
        """Register the request for the value."""
        context.request_user_value(self.element)

    @property
    def label(self) -> str:
        """Name of the value."""
        return self.element.name

    def current(self, context: ConditionContext) -> str | None:
        """Return the value that is set; None without one."""
        return context.user_values.get(self.element.name)
