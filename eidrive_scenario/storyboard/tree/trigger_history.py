"""What a trigger saw over a run, condition by condition: so that one can say afterwards why it fired, or why not."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from eidrive_scenario.openscenario.model import Rule
from eidrive_scenario.storyboard.context.condition import Measure
from eidrive_scenario.storyboard.context.runtime_context import RuntimeContext
from eidrive_scenario.storyboard.tree.trigger import ConditionEvaluator, ConditionGroup, Trigger


@dataclass
class TrueIntervals:
    """Spans of time in which something went on: how many, and the first and the last of them [s]."""

    count: int = 0
    first: tuple[float, float] = (math.nan, math.nan)
    last: tuple[float, float] = (math.nan, math.nan)
    _open: bool = False

    def record(self, going_on: bool, time: float) -> None:
        """It goes on at this time, or it does not."""
        if going_on:
            begin = self.last[0] if self._open else time
            self.last = (begin, time)
            if not self._open:
                self.count += 1
            if self.count == 1:
                self.first = self.last
        self._open = going_on


@dataclass
class ClosestMiss:
    """The quantity of one entity when it was nearest to being right, and when that was [s]."""

    measure: Measure
    time: float
    gap: float


@dataclass
class ConditionHistory:
    """One condition of a trigger over a run.

    true     when it was true, edge and delay left aside
    edges    when its edge was seen, the delay left aside
    counted  when it counted as true
    nearest  by entity, what it compared when that was nearest to being right
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
    """The condition with its values at the last evaluation, where it compares no number."""
    _before: bool | None = None
    _evaluations: int = 0

    def record(self, context: RuntimeContext) -> None:
        """The condition has just been asked, unless it was not asked anew."""
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
        wanted = self.monitor.edge == "risingOrFalling" or (self.monitor.edge == "rising") == value
        self.edges.record(changed and wanted, time)
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
        known = self.nearest.get(measure.of)
        if known is None or gap < known.gap:
            self.nearest[measure.of] = ClosestMiss(measure, time, gap)


def gap_of(measure: Measure) -> float:
    """How far a quantity is from what its rule asks for; negative where it is fulfilled and more, NaN if undefined."""
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
    """One condition group over a run.

    held  when all its conditions counted as true
    most  how many of them did at once at most, when first, and which were missing then
    """

    conditions: tuple[ConditionHistory, ...]
    held: TrueIntervals = field(default_factory=TrueIntervals)
    most: int = -1
    most_at: float = math.nan
    missing: tuple[ConditionHistory, ...] = ()

    def record(self, context: RuntimeContext) -> None:
        """The group has just been asked."""
        for condition in self.conditions:
            condition.record(context)
        missing = tuple(condition for condition in self.conditions if not condition.monitor.result)
        count = len(self.conditions) - len(missing)
        self.held.record(not missing, context.time)
        if count > self.most:
            self.most, self.most_at, self.missing = count, context.time, missing


class TriggerHistory:
    """A witness of one trigger."""

    def __init__(self, trigger: Trigger) -> None:
        self.trigger = trigger
        self.groups = tuple(_history(group) for group in trigger.groups)
        trigger.witness = self

    def on_evaluated(self, context: RuntimeContext) -> None:
        """Note what each condition was."""
        for group in self.groups:
            group.record(context)

    @property
    def asked(self) -> int:
        """How often the trigger was asked."""
        return max((condition.asked for group in self.groups for condition in group.conditions), default=0)


def _history(group: ConditionGroup) -> GroupHistory:
    return GroupHistory(tuple(ConditionHistory(monitor) for monitor in group.monitors))
