"""Triggers: disjunction of condition groups, conjunction of the conditions of a group; edges and delays."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

import py_trees
from py_trees.common import Status

from eidrive_scenario.base.tolerances import EPSILON
from eidrive_scenario.errors import InvalidResult
from eidrive_scenario.extensions.registry import is_built_in
from eidrive_scenario.openscenario.model import Rule
from eidrive_scenario.storyboard.context.condition import Condition, Measure, truth
from eidrive_scenario.storyboard.context.runtime_context import RuntimeContext


class ConditionEvaluator:
    """Evaluation of a condition with its edge and delay.

    An edge requires a previous value, so that the first evaluation has none. It lasts until the end of its tick, so
    that it coincides with other conditions that are fulfilled at that instant. With a delay, the result at t is that of
    the edge at t - delay; before the first evaluation it is false.
    """

    def __init__(self, condition: Condition, *, name: str = "", edge: str = "none", delay: float = 0.0) -> None:
        self.condition = condition
        self.name = name
        self.edge = edge
        self.delay = delay
        self._is_plain = edge == "none" and delay <= 0.0
        """Whether the result is the value of the condition."""
        self.evaluations = 0
        """Number of evaluations of the condition."""
        self.reset()

    def reset(self) -> None:
        """Discard all evaluations."""
        self.value: bool | None = None
        """Last value of the condition without edge and delay; None before the first evaluation."""
        self.result = False
        """Last result with edge and delay."""
        self.triggering: tuple[str, ...] = ()
        """Entities of a true result: those that fulfill the condition; on a falling edge, those that did before."""
        self._fulfilled: tuple[str, ...] = ()
        self._evaluated_at: int | None = None
        self._edge_in_tick = False
        self._recorded = False
        self._history: deque[tuple[float, bool, str, tuple[str, ...]]] = deque()
        self._delayed: tuple[bool, str] = (False, "")

    def evaluate(self, context: RuntimeContext) -> bool:
        """Evaluate the condition with edge and delay; repeatedly within a tick only if its value can change."""
        tick, condition = context.progress.tick, self.condition
        is_repeated = self._evaluated_at == tick
        if is_repeated and not condition.instant:
            return self.result
        self._evaluated_at = tick
        self.evaluations += 1
        held: object = condition.holds(context)
        result = held if held is True or held is False else truth(condition, held)
        if self._is_plain:
            self.value = self.result = result
            if result:
                self.triggering = getattr(condition, "fulfilled", ())
            return result
        if self.edge == "none":
            self.value = result
        else:
            result = self._apply_edge(result)
            if is_repeated and self._edge_in_tick:
                return self.result
            self._edge_in_tick = result
        before, self._fulfilled = self._fulfilled, getattr(condition, "fulfilled", ())
        entities = self._fulfilled if self.value else before
        if self.delay <= 0.0:
            self.result, self.triggering = result, entities
        else:
            self.result = self._apply_delay(context, result, entities)
        return self.result

    @property
    def is_delaying(self) -> bool:
        """Whether a true result is delayed now, or has become true by a delay."""
        return self._recorded or bool(self._history)

    def _apply_delay(self, context: RuntimeContext, result: bool, entities: tuple[str, ...]) -> bool:
        """Return the delayed result; true ones are stored with the explanation at their instant."""
        if result or self._recorded:
            self._recorded = result
            self._history.append((context.time, result, self._explain(context) if result else "", entities))
        while self._history and self._history[0][0] <= context.time - self.delay + EPSILON:
            _, value, text, self.triggering = self._history.popleft()
            self._delayed = (value, text)
        return self._delayed[0]

    def _explain(self, context: RuntimeContext) -> str:
        """Return the explanation of the condition with its current values."""
        text: object = self.condition.explain(context)
        if not isinstance(text, str):
            raise InvalidResult(self.condition, "explain", f"returned {text!r} (expected str)")
        return text if self.value or self.edge == "none" else f"{text} (falling edge)"

    def _apply_edge(self, value: bool) -> bool:
        before, self.value = self.value, value
        if before is None or before == value:
            return False
        return self.edge == "risingOrFalling" or (self.edge == "rising") == value

    def why(self, context: RuntimeContext) -> str:
        """Describe the true condition with the values at its instant; valid after a true result."""
        if self.delay <= 0.0:
            return self._explain(context)
        return f"{self._delayed[1]}, {self.delay:g} s ago"

    def describe(self) -> str:
        """Describe the condition with edge and delay."""
        edge = {"none": "", "rising": " becomes true", "falling": " becomes false", "risingOrFalling": " changes"}
        delay = f", {self.delay:g} s later" if self.delay > 0.0 else ""
        return f"{self.condition.describe()}{edge[self.edge]}{delay}"


@dataclass(frozen=True)
class ConditionGroup:
    """Conjunction of conditions at one instant."""

    evaluators: tuple[ConditionEvaluator, ...]

    def evaluate(self, context: RuntimeContext) -> bool:
        """Whether all conditions are true. Each is evaluated, as edges and delays depend on earlier values."""
        holds = bool(self.evaluators)
        for evaluator in self.evaluators:
            holds = evaluator.evaluate(context) and holds
        return holds


class Trigger:
    """Disjunction of condition groups.

    It need not be evaluated while nothing changes that its conditions read: the motion of entities, the states of
    elements, and the time that a condition awaits. As it did not fire at the last evaluation, it does not fire then.

    reads        motion that can let it fire
    version      number of state changes of elements before the last evaluation; inf if it reads no values that change
                 within a tick, so that one evaluation per tick suffices
    rests_until  time [s] before which a change of motion or states is required to let it fire
    """

    def __init__(self, groups: Sequence[ConditionGroup]) -> None:
        self.groups = tuple(groups)
        self._evaluators = tuple(evaluator for group in self.groups for evaluator in group.evaluators)
        reads = [evaluator.condition.reads for evaluator in self._evaluators]
        are_built_in = all(is_built_in(type(evaluator.condition)) for evaluator in self._evaluators)
        self._can_rest = are_built_in and None not in reads
        self.reads = frozenset(name for names in reads if names for name in names)
        self._is_instant = any(evaluator.condition.instant for evaluator in self._evaluators)
        self.version: float = -1
        self.rests_until = -math.inf
        self.why = ""
        self.observer: TriggerHistory | None = None
        self.triggering: tuple[str, ...] = ()
        """Entities that fulfilled the conditions of the groups that fired."""

    def __bool__(self) -> bool:
        return bool(self.groups)

    def evaluate(self, context: RuntimeContext) -> bool:
        """Whether the trigger fires; `why` then describes the reason."""
        fired = [group for group in self.groups if group.evaluate(context)]
        if fired:
            self.why = " and ".join(evaluator.why(context) for evaluator in fired[0].evaluators)
            names = [name for group in fired for evaluator in group.evaluators for name in evaluator.triggering]
            self.triggering = tuple(dict.fromkeys(names))
        if self.observer is not None:
            self.observer.on_evaluated(context)
        version, self.rests_until = context.progress.version, -math.inf
        # After a change it is evaluated twice, so that edges are over.
        if self._can_rest and version <= self.version and not fired and context.moved.isdisjoint(self.reads):
            self.rests_until = self._next_evaluation(context)
        self.version = version if self._is_instant else math.inf
        return bool(fired)

    def _next_evaluation(self, context: RuntimeContext) -> float:
        if self.observer is not None or any([evaluator.is_delaying for evaluator in self._evaluators]):
            return -math.inf
        return min([evaluator.condition.constant_until(context) for evaluator in self._evaluators], default=math.inf)

    def reset(self) -> None:
        """Discard all evaluations."""
        self.version = -1
        for evaluator in self._evaluators:
            evaluator.reset()

    def describe(self) -> str:
        """Describe the trigger."""
        return " or ".join(
            " and ".join(evaluator.describe() for evaluator in group.evaluators) for group in self.groups
        )


class WaitForTrigger(py_trees.behaviour.Behaviour):
    """Leaf of the tree that runs until its trigger fires."""

    def __init__(self, name: str, trigger: Trigger, context: RuntimeContext) -> None:
        super().__init__(name)
        self.trigger = trigger
        self.context = context

    def initialise(self) -> None:
        """Reset the trigger before another execution."""
        if self.status is Status.INVALID:
            self.trigger.reset()

    def update(self) -> Status:
        """Evaluate the trigger."""
        return Status.SUCCESS if self.trigger.evaluate(self.context) else Status.RUNNING

    def is_fired(self) -> bool:
        """Tick without the generator of `tick_once`, as triggers are evaluated in every tick; True if it fires."""
        if self.status is Status.INVALID:
            self.trigger.reset()
        is_fired = self.trigger.evaluate(self.context)
        self.status = Status.SUCCESS if is_fired else Status.RUNNING
        return is_fired


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

    evaluator: ConditionEvaluator
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
        if self.evaluator.evaluations == self._evaluations:
            return
        self._evaluations = self.evaluator.evaluations
        time, value = context.time, bool(self.evaluator.value)
        if not self.asked:
            self.first_asked = time
        self.asked += 1
        self.last_asked = time
        self.true.record(value, time)
        changed = self._before is not None and self._before != value
        is_edge = self.evaluator.edge == "risingOrFalling" or (self.evaluator.edge == "rising") == value
        self.edges.record(changed and is_edge, time)
        self.counted.record(self.evaluator.result, time)
        self._before = value
        measures = self.evaluator.condition.measures(context)
        for measure in measures:
            gap, closest = gap_of(measure), self.nearest.get(measure.of)
            if not math.isfinite(gap):
                self.undefined.add(measure.of)
            elif closest is None or gap < closest.gap:
                self.nearest[measure.of] = ClosestMiss(measure, time, gap)
        if not measures:
            self.words = self.evaluator.condition.explain(context)


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
        missing = tuple(condition for condition in self.conditions if not condition.evaluator.result)
        count = len(self.conditions) - len(missing)
        self.held.record(not missing, context.time)
        if count > self.most:
            self.most, self.most_at, self.missing = count, context.time, missing


class TriggerHistory:
    """Observer that records the history of one trigger."""

    def __init__(self, trigger: Trigger) -> None:
        self.trigger = trigger
        self.groups = tuple(
            GroupHistory(tuple(ConditionHistory(evaluator) for evaluator in group.evaluators))
            for group in trigger.groups
        )
        trigger.observer = self

    def on_evaluated(self, context: RuntimeContext) -> None:
        """Record the values of all conditions."""
        for group in self.groups:
            group.record(context)

    @property
    def asked(self) -> int:
        """Number of evaluations of the trigger."""
        return max((condition.asked for group in self.groups for condition in group.conditions), default=0)
