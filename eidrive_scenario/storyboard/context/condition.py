"""Interface of conditions: a Condition is a predicate over the state of the run at one instant."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Collection, Sequence
from typing import Any, ClassVar, NamedTuple

import numpy as np

from eidrive_scenario.base.tolerances import EPSILON
from eidrive_scenario.errors import InvalidResult
from eidrive_scenario.extensions.registry import is_built_in
from eidrive_scenario.openscenario import model
from eidrive_scenario.openscenario.values.parameters import satisfies_rule
from eidrive_scenario.storyboard.context.contexts import ConditionContext, MotionChange

SYMBOLS = {
    "greaterThan": ">",
    "greaterOrEqual": "≥",
    "lessThan": "<",
    "lessOrEqual": "≤",
    "equalTo": "=",
    "notEqualTo": "≠",
}

COMPLEMENTS = {">": "≤", "≥": "<", "<": "≥", "≤": ">", "=": "≠", "≠": "="}
"""Complementary relation by relation."""


def next_change(value: float, limit: float) -> float:
    """Return the value up to which the comparison of an increasing value with its limit is certainly constant."""
    before, after = limit - 2.0 * EPSILON, limit + 2.0 * EPSILON
    return before if value < before else math.inf if value > after else -math.inf


def describe_rule(rule: model.Rule) -> str:
    """Return the symbol of a Rule."""
    return SYMBOLS[rule.value]


def relation(rule: model.Rule, holds: bool) -> str:
    """Return the symbol of the relation between a value and its limit: that of the rule, or its complement."""
    sign = SYMBOLS[rule.value]
    return sign if holds else COMPLEMENTS[sign]


class Measure(NamedTuple):
    """Quantity that a condition compares at one instant; `of` is the entity, empty without one."""

    of: str
    value: float
    rule: model.Rule
    limit: float
    unit: str


class Condition(ABC):
    """Predicate over the state of the run. Edges and delays belong to the trigger."""

    instant: ClassVar[bool] = False
    """True if its value can change within a tick, as states of elements and values that actions set do. It is then
    evaluated again after such a change. Other conditions are evaluated once per tick."""
    reads: Collection[MotionChange] | None = None
    """Motion that changes its value, beside time and, if it is `instant`, the states of storyboard elements. None if
    anything else changes it: it is then evaluated in every tick, as conditions of third parties are."""

    def __init__(self, element: model.Element) -> None:
        self.element = element

    @property
    def error_subject(self) -> str:
        """Location of the element, which errors of the condition name."""
        return f"{self.element.source}:{self.element.line}"

    def bind(self, context: ConditionContext) -> None:  # noqa: B027 - most conditions have no references
        """Resolve references of the element, once before the first tick. Raise ScenarioError if one is unknown."""

    @abstractmethod
    def holds(self, context: ConditionContext) -> bool:
        """Whether the condition is fulfilled now."""

    @abstractmethod
    def explain(self, context: ConditionContext) -> str:
        """Describe the condition with its current values."""

    def describe(self) -> str:
        """Describe the condition without values."""
        return type(self.element).__name__

    def measures(self, context: ConditionContext) -> tuple[Measure, ...]:
        """Return the quantities that it compares now."""
        return ()

    def constant_until(self, context: ConditionContext) -> float:
        """Return the time [s] up to which a condition with `reads` is constant while they stand and no element changes
        its state.
        """
        return math.inf


def truth(condition: Condition, held: object) -> bool:
    """Return the result of a condition as bool. Raise InvalidResult if it is none, as None and NaN are."""
    if isinstance(held, bool | np.bool_):
        return bool(held)
    raise InvalidResult(condition, "the condition", f"returned {held!r} (expected True or False)")


class EntityCondition(Condition):
    """Condition on triggering entities, combined by `any` or `all`. An absent entity does not fulfill it."""

    unit: ClassVar[str] = ""
    """Unit of the quantity that it compares."""
    third_party: ClassVar[bool] = False
    """Whether it is a third-party condition, whose results are checked."""

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        cls.third_party = not is_built_in(cls)

    def __init__(self, element: model.Element, entities: Sequence[str], rule: str = "any") -> None:
        super().__init__(element)
        self.entities = tuple(entities)
        self.rule = rule
        self.fulfilled: tuple[str, ...] = ()
        """Entities that fulfilled it at the last evaluation."""

    def holds(self, context: ConditionContext) -> bool:
        """Evaluate all entities and combine them by the rule; each is evaluated so that histories are complete."""
        holds_for, view = self._checked_holds_for if self.third_party else self.holds_for, context.view
        fulfilled = []
        for name in self.entities:
            if name in view and holds_for(context, name):
                fulfilled.append(name)
        self.fulfilled = tuple(fulfilled)
        return len(fulfilled) == len(self.entities) if self.rule == "all" else bool(fulfilled)

    def _checked_holds_for(self, context: ConditionContext, entity: str) -> bool:
        held: object = self.holds_for(context, entity)
        return held if held is True or held is False else truth(self, held)

    def explain(self, context: ConditionContext) -> str:
        """Describe the values of the entities that fulfill it; without one, of all entities."""
        names = self.fulfilled or self.entities
        return ", ".join(
            self.explain_for(context, name) if name in context.view else f"{name} is absent" for name in names
        )

    def describe(self) -> str:
        """Describe entities and condition."""
        names = f" {'and' if self.rule == 'all' else 'or'} ".join(self.entities)
        return f"{names}: {self.describe_for()}"

    def measures(self, context: ConditionContext) -> tuple[Measure, ...]:
        """Return the quantities of the present entities."""
        values = [(name, self.quantity(context, name)) for name in self.entities if name in context.view]
        return tuple(Measure(name, value, *self.threshold(), self.unit) for name, value in values if value is not None)

    def quantity(self, context: ConditionContext, entity: str) -> float | None:
        """Return the compared quantity of a present entity; NaN if it is undefined now, None without a quantity."""
        return None

    def threshold(self) -> tuple[model.Rule, float]:
        """Return the rule and the limit of the comparison."""
        element: Any = self.element
        return element.rule, element.value

    @abstractmethod
    def holds_for(self, context: ConditionContext, entity: str) -> bool:
        """Whether a present entity fulfills the condition."""

    @abstractmethod
    def explain_for(self, context: ConditionContext, entity: str) -> str:
        """Describe the condition for an entity with its current values."""

    def describe_for(self) -> str:
        """Describe the condition without values and entities."""
        return type(self.element).__name__


class QuantityCondition(EntityCondition):
    """Condition that compares a quantity of each entity with a limit."""

    def holds_for(self, context: ConditionContext, entity: str) -> bool:
        """Compare the quantity with the limit."""
        rule, limit = self.threshold()
        return satisfies_rule(self.quantity(context, entity), rule, limit)

    def explain_for(self, context: ConditionContext, entity: str) -> str:
        """Describe quantity, limit and their relation, which is the complement of the rule on a falling edge."""
        rule, limit = self.threshold()
        quantity = self.quantity(context, entity)
        if quantity != quantity:
            return f"{entity}: {self.what()} undefined, not {describe_rule(rule)} {limit:g} {self.unit}"
        sign = relation(rule, satisfies_rule(quantity, rule, limit))
        return f"{entity}: {self.what()} {quantity:.2f} {self.unit} {sign} {limit:g} {self.unit}"

    def describe_for(self) -> str:
        """Describe the name of the quantity, the rule and the limit."""
        rule, limit = self.threshold()
        return f"{self.what()} {describe_rule(rule)} {limit:g} {self.unit}"

    def what(self) -> str:
        """Return the name of the quantity."""
        return type(self.element).__name__

    @abstractmethod
    def quantity(self, context: ConditionContext, entity: str) -> float:
        """Return the compared quantity of a present entity; NaN if it is undefined now."""
