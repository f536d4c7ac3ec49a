"""When a condition can hold at all, as far as the file says: by time, by constants, by what a quantity can be."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from eidrive_scenario.checks.scenario_rules.intervals import ALWAYS, NEVER, Intervals, compared
from eidrive_scenario.checks.scenario_rules.outline import Outline
from eidrive_scenario.openscenario import model
from eidrive_scenario.openscenario.model import Element, Rule
from eidrive_scenario.openscenario.validation.names import CRITERIA

IMPOSSIBLE, STATE, WAITS = "impossible-condition", "impossible-state", "unreachable"
"""The rules that speak of conditions which never hold."""


@dataclass(frozen=True)
class TruthIntervals:
    """When a condition can hold, its edge and delay left aside.

    spans    it holds at none but these instants [s]
    certain  it holds at all of them
    rule     by which rule it never holds; "" where it can
    reason   why it never holds, or always does
    steady   why it never changes, so that no edge of it is ever seen; "" where it can
    risen    why it never becomes true while somebody looks, though it may become false; "" where it can
    """

    spans: Intervals = ALWAYS
    certain: bool = False
    rule: str = ""
    reason: str = ""
    steady: str = ""
    risen: str = ""


def never(reason: str, rule: str = IMPOSSIBLE) -> TruthIntervals:
    """Of a condition that cannot hold."""
    return TruthIntervals(NEVER, True, rule, reason)


OPEN = TruthIntervals()
"""Of a condition of which the file alone does not say when it holds."""


def truth_intervals(condition: model.Condition, outline: Outline) -> TruthIntervals:
    """When a condition can hold that does not ask for the state of the storyboard."""
    by_entity, by_value = condition.by_entity_condition, condition.by_value_condition
    if by_entity is not None:
        return _of_entities(by_entity, outline)
    leaf = next(iter(by_value.children()), None) if by_value is not None else None
    find = _BY_VALUE.get(type(leaf))
    if find is None or condition.name.startswith(CRITERIA):
        return OPEN
    return find(leaf, outline)


def _time(leaf: model.SimulationTimeCondition, _: Outline) -> TruthIntervals:
    spans = compared(leaf.rule, leaf.value)
    return TruthIntervals(spans, True) if spans else never("the simulation time is never negative")


def _parameter(leaf: model.ParameterCondition, outline: Outline) -> TruthIntervals:
    """A parameter keeps its value, unless an action sets or modifies it; which value that is, the user may say."""
    name = leaf.parameter_ref
    if any(isinstance(one, model.ParameterAction) and one.parameter_ref == name for one in outline.elements):
        return OPEN
    return TruthIntervals(steady=f"no action sets the parameter {name!r}")


def _time_of_day(_: model.TimeOfDayCondition, outline: Outline) -> TruthIntervals:
    if any(isinstance(one, model.TimeOfDay) for one in outline.elements):
        return OPEN
    return never("no EnvironmentAction says what time of day it is")


_BY_VALUE: Mapping[type[Element] | type[None], Callable[[Any, Outline], TruthIntervals]] = {
    model.SimulationTimeCondition: _time,
    model.ParameterCondition: _parameter,
    model.TimeOfDayCondition: _time_of_day,
}


def _of_entities(condition: model.ByEntityCondition, outline: Outline) -> TruthIntervals:
    triggering = condition.triggering_entities
    names = [name for ref in triggering.entity_ref for name in outline.members(ref.entity_ref)]
    absent = [name for name in names if _absent(name, outline)]
    every = triggering.triggering_entities_rule is model.TriggeringEntitiesRule.ALL
    if absent and (every or len(absent) == len(names)):
        return never(f"{absent[0]!r} is never placed in the world")
    leaf = next(iter(condition.entity_condition.children()), None)
    if leaf is None:
        return OPEN
    other = partner(leaf)
    if other is not None and _absent(other, outline):
        return never(f"{other!r} is never placed in the world")
    if other is not None and names and all(name == other for name in names) and isinstance(leaf, _PAIRS):
        return never(f"{other!r} is compared with itself")
    if isinstance(leaf, model.TraveledDistanceCondition) and leaf.value <= 0.0 and set(names) <= outline.at_start:
        return TruthIntervals(steady="no distance at all is traveled at once")
    return _of_quantity(leaf)


def _absent(name: str, outline: Outline) -> bool:
    return name in outline.scenario.entities and name not in outline.placed


def partner(leaf: Element) -> str | None:
    """The other entity of a condition that compares two."""
    if isinstance(leaf, model.TimeToCollisionCondition):
        leaf = leaf.time_to_collision_condition_target
    other = getattr(leaf, "entity_ref", None)
    name = other.entity_ref if isinstance(other, model.EntityRef) else other
    return name if isinstance(name, str) else None


_PAIRS = (
    model.CollisionCondition,
    model.RelativeAngleCondition,
    model.RelativeDistanceCondition,
    model.RelativeSpeedCondition,
    model.TimeHeadwayCondition,
    model.TimeToCollisionCondition,
)
_AMOUNTS: Mapping[type[Element], str] = {
    model.DistanceCondition: "a distance",
    model.RelativeDistanceCondition: "a distance",
    model.TimeHeadwayCondition: "a time headway",
    model.TimeToCollisionCondition: "a time to collision",
    model.AccelerationCondition: "the amount of an acceleration",
}


def _of_quantity(leaf: Element) -> TruthIntervals:
    """Some quantities are never negative."""
    if isinstance(leaf, model.ReachPositionCondition) and leaf.tolerance < 0.0:
        return never("a tolerance below zero is never kept")
    what = _AMOUNTS.get(type(leaf))
    if what is None or getattr(leaf, "direction", None) is not None:
        return OPEN
    rule, value = getattr(leaf, "rule", None), getattr(leaf, "value", 0.0)
    below = rule is Rule.LESS_THAN and value <= 0.0
    if below or (rule in (Rule.LESS_OR_EQUAL, Rule.EQUAL_TO) and value < 0.0):
        return never(f"{what} is never negative")
    return OPEN
