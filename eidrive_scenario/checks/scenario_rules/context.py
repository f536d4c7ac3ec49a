"""Reachability of triggers, and the lint context of the rules without roads."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

from eidrive_scenario.checks.scenario_rules.outline import Node, Outline
from eidrive_scenario.checks.scenario_rules.states import States, is_state_condition
from eidrive_scenario.checks.scenario_rules.truth_intervals import (
    ALWAYS,
    IMPOSSIBLE_CONDITION,
    NEVER,
    UNOBSERVED_EDGE,
    Intervals,
    TruthIntervals,
    clip_before,
    falling_edges,
    intersection,
    rising_edges,
    shift,
    truth_intervals,
    union,
)
from eidrive_scenario.openscenario.conventions import without_criteria
from eidrive_scenario.openscenario.model import Act, Condition, ConditionEdge, ConditionGroup, Storyboard, Trigger


@dataclass(frozen=True)
class ConditionAnalysis:
    """Analysis of one condition of a trigger, with its edge and delay.

    intervals  instants at which the condition can be true
    rule       name of the rule by which it is never true; "" if it can be
    reason     explanation of the rule
    """

    condition: Condition
    intervals: Intervals
    rule: str = ""
    reason: str = ""


@dataclass(frozen=True)
class GroupAnalysis:
    """Analysis of a condition group: its conditions, and the instants at which all of them can be true."""

    group: ConditionGroup
    conditions: tuple[ConditionAnalysis, ...]
    intervals: Intervals


@dataclass(frozen=True)
class TriggerAnalysis:
    """Analysis of a trigger.

    owner   element that the trigger starts or stops
    starts  True for a start trigger, False for a stop trigger
    """

    owner: Node
    starts: bool
    groups: tuple[GroupAnalysis, ...]

    @property
    def intervals(self) -> Intervals:
        """Return the instants at which the trigger can be fulfilled."""
        return union(group.intervals for group in self.groups)


class ReachabilityAnalysis:
    """Earliest start times of the elements of an outline [s]; inf for never."""

    def __init__(self, outline: Outline) -> None:
        self._outline = outline
        self._truths: dict[int, TruthIntervals] = {}
        self._states = States(outline)
        dependents = self._dependents()
        pending = dict.fromkeys(outline.nodes)
        while pending:
            node = next(iter(pending))
            del pending[node]
            if self._advance(node):
                pending |= dict.fromkeys((node, *node.children))
                for related in (*node.above(), *node.walk()):
                    pending |= dict.fromkeys(dependents.get(related, ()))

    @property
    def start(self) -> Mapping[Node, float]:
        """Return the earliest start of each element [s]."""
        return self._states.start

    def _dependents(self) -> Mapping[Node, list[Node]]:
        """Return, by element, the elements whose triggers depend on its state.

        The state also depends on the ancestors and descendants of the element.
        """
        dependents: dict[Node, list[Node]] = {}
        for node in self._outline.nodes:
            for trigger in (node.start, stop_trigger(node)):
                groups = trigger.condition_group if trigger else ()
                conditions = [condition for group in groups for condition in group.condition]
                others = [other for condition in conditions for other in self._states.dependencies(condition)]
                for other in dict.fromkeys(others):
                    dependents.setdefault(other, []).append(node)
        return dependents

    def _advance(self, node: Node) -> bool:
        states = self._states
        stop = stop_trigger(node)
        start = self._earliest(node, node.start, starts=True) if node.start else self._first_time(node, starts=True)
        stopped = self._earliest(node, stop, starts=False) if stop and node.parent else math.inf
        return states.improve(node, start, stopped)

    def _first_time(self, node: Node, *, starts: bool) -> float:
        """Return the earliest evaluation of a start trigger (start of the parent) or stop trigger (own start) [s]."""
        if node.parent is None:
            return 0.0
        return self._states.start[node.parent if starts else node]

    def _earliest(self, node: Node, trigger: Trigger, *, starts: bool) -> float:
        first = self._first_time(node, starts=starts)
        if first == math.inf:
            return first
        intervals = union(self._analyze(group, node, starts, first).intervals for group in trigger.condition_group)
        return intervals[0][0] if intervals else math.inf

    def triggers(self) -> Iterator[TriggerAnalysis]:
        """Yield the analyses of all triggers that are evaluated at some time."""
        for node in self._outline.nodes:
            for trigger, starts in ((node.start, True), (stop_trigger(node), False)):
                first = self._first_time(node, starts=starts)
                if trigger is not None and first < math.inf:
                    groups = tuple(self._analyze(group, node, starts, first) for group in trigger.condition_group)
                    yield TriggerAnalysis(node, starts, groups)

    def _analyze(self, group: ConditionGroup, owner: Node, starts: bool, first: float) -> GroupAnalysis:
        conditions = tuple(self._analyze_condition(condition, owner, starts, first) for condition in group.condition)
        intervals = clip_before(ALWAYS, first)
        for condition in conditions:
            intervals = intersection(intervals, condition.intervals)
        return GroupAnalysis(group, conditions, intervals)

    def _analyze_condition(self, condition: Condition, owner: Node, starts: bool, first: float) -> ConditionAnalysis:
        truth = self._truth(condition, owner, starts)
        intervals = clip_before(truth.intervals, first)
        if not intervals:
            if truth.rule:
                return ConditionAnalysis(condition, NEVER, truth.rule, truth.reason)
            reason = f"it holds only before the first evaluation by {owner.title}"
            return ConditionAnalysis(condition, NEVER, IMPOSSIBLE_CONDITION, reason)
        edge = condition.condition_edge
        reason = _unobserved_reason(truth, edge, first)
        if reason:
            return ConditionAnalysis(condition, NEVER, UNOBSERVED_EDGE, reason)
        if truth.certain and edge is not ConditionEdge.NONE:
            rising = rising_edges(truth.intervals, first) if edge is not ConditionEdge.FALLING else NEVER
            falling = falling_edges(truth.intervals, first) if edge is not ConditionEdge.RISING else NEVER
            intervals = union((rising, falling))
        return ConditionAnalysis(condition, shift(intervals, condition.delay))

    def _truth(self, condition: Condition, owner: Node, starts: bool) -> TruthIntervals:
        if is_state_condition(condition):
            return self._states.truth(condition, owner, starts)
        truth = self._truths.get(id(condition))
        if truth is None:
            truth = self._truths[id(condition)] = truth_intervals(condition, self._outline)
        return truth


def _unobserved_reason(truth: TruthIntervals, edge: ConditionEdge, first: float) -> str:
    """Return why an edge is never observed; "" if it can be."""
    if edge is ConditionEdge.NONE:
        return ""
    if truth.steady:
        return truth.steady
    if edge is ConditionEdge.RISING and truth.risen:
        return truth.risen
    if not truth.certain:
        return ""
    if edge is not ConditionEdge.FALLING and rising_edges(truth.intervals, first):
        return ""
    if edge is not ConditionEdge.RISING and falling_edges(truth.intervals, first):
        return ""
    if edge is ConditionEdge.FALLING:
        return "it never becomes false"
    return (
        "it is already true at the first evaluation" if clip_before(truth.intervals, first) else "it never becomes true"
    )


def stop_trigger(node: Node) -> Trigger | None:
    """Return the stop trigger of an element without the criteria of ScenarioRunner; None if no condition remains."""
    if not isinstance(node.element, Act | Storyboard) or node.element.stop_trigger is None:
        return None
    trigger = node.element.stop_trigger
    if isinstance(node.element, Storyboard):
        trigger = without_criteria(trigger)
    return trigger if trigger.condition_group else None


class LintContext(Outline):
    """Outline of a scenario and the analysis of its triggers."""

    @cached_property
    def triggers(self) -> tuple[TriggerAnalysis, ...]:
        """Return the analyses of all triggers that are evaluated at some time."""
        return tuple(ReachabilityAnalysis(self).triggers())
