"""Comparison of numbers by the rules of the standard, in conditions and constraints."""

from __future__ import annotations

from eidrive_scenario.base.tolerances import EPSILON
from eidrive_scenario.openscenario.model.enumerations import Rule


def satisfies_rule(value: float, rule: Rule, limit: float) -> bool:
    """Compare `value` with `limit` by a Rule of the standard; NaN fulfills no rule."""
    if value != value:
        return False
    match rule._value_:
        case "greaterThan":
            return value > limit + EPSILON
        case "greaterOrEqual":
            return value >= limit - EPSILON
        case "lessThan":
            return value < limit - EPSILON
        case "lessOrEqual":
            return value <= limit + EPSILON
        case "equalTo":
            return value == limit or abs(value - limit) <= EPSILON
        case "notEqualTo":
            return not (value == limit or abs(value - limit) <= EPSILON)
    raise ValueError(f"unknown rule {rule!r}")
