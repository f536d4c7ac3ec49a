"""Conditions on parameters, variables and values from outside."""

from __future__ import annotations

import re

from eidrive_scenario.api.actions import (
    Condition,
    Measure,
    RuntimeContext,
    describe_rule,
    model,
    relation,
    satisfies_rule,
)

WORDS = {"true": 1.0, "false": 0.0}
"""What a boolean counts as."""
NUMBER = re.compile(r"[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?|[+-]?INF", re.ASCII)


def agrees(text: str | None, rule: model.Rule, limit: str) -> bool:
    """Two texts by a rule: as numbers where both are, else as words in the order of the alphabet."""
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


def measured(text: str | None, rule: model.Rule, limit: str) -> tuple[Measure, ...]:
    """What is compared, where both are numbers."""
    first, second = _number(text or ""), _number(limit)
    return () if first is None or second is None else (Measure("", first, rule, second, ""),)


def _number(text: str) -> float | None:
    """A number as XML writes it; Python's own spellings, as 1_000, are words."""
    plain = text.strip()
    return float(plain) if NUMBER.fullmatch(plain) else WORDS.get(plain.lower())


class ParameterCondition(Condition):
    """The value of a parameter, as ParameterActions may have set it."""

    instant = True
    element: model.ParameterCondition

    def holds(self, context: RuntimeContext) -> bool:
        """Compare it."""
        return agrees(context.parameters.get(self.element.parameter_ref), self.element.rule, self.element.value)

    def explain(self, context: RuntimeContext) -> str:
        """Its value."""
        value = context.parameters.get(self.element.parameter_ref)
        sign = relation(self.element.rule, self.holds(context))
        return f"parameter {self.element.parameter_ref} = {value} {sign} {self.element.value}"

    def describe(self) -> str:
        """Rule and limit."""
        return f"parameter {self.element.parameter_ref} {describe_rule(self.element.rule)} {self.element.value}"

    def measures(self, context: RuntimeContext) -> tuple[Measure, ...]:
        """Its value."""
        return measured(context.parameters.get(self.element.parameter_ref), self.element.rule, self.element.value)


class VariableCondition(Condition):
    """The value of a variable."""

    instant = True
    element: model.VariableCondition

    def holds(self, context: RuntimeContext) -> bool:
        """Compare it."""
        return agrees(context.variables.get(self.element.variable_ref), self.element.rule, self.element.value)

    def explain(self, context: RuntimeContext) -> str:
        """Its value."""
        value = context.variables.get(self.element.variable_ref)
        sign = relation(self.element.rule, self.holds(context))
        return f"variable {self.element.variable_ref} = {value} {sign} {self.element.value}"

    def describe(self) -> str:
        """Rule and limit."""
        return f"variable {self.element.variable_ref} {describe_rule(self.element.rule)} {self.element.value}"

    def measures(self, context: RuntimeContext) -> tuple[Measure, ...]:
        """Its value."""
        return measured(context.variables.get(self.element.variable_ref), self.element.rule, self.element.value)


class UserDefinedValueCondition(Condition):
    """A value that somebody outside of the scenario gives; where nobody does it does not hold."""

    element: model.UserDefinedValueCondition

    def bind(self, context: RuntimeContext) -> None:
        """Let the stage know that the value is wanted."""
        context.requested_user_values.setdefault(self.element.name, self.element)

    def holds(self, context: RuntimeContext) -> bool:
        """Compare it."""
        return agrees(context.user_values.get(self.element.name), self.element.rule, self.element.value)

    def explain(self, context: RuntimeContext) -> str:
        """Its value."""
        value = context.user_values.get(self.element.name)
        sign = relation(self.element.rule, self.holds(context))
        return f"{self.element.name} = {value} {sign} {self.element.value}"

    def describe(self) -> str:
        """Rule and limit."""
        return f"{self.element.name} {describe_rule(self.element.rule)} {self.element.value}"

    def measures(self, context: RuntimeContext) -> tuple[Measure, ...]:
        """The value."""
        return measured(context.user_values.get(self.element.name), self.element.rule, self.element.value)
