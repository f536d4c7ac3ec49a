"""Intervals in which a condition can hold by the file alone: from times, constants and ranges of quantities."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from eidrive_scenario.base.tolerances import EPSILON
from eidrive_scenario.checks.scenario_rules.outline import Outline
from eidrive_scenario.openscenario import model
from eidrive_scenario.openscenario.conventions import is_criterion
from eidrive_scenario.openscenario.model import Element, Rule
from eidrive_scenario.openscenario.values.parameters import satisfies_rule

Intervals = tuple[tuple[float, float], ...]

NEVER: Intervals = ()
ALWAYS: Intervals = ((0.0, math.inf),)
STEP = 0.25
"""Assumed upper bound of the time step [s], five default steps: an edge is observed at the first tick after it."""


def times_that_satisfy(rule: Rule, value: float) -> Intervals:
    """Return the instants at which the simulation time satisfies a rule."""
    intervals = {
        Rule.GREATER_THAN: ((value + EPSILON, math.inf),),
        Rule.GREATER_OR_EQUAL: ((value - EPSILON, math.inf),),
        Rule.LESS_THAN: ((-math.inf, value - EPSILON),),
        Rule.LESS_OR_EQUAL: ((-math.inf, value + EPSILON),),
        Rule.EQUAL_TO: ((value - EPSILON, value + EPSILON),),
        Rule.NOT_EQUAL_TO: ((-math.inf, value - EPSILON), (value + EPSILON, math.inf)),
    }[rule]
    return clip_before(intervals, 0.0)


def clip_before(intervals: Intervals, first: float) -> Intervals:
    """Remove all instants before `first`."""
    return tuple((max(low, first), high) for low, high in intervals if high >= first)


def intersection(first: Intervals, second: Intervals) -> Intervals:
    """Return the instants that are in both."""
    overlaps = ((max(a, c), min(b, d)) for a, b in first for c, d in second)
    return tuple(sorted((low, high) for low, high in overlaps if low <= high))


def union(several: Iterable[Intervals]) -> Intervals:
    """Return the instants that are in at least one of them."""
    merged: list[tuple[float, float]] = []
    for low, high in sorted(interval for intervals in several for interval in intervals):
        if merged and low <= merged[-1][1]:
            merged[-1] = (merged[-1][0], max(high, merged[-1][1]))
        else:
            merged.append((low, high))
    return tuple(merged)


def shift(intervals: Intervals, delay: float) -> Intervals:
    """Shift all instants by a delay [s]."""
    return tuple((low + delay, high + delay) for low, high in intervals) if delay > 0.0 else intervals


def rising_edges(intervals: Intervals, first: float) -> Intervals:
    """Return when evaluations from `first` on observe a rising edge of a condition that is true in `intervals`."""
    return tuple((low, low + STEP) for low, _ in intervals if low > first)


def falling_edges(intervals: Intervals, first: float) -> Intervals:
    """Return when evaluations from `first` on observe a falling edge of a condition that is true in `intervals`."""
    return tuple((high, high + STEP) for _, high in intervals if first <= high < math.inf)


def format_intervals(intervals: Intervals) -> str:
    """Describe the first and the last instant."""
    if not intervals:
        return "never"
    low, high = round(intervals[0][0], 3), intervals[-1][1]
    if high == math.inf:
        return f"from {low:g} s on" if low > 0.0 else "at any time"
    if high - low <= STEP + 2 * EPSILON:
        return f"at {low:g} s"
    return f"until {round(high, 3):g} s" if low <= 0.0 else f"from {low:g} s to {round(high, 3):g} s"


IMPOSSIBLE_CONDITION = "impossible-condition"
IMPOSSIBLE_STATE = "impossible-state"
UNREACHABLE = "unreachable"
UNOBSERVED_EDGE = "unobserved-edge"
"""Names of the rules about conditions that are never true."""


@dataclass(frozen=True)
class TruthIntervals:
    """Intervals in which a condition can hold, without its edge and delay.

    intervals  instants outside of which it never holds [s]
    certain    whether it holds at all of these instants
    rule       name of the rule by which it never holds; "" if it can
    reason     why it never holds, or always does
    steady     why it never changes, so that no edge is observed; "" if it can
    risen      why it never becomes true during evaluations, although it may become false; "" if it can
    """

    intervals: Intervals = ALWAYS
    certain: bool = False
    rule: str = ""
    reason: str = ""
    steady: str = ""
    risen: str = ""


def never(reason: str, rule: str = IMPOSSIBLE_CONDITION) -> TruthIntervals:
    """Return the result for a condition that cannot hold."""
    return TruthIntervals(NEVER, True, rule, reason)


OPEN = TruthIntervals()
"""Result for a condition that may hold at any time, as far as the file determines it."""


def truth_intervals(condition: model.Condition, outline: Outline) -> TruthIntervals:
    """Return the intervals in which a condition can hold that does not depend on storyboard states."""
    if condition.by_entity_condition is not None:
        return _of_entities(condition.by_entity_condition, outline)
    if condition.by_value_condition is None or is_criterion(condition):
        return OPEN
    match next(iter(condition.by_value_condition.children()), None):
        case model.SimulationTimeCondition(rule=rule, value=value):
            intervals = times_that_satisfy(rule, value)
            return TruthIntervals(intervals, True) if intervals else never("the simulation time is never negative")
        case model.ParameterCondition(parameter_ref=name) if not _sets_parameter(outline, name):
            # Steady, but not certain: the user may choose the constant value
            return TruthIntervals(steady=f"no action sets the parameter {name!r}")
        case model.TimeOfDayCondition() if next(outline.of(model.TimeOfDay), None) is None:
            return never("no EnvironmentAction sets the time of day")
    return OPEN


def _sets_parameter(outline: Outline, name: str) -> bool:
    return any(action.parameter_ref == name for action in outline.of(model.ParameterAction))


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
    other = compared_entity(leaf)
    if other is not None and _absent(other, outline):
        return never(f"{other!r} is never placed in the world")
    if other is not None and names and all(name == other for name in names) and isinstance(leaf, _PAIRS):
        reason = f"{other!r} is compared with itself"
        return TruthIntervals(steady=reason) if _holds_for_zero(leaf) else never(reason)
    if isinstance(leaf, model.TraveledDistanceCondition) and leaf.value <= 0.0 and set(names) <= outline.at_start:
        return TruthIntervals(steady="a traveled distance of 0 is always reached")
    return _of_quantity(leaf)


def _holds_for_zero(leaf: Element) -> bool:
    """Whether a condition holds for two entities without a distance, speed difference and angle between them."""
    if isinstance(leaf, model.RelativeAngleCondition):
        return abs(leaf.angle) <= leaf.angle_tolerance
    if isinstance(leaf, model.RelativeDistanceCondition | model.RelativeSpeedCondition | model.TimeHeadwayCondition):
        return satisfies_rule(0.0, leaf.rule, leaf.value)
    return False


def _absent(name: str, outline: Outline) -> bool:
    return name in outline.scenario.entities and name not in outline.placed


def compared_entity(leaf: Element) -> str | None:
    """Return the other entity of a condition that compares two entities."""
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
_NONNEGATIVE: Mapping[type[Element], str] = {
    model.DistanceCondition: "a distance",
    model.RelativeDistanceCondition: "a distance",
    model.TimeHeadwayCondition: "a time headway",
    model.TimeToCollisionCondition: "a time to collision",
    model.AccelerationCondition: "the absolute value of an acceleration",
}


def _of_quantity(leaf: Element) -> TruthIntervals:
    """Return the intervals of a condition on a quantity that may be nonnegative by definition."""
    if isinstance(leaf, model.ReachPositionCondition) and leaf.tolerance < 0.0:
        return never("its tolerance is negative")
    quantity = _NONNEGATIVE.get(type(leaf))
    if quantity is None or getattr(leaf, "direction", None) is not None:
        return OPEN
    rule, value = getattr(leaf, "rule", None), getattr(leaf, "value", 0.0)
    below = rule is Rule.LESS_THAN and value <= 0.0
    if below or (rule in (Rule.LESS_OR_EQUAL, Rule.EQUAL_TO) and value < 0.0):
        return never(f"{quantity} is never negative")
    return OPEN
