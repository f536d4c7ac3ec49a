"""When each element of the storyboard can start at the earliest, and which conditions keep it from ever starting.

The times are lower bounds: what is said to be impossible is so in every run. They are found as a least fixed point:
at first nothing can start, then whatever the triggers allow, until nothing changes any more. What waits for itself,
or for something that comes only after it, is never reached.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from eidrive_scenario.checks.scenario_rules.intervals import (
    ALWAYS,
    NEVER,
    Intervals,
    clip_before,
    falling_edges,
    intersection,
    rising_edges,
    shifted,
    union,
)
from eidrive_scenario.checks.scenario_rules.outline import Node, Outline
from eidrive_scenario.checks.scenario_rules.states import States, asks_for_state
from eidrive_scenario.checks.scenario_rules.truth_intervals import TruthIntervals, truth_intervals
from eidrive_scenario.openscenario.model import Act, Condition, ConditionEdge, ConditionGroup, Storyboard, Trigger
from eidrive_scenario.openscenario.validation.names import CRITERIA

UNOBSERVED_EDGE = "unobserved-edge"


@dataclass(frozen=True)
class ConditionAnalysis:
    """What a trigger can see of one of its conditions, with edge and delay.

    spans   the instants at which it can count as true
    rule    by which rule that is never; "" where it can
    reason  why
    """

    condition: Condition
    spans: Intervals
    rule: str = ""
    reason: str = ""


@dataclass(frozen=True)
class GroupAnalysis:
    """A condition group, its conditions as seen, and when all of them can hold together."""

    group: ConditionGroup
    seen: tuple[ConditionAnalysis, ...]
    spans: Intervals


@dataclass(frozen=True)
class TriggerAnalysis:
    """A trigger at work: whose it is, whether it starts or stops that, and since when it is asked at the earliest."""

    owner: Node
    trigger: Trigger
    starts: bool
    first: float
    groups: tuple[GroupAnalysis, ...]

    @property
    def spans(self) -> Intervals:
        """When it can fire."""
        return union(group.spans for group in self.groups)


class ReachabilityAnalysis:
    """The earliest times of an outline's elements [s]; inf for never."""

    def __init__(self, outline: Outline) -> None:
        self._outline = outline
        self._truths: dict[int, TruthIntervals] = {}
        self._states = States(outline)
        watchers = self._watchers()
        waiting = dict.fromkeys(outline.nodes)
        while waiting:
            node = next(iter(waiting))
            del waiting[node]
            if self._advance(node):
                waiting |= dict.fromkeys((node, *node.children))
                for near in (*node.above(), *node.walk()):
                    waiting |= dict.fromkeys(watchers.get(near, ()))

    @property
    def start(self) -> Mapping[Node, float]:
        """When each element starts at the earliest [s]."""
        return self._states.start

    def _watchers(self) -> Mapping[Node, list[Node]]:
        """By element, whose triggers ask for its state. That depends on what is below it and around it, too."""
        found: dict[Node, list[Node]] = {}
        for node in self._outline.nodes:
            for trigger in (node.start, stop_trigger(node)):
                conditions = [one for group in (trigger.condition_group if trigger else ()) for one in group.condition]
                for asked in dict.fromkeys(asked for one in conditions for asked in self._states.looked_at(one)):
                    found.setdefault(asked, []).append(node)
        return found

    def _advance(self, node: Node) -> bool:
        states = self._states
        stop = stop_trigger(node)
        start = self._earliest(node, node.start, starts=True) if node.start else self._first(node, starts=True)
        stopped = self._earliest(node, stop, starts=False) if stop and node.parent else math.inf
        return states.improve(node, start, stopped)

    def _first(self, node: Node, *, starts: bool) -> float:
        """Since when its trigger is asked: its parent runs, or for a stop trigger it does so itself."""
        if node.parent is None:
            return 0.0
        return self._states.start[node.parent if starts else node]

    def _earliest(self, node: Node, trigger: Trigger, *, starts: bool) -> float:
        first = self._first(node, starts=starts)
        if first == math.inf:
            return first
        spans = union(self._judge(group, node, starts, first).spans for group in trigger.condition_group)
        return spans[0][0] if spans else math.inf

    def watches(self) -> Iterator[TriggerAnalysis]:
        """All triggers that are asked at all."""
        for node in self._outline.nodes:
            for trigger, starts in ((node.start, True), (stop_trigger(node), False)):
                first = self._first(node, starts=starts)
                if trigger is not None and first < math.inf:
                    groups = tuple(self._judge(group, node, starts, first) for group in trigger.condition_group)
                    yield TriggerAnalysis(node, trigger, starts, first, groups)

    def _judge(self, group: ConditionGroup, owner: Node, starts: bool, first: float) -> GroupAnalysis:
        seen = tuple(self._see(condition, owner, starts, first) for condition in group.condition)
        spans = clip_before(ALWAYS, first)
        for one in seen:
            spans = intersection(spans, one.spans)
        return GroupAnalysis(group, seen, spans)

    def _see(self, condition: Condition, owner: Node, starts: bool, first: float) -> ConditionAnalysis:
        known = self._truth(condition, owner, starts)
        spans = clip_before(known.spans, first)
        if not spans:
            if known.rule:
                return ConditionAnalysis(condition, NEVER, known.rule, known.reason)
            return ConditionAnalysis(
                condition, NEVER, "impossible-condition", f"that is over before {owner.title} looks for it"
            )
        edge = condition.condition_edge
        dead = _unseen(known, edge, first)
        if dead:
            return ConditionAnalysis(condition, NEVER, UNOBSERVED_EDGE, dead)
        if known.certain and edge is not ConditionEdge.NONE:
            up = rising_edges(known.spans, first) if edge is not ConditionEdge.FALLING else NEVER
            down = falling_edges(known.spans, first) if edge is not ConditionEdge.RISING else NEVER
            spans = union((up, down))
        return ConditionAnalysis(condition, shifted(spans, condition.delay))

    def _truth(self, condition: Condition, owner: Node, starts: bool) -> TruthIntervals:
        if asks_for_state(condition):
            return self._states.truth(condition, owner, starts)
        known = self._truths.get(id(condition))
        if known is None:
            known = self._truths[id(condition)] = truth_intervals(condition, self._outline)
        return known


def _unseen(known: TruthIntervals, edge: ConditionEdge, first: float) -> str:
    """Why an edge is never seen, "" where it can be."""
    if edge is ConditionEdge.NONE:
        return ""
    if known.steady:
        return known.steady
    if edge is ConditionEdge.RISING and known.risen:
        return known.risen
    if not known.certain:
        return ""
    if edge is not ConditionEdge.FALLING and rising_edges(known.spans, first):
        return ""
    if edge is not ConditionEdge.RISING and falling_edges(known.spans, first):
        return ""
    if edge is ConditionEdge.FALLING:
        return "it never becomes false"
    return "it is already true at the first evaluation" if clip_before(known.spans, first) else "it never becomes true"


def stop_trigger(node: Node) -> Trigger | None:
    """The stop trigger of an element, without the criteria that ScenarioRunner keeps there; None if nothing is left."""
    if not isinstance(node.element, Act | Storyboard) or node.element.stop_trigger is None:
        return None
    kept = []
    for group in node.element.stop_trigger.condition_group:
        conditions = tuple(one for one in group.condition if node.parent or not one.name.startswith(CRITERIA))
        if conditions:
            kept.append(ConditionGroup(condition=conditions, line=group.line, source=group.source))
    return Trigger(condition_group=tuple(kept)) if kept else None
