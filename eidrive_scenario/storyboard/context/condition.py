"""The seam of conditions: a Condition is a predicate over the stage, true or false at one instant."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, ClassVar, NamedTuple

import numpy as np

from eidrive_scenario.errors import InvalidResult
from eidrive_scenario.openscenario import model
from eidrive_scenario.registry import is_built_in
from eidrive_scenario.storyboard.context.protocols import ConditionContext
from eidrive_scenario.tolerances import EPSILON

WORDS = {
    "greaterThan": ">",
    "greaterOrEqual": "≥",
    "lessThan": "<",
    "lessOrEqual": "≤",
    "equalTo": "=",
    "notEqualTo": "≠",
}

COMPLEMENTS = {">": "≤", "≥": "<", "<": "≥", "≤": ">", "=": "≠", "≠": "="}
"""By sign, the one that holds where it does not."""


def satisfies_rule(value: float, rule: model.Rule, limit: float) -> bool:
    """`value` against `limit` by a Rule of the standard; NaN compares to nothing."""
    if value != value:
        return False
    match rule.value:
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


def describe_rule(rule: model.Rule) -> str:
    """A Rule as the sign that one would write."""
    return WORDS[rule.value]


def relation(rule: model.Rule, holds: bool) -> str:
    """Return the sign that holds between a value and its limit: that of the rule, or its complement."""
    sign = WORDS[rule.value]
    return sign if holds else COMPLEMENTS[sign]


class Measure(NamedTuple):
    """What a condition compares at one instant; `of` is the entity, "" where it is about none."""

    of: str
    value: float
    rule: model.Rule
    limit: float
    unit: str


class Condition(ABC):
    """A predicate over the stage. Edges and delays are the Trigger's, not its own."""

    instant: ClassVar[bool] = False
    """True where what it looks at can change at one instant, as elements start and end and actions set values: it is
    then asked again after such a change. All others are asked once per tick."""

    def __init__(self, element: model.Element) -> None:
        self.element = element

    def bind(self, context: ConditionContext) -> None:  # noqa: B027 - most refer to nothing
        """Look up what the element refers to, once, before the first tick. Raises ScenarioError."""

    @abstractmethod
    def holds(self, context: ConditionContext) -> bool:
        """True where the condition holds now."""

    @abstractmethod
    def explain(self, context: ConditionContext) -> str:
        """The condition in words, with the values of now."""

    def describe(self) -> str:
        """The condition in words, without values."""
        return type(self.element).__name__

    def measures(self, context: ConditionContext) -> tuple[Measure, ...]:
        """The quantities that it compares now, if it compares any."""
        return ()


def truth(condition: Condition, held: object) -> bool:
    """Return the result of a condition as bool. Raise InvalidResult if it is none, as None and NaN are."""
    if isinstance(held, bool | np.bool_):
        return bool(held)
    raise InvalidResult(condition, "the condition", f"returned {held!r} (expected True or False)")


class EntityCondition(Condition):
    """A condition on each of several triggering entities, joined by `any` or `all`.

    An entity that is not in the world fulfils nothing.
    """

    unit: ClassVar[str] = ""
    """Of the quantity that it compares."""
    third_party: ClassVar[bool] = False
    """Whether it is no part of this project: what it returns for each entity is then checked."""

    def __init_subclass__(cls, **named: Any) -> None:
        super().__init_subclass__(**named)
        cls.third_party = not is_built_in(cls)

    def __init__(self, element: model.Element, entities: Sequence[str], rule: str = "any") -> None:
        super().__init__(element)
        self.entities = tuple(entities)
        self.rule = rule
        self.fulfilled: tuple[str, ...] = ()
        """The entities that fulfilled it when it was last asked."""

    def holds(self, context: ConditionContext) -> bool:
        """The rule over the entities; every one of them is asked each time, so that their histories stay whole."""
        holds_for, view = self._checked_holds_for if self.third_party else self.holds_for, context.view
        self.fulfilled = tuple([name for name in self.entities if name in view and holds_for(context, name)])
        return len(self.fulfilled) == len(self.entities) if self.rule == "all" else bool(self.fulfilled)

    def _checked_holds_for(self, context: ConditionContext, entity: str) -> bool:
        held: object = self.holds_for(context, entity)
        return held if held is True or held is False else truth(self, held)

    def explain(self, context: ConditionContext) -> str:
        """What is true of those that fulfill it, or of all."""
        names = self.fulfilled or self.entities
        return ", ".join(
            self.explain_for(context, name) if name in context.view else f"{name} is not in the world" for name in names
        )

    def describe(self) -> str:
        """Whom it is about, and what."""
        joined = f" {'and' if self.rule == 'all' else 'or'} ".join(self.entities)
        return f"{joined}: {self.describe_for()}"

    def measures(self, context: ConditionContext) -> tuple[Measure, ...]:
        """The quantity of each entity that is in the world."""
        found = [(name, self.quantity(context, name)) for name in self.entities if name in context.view]
        return tuple(Measure(name, value, *self.threshold(), self.unit) for name, value in found if value is not None)

    def quantity(self, context: ConditionContext, entity: str) -> float | None:
        """What it compares for this entity, which is in the world; NaN where that is undefined now, None if nothing."""
        return None

    def threshold(self) -> tuple[model.Rule, float]:
        """How the quantity is compared, and with what."""
        element: Any = self.element
        return element.rule, element.value

    @abstractmethod
    def holds_for(self, context: ConditionContext, entity: str) -> bool:
        """True where the condition holds for this entity, which is in the world."""

    @abstractmethod
    def explain_for(self, context: ConditionContext, entity: str) -> str:
        """The condition in words for this entity, with the values of now."""

    def describe_for(self) -> str:
        """The condition in words, without values."""
        return type(self.element).__name__


class QuantityCondition(EntityCondition):
    """A condition that compares a quantity of each entity with a limit."""

    def holds_for(self, context: ConditionContext, entity: str) -> bool:
        """Compare it."""
        rule, limit = self.threshold()
        return satisfies_rule(self.quantity(context, entity), rule, limit)

    def explain_for(self, context: ConditionContext, entity: str) -> str:
        """The quantity, the limit, and how they compare; on a falling edge that is not what the rule asks for."""
        rule, limit = self.threshold()
        quantity = self.quantity(context, entity)
        if quantity != quantity:
            return f"{entity}: {self.what()} undefined, not {describe_rule(rule)} {limit:g} {self.unit}"
        sign = relation(rule, satisfies_rule(quantity, rule, limit))
        return f"{entity}: {self.what()} {quantity:.2f} {self.unit} {sign} {limit:g} {self.unit}"

    def describe_for(self) -> str:
        """The quantity by its name, the rule and the limit."""
        rule, limit = self.threshold()
        return f"{self.what()} {describe_rule(rule)} {limit:g} {self.unit}"

    def what(self) -> str:
        """What the quantity is called."""
        return type(self.element).__name__

    @abstractmethod
    def quantity(self, context: ConditionContext, entity: str) -> float:
        """What it compares for this entity, which is in the world; NaN where that is undefined now."""
