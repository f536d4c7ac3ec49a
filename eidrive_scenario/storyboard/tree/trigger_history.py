"""History of a trigger over a run by condition, which explains why it fired, or why it did not."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from eidrive_scenario.openscenario.model import Rule
from eidrive_scenario.storyboard.context.condition import Measure
from eidrive_scenario.storyboard.context.runtime_context import RuntimeContext
from eidrive_scenario.storyboard.tree.trigger import ConditionEvaluator, ConditionGroup, Trigger


@dataclass
class TrueIntervals:
    """Number of time intervals in which a value was true, with the first and the last of them [s]."""

    count: int = 0
    first: tuple[float, float] = (math.nan, math.nan)
    last: tuple[float, float] = (math.nan, math.nan)
    _open: bool = False

    def record(self, is_true: bool, time: float) -> None:
        """Record the value at a time [s]."""
        if is_true:
            begin = self.last[0] if self._open else time
            self.last = (begin, time)
            if not self._open:
                self.count += 1
            if self.count == 1:
                self.first = self.last
        self._open = is_true


@dataclass
class ClosestMiss:
    """Quantity of one entity with the smallest distance to fulfillment, and its time [s]."""

    measure: Measure
    time: float
    gap: float


@dataclass
class ConditionHistory:
    """History of one condition of a trigger over a run.

    asked    number of evaluations, from `first_asked` to `last_asked` [s]
    true     intervals in which it was true, without edge and delay
    edges    intervals of its edge, without delay
    counted  intervals in which it was true with edge and delay
    nearest  closest misses, by entity
    """

    monitor: ConditionEvaluator
    asked: int = 0
    first_asked: float = math.nan
    last_asked: float = math.nan
    true: TrueIntervals = field(default_factory=TrueIntervals)
    edges: TrueIntervals = field(default_factory=TrueIntervals)
    counted: TrueIntervals = field(default_factory=TrueIntervals)
    nearest: dict[str, ClosestMiss] = field(default_factory=dict)
    undefined: set[str] = field(default_factory=set)
    """Entities whose quantity was undefined or infinite at some evaluation."""
    words: str = ""
    """Explanation at the last evaluation if the condition compares no quantity."""
    _before: bool | None = None
    _evaluations: int = 0

    def record(self, context: RuntimeContext) -> None:
        """Record the last evaluation, unless it is recorded already."""
        if self.monitor.evaluations == self._evaluations:
            return
        self._evaluations = self.monitor.evaluations
        time, value = context.time, bool(self.monitor.value)
        if not self.asked:
            self.first_asked = time
        self.asked += 1
        self.last_asked = time
        self.true.record(value, time)
        changed = self._before is not None and self._before != value
        is_edge = self.monitor.edge == "risingOrFalling" or (self.monitor.edge == "rising") == value
        self.edges.record(changed and is_edge, time)
        self.counted.record(self.monitor.result, time)
        self._before = value
        measures = self.monitor.condition.measures(context)
        for measure in measures:
            self._compare(measure, time)
        if not measures:
            self.words = self.monitor.condition.explain(context)

    def _compare(self, measure: Measure, time: float) -> None:
        gap = gap_of(measure)
        if not math.isfinite(gap):
            self.undefined.add(measure.of)
            return
        closest = self.nearest.get(measure.of)
        if closest is None or gap < closest.gap:
            self.nearest[measure.of] = ClosestMiss(measure, time, gap)


def gap_of(measure: Measure) -> float:
    """Return the distance of a quantity to fulfillment of its rule; negative beyond it, NaN if undefined."""
    match measure.rule:
        case Rule.GREATER_THAN | Rule.GREATER_OR_EQUAL:
            return measure.limit - measure.value
        case Rule.LESS_THAN | Rule.LESS_OR_EQUAL:
            return measure.value - measure.limit
        case Rule.EQUAL_TO:
            return abs(measure.value - measure.limit)
    return -abs(measure.value - measure.limit)


@dataclass
class GroupHistory:
    """History of one condition group over a run.

    held     intervals in which all conditions were true
    most     maximum number of conditions that were true at once, first at `most_at` [s]
    missing  conditions that were false at that time
    """

    conditions: tuple[ConditionHistory, ...]
    held: TrueIntervals = field(default_factory=TrueIntervals)
    most: int = -1
    most_at: float = math.nan
    missing: tuple[ConditionHistory, ...] = ()

    def record(self, context: RuntimeContext) -> None:
        """Record an evaluation of the group."""
        for condition in self.conditions:
            condition.record(context)
        missing = tuple(condition for condition in self.conditions if not condition.monitor.result)
        count = len(self.conditions) - len(missing)
        self.held.record(not missing, context.time)
        if count > self.most:
            self.most, self.most_at, self.missing = count, context.time, missing


class TriggerHistory:
    """Observer that records the history of one trigger."""

    def __init__(self, trigger: Trigger) -> None:
        self.trigger = trigger
        self.groups = tuple(_history(group) for group in trigger.groups)
        trigger.observer = self

    def on_evaluated(self, context: RuntimeContext) -> None:
        """Record the values of all conditions."""
        for group in self.groups:
            group.record(context)

    @property
    def asked(self) -> int:
        """Number of evaluations of the trigger."""
        return max((condition.asked for group in self.groups for condition in group.conditions), default=0)


def _history(group: ConditionGroup) -> GroupHistory:
    return GroupHistory(tuple(ConditionHistory(monitor) for monitor in group.monitors))
