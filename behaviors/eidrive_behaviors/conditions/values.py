"""Conditions on parameters, variables and external values."""

from __future__ import annotations

import re

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
NUMBER = re.compile(r"[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?|[+-]?INF", re.ASCII)


def satisfies(text: str | None, rule: model.Rule, limit: str) -> bool:
    """Compare two texts by a rule: as numbers if both are numbers, else in alphabetical order."""
    if text is None:
        return False
    first, second = _number(text), _number(limit)
    if first is not None and second is not None:
        return satisfies_rule(first, rule, second)
    match rule.value:
        case "equalTo":
            return text == limit
        case "notEqualTo":
            return text != limit
        case "greaterThan":
            return text > limit
        case "lessThan":
            return text < limit
        case "greaterOrEqual":
            return text >= limit
    return text <= limit


def numeric_measures(text: str | None, rule: model.Rule, limit: str) -> tuple[Measure, ...]:
    """Return the compared numbers; empty if one of the texts is not a number."""
    first, second = _number(text or ""), _number(limit)
    return () if first is None or second is None else (Measure("", first, rule, second, ""),)


def _number(text: str) -> float | None:
    """Return a number in XML notation; None for Python's own notations, as 1_000, and for other text."""
    plain = text.strip()
    return float(plain) if NUMBER.fullmatch(plain) else BOOLEANS.get(plain.lower())


class ParameterCondition(Condition):
    """Value of a parameter, including changes by ParameterActions."""

    instant = True
    element: model.ParameterCondition

    def holds(self, context: ConditionContext) -> bool:
        """Compare the value."""
        return satisfies(context.parameters.get(self.element.parameter_ref), self.element.rule, self.element.value)

    def explain(self, context: ConditionContext) -> str:
        """Describe the current value."""
        value = context.parameters.get(self.element.parameter_ref)
        sign = relation(self.element.rule, self.holds(context))
        return f"parameter {self.element.parameter_ref} = {value} {sign} {self.element.value}"

    def describe(self) -> str:
        """Describe rule and limit."""
        return f"parameter {self.element.parameter_ref} {describe_rule(self.element.rule)} {self.element.value}"

    def measures(self, context: ConditionContext) -> tuple[Measure, ...]:
        """Return the value."""
        return numeric_measures(
            context.parameters.get(self.element.parameter_ref), self.element.rule, self.element.value
        )


class VariableCondition(Condition):
    """Value of a variable."""

    instant = True
    element: model.VariableCondition

    def holds(self, context: ConditionContext) -> bool:
        """Compare the value."""
        return satisfies(context.variables.get(self.element.variable_ref), self.element.rule, self.element.value)

    def explain(self, context: ConditionContext) -> str:
        """Describe the current value."""
        value = context.variables.get(self.element.variable_ref)
        sign = relation(self.element.rule, self.holds(context))
        return f"variable {self.element.variable_ref} = {value} {sign} {self.element.value}"

    def describe(self) -> str:
        """Describe rule and limit."""
        return f"variable {self.element.variable_ref} {describe_rule(self.element.rule)} {self.element.value}"

    def measures(self, context: ConditionContext) -> tuple[Measure, ...]:
        """Return the value."""
        return numeric_measures(context.variables.get(self.element.variable_ref), self.element.rule, self.element.value)


class UserDefinedValueCondition(Condition):
    """Value that is set from outside the scenario. Without a value the condition is false."""

    element: model.UserDefinedValueCondition

    def bind(self, context: ConditionContext) -> None:
        """Register the request for the value."""
        context.request_user_value(self.element)

    def holds(self, context: ConditionContext) -> bool:
        """Compare the value."""
        return satisfies(context.user_values.get(self.element.name), self.element.rule, self.element.value)

    def explain(self, context: ConditionContext) -> str:
        """Describe the current value."""
        value = context.user_values.get(self.element.name)
        sign = relation(self.element.rule, self.holds(context))
        return f"{self.element.name} = {value} {sign} {self.element.value}"

    def describe(self) -> str:
        """Describe rule and limit."""
        return f"{self.element.name} {describe_rule(self.element.rule)} {self.element.value}"

    def measures(self, context: ConditionContext) -> tuple[Measure, ...]:
        """Return the value."""
        return numeric_measures(context.user_values.get(self.element.name), self.element.rule, self.element.value)
