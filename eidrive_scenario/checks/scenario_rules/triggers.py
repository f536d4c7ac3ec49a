"""Rules on triggers: what can never fire, what is likely to be missed."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from eidrive_scenario.checks.rule import at
from eidrive_scenario.checks.scenario_rules.context import LintContext
from eidrive_scenario.checks.scenario_rules.intervals import format_intervals
from eidrive_scenario.checks.scenario_rules.reachability import UNOBSERVED_EDGE, ConditionAnalysis, TriggerAnalysis
from eidrive_scenario.checks.scenario_rules.truth_intervals import IMPOSSIBLE, STATE, WAITS
from eidrive_scenario.errors import Diagnostic
from eidrive_scenario.openscenario.model import Condition, ConditionEdge, Rule, SimulationTimeCondition

_REMEDIES = {
    UNOBSERVED_EDGE: 'an edge needs a change between two evaluations; write conditionEdge="none"',
    IMPOSSIBLE: "change the condition or take it out",
    STATE: "wait for another state",
    WAITS: "break the circle, or wait for something else",
}


def never_seen(name: str) -> Callable[[LintContext], Iterator[Diagnostic]]:
    """A rule on conditions that never count as true, for the reason that goes by this name."""

    def check(context: LintContext) -> Iterator[Diagnostic]:
        for watch in context.watches:
            for group in watch.groups:
                for one in group.seen:
                    if one.rule == name:
                        message = f"{_called(one.condition)} never counts as true: {one.reason}"
                        yield at(one.condition, f"{message}; {_consequence(watch)}", _REMEDIES[name])

    return check


def contradictory_groups(context: LintContext) -> Iterator[Diagnostic]:
    """Each condition of a group can be true, but never all of them together."""
    for watch in context.watches:
        for group in watch.groups:
            if not group.spans and all(one.spans for one in group.seen):
                yield at(
                    group.group,
                    f"the conditions of this group are never true together: {_windows(group.seen)}; "
                    f"{_consequence(watch)}",
                    "conditions of one group are joined by AND; put alternatives into groups of their own",
                )


def coinciding_edges(context: LintContext) -> Iterator[Diagnostic]:
    """Several edges in one group have to be seen at the very same evaluation."""
    for watch in context.watches:
        for group in watch.groups:
            edged = [one.condition for one in group.seen if one.condition.condition_edge is not ConditionEdge.NONE]
            if group.spans and len(edged) > 1:
                names = " and ".join(_called(condition) for condition in edged)
                yield at(
                    group.group,
                    f"{names} have to change at the very same evaluation",
                    'keep the edge of the one that comes last, and write conditionEdge="none" for the rest',
                )


def equal_times(context: LintContext) -> Iterator[Diagnostic]:
    """A time that is met exactly, or not at all."""
    for watch in context.watches:
        for group in watch.groups:
            for one in group.seen:
                time = _time(one.condition)
                if time is not None and time.rule is Rule.EQUAL_TO and time.value > 0.0 and one.spans:
                    yield at(
                        time,
                        f"simulation time = {time.value:g} s holds only if a step ends there to the microsecond",
                        'write rule="greaterOrEqual"',
                    )


def no_stop_trigger(context: LintContext) -> Iterator[Diagnostic]:
    """Nothing in the file says when the run is over."""
    trigger = context.scenario.storyboard.stop_trigger
    if trigger is None or not trigger.condition_group:
        what = "has no stop trigger" if trigger is None else "has an empty stop trigger"
        ends = "the run ends when every story has ended" if context.root.children else "the run does not end by itself"
        yield at(
            trigger or context.scenario.storyboard,
            f"the storyboard {what}; {ends}",
            "add a StopTrigger, such as a SimulationTimeCondition",
        )


def zero_executions(context: LintContext) -> Iterator[Diagnostic]:
    """A count of 0 says that an element is never executed."""
    for node in context.nodes:
        if node.limit == 0:
            yield at(node.element, f"{node.title} has the maximumExecutionCount 0", "write 1 or more, or take it out")


def _consequence(watch: TriggerAnalysis) -> str:
    if watch.spans:
        return "this group never holds"
    return f"{watch.owner.title} never starts" if watch.starts else f"this never stops {watch.owner.title}"


def _called(condition: Condition) -> str:
    time = _time(condition)
    if time is not None:
        return f"simulation time {_SIGNS[time.rule]} {time.value:g} s"
    return f"condition {condition.name!r}"


def _windows(seen: tuple[ConditionAnalysis, ...]) -> str:
    told = [
        f"{_called(one.condition)} {format_intervals(one.spans)}"
        for one in seen
        if format_intervals(one.spans) != "at any time"
    ]
    return ", ".join(told)


def _time(condition: Condition) -> SimulationTimeCondition | None:
    by_value = condition.by_value_condition
    return by_value.simulation_time_condition if by_value is not None else None


_SIGNS = {
    Rule.GREATER_THAN: ">",
    Rule.GREATER_OR_EQUAL: "≥",
    Rule.LESS_THAN: "<",
    Rule.LESS_OR_EQUAL: "≤",
    Rule.EQUAL_TO: "=",
    Rule.NOT_EQUAL_TO: "≠",
}
