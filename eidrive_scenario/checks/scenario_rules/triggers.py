"""Rules about triggers that can never be fulfilled or are likely to be missed."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from eidrive_scenario.checks.rule import at
from eidrive_scenario.checks.scenario_rules.context import ConditionAnalysis, LintContext, TriggerAnalysis
from eidrive_scenario.checks.scenario_rules.truth_intervals import (
    IMPOSSIBLE_CONDITION,
    IMPOSSIBLE_STATE,
    UNOBSERVED_EDGE,
    UNREACHABLE,
    format_intervals,
)
from eidrive_scenario.errors import Diagnostic
from eidrive_scenario.openscenario.model import Condition, ConditionEdge, Rule, SimulationTimeCondition
from eidrive_scenario.storyboard.context.condition import describe_rule

_HINTS = {
    UNOBSERVED_EDGE: 'an edge requires a change between two evaluations; write conditionEdge="none"',
    IMPOSSIBLE_CONDITION: "change or remove the condition",
    IMPOSSIBLE_STATE: "wait for another state",
    UNREACHABLE: "resolve the circular wait, or wait for another element",
}


def never_true(rule: str) -> Callable[[LintContext], Iterator[Diagnostic]]:
    """Return the check of a rule about conditions that are never true."""

    def check(context: LintContext) -> Iterator[Diagnostic]:
        for trigger in context.triggers:
            for group in trigger.groups:
                for condition in group.conditions:
                    if condition.rule == rule:
                        message = f"{_describe_condition(condition.condition)} is never true: {condition.reason}"
                        yield at(condition.condition, f"{message}; {_consequence(trigger)}", _HINTS[rule])

    return check


def contradictory_groups(context: LintContext) -> Iterator[Diagnostic]:
    """Yield groups whose conditions can be true, but never all at the same time."""
    for trigger in context.triggers:
        for group in trigger.groups:
            if not group.intervals and all(condition.intervals for condition in group.conditions):
                yield at(
                    group.group,
                    f"the conditions of this group are never true together: {_describe_intervals(group.conditions)}; "
                    f"{_consequence(trigger)}",
                    "conditions of one group are combined by AND; use separate groups for alternatives",
                )


def simultaneous_edges(context: LintContext) -> Iterator[Diagnostic]:
    """Yield groups with several edges, which must all be observed at the same evaluation."""
    for trigger in context.triggers:
        for group in trigger.groups:
            conditions = [condition.condition for condition in group.conditions]
            edges = [condition for condition in conditions if condition.condition_edge is not ConditionEdge.NONE]
            if group.intervals and len(edges) > 1:
                names = " and ".join(_describe_condition(condition) for condition in edges)
                yield at(
                    group.group,
                    f"{names} must change at the same evaluation",
                    'keep the edge of the last condition, and write conditionEdge="none" for the others',
                )


def exact_time_comparisons(context: LintContext) -> Iterator[Diagnostic]:
    """Yield comparisons of the simulation time by `equalTo`."""
    for trigger in context.triggers:
        for group in trigger.groups:
            for condition in group.conditions:
                time = _time(condition.condition)
                if time is not None and time.rule is Rule.EQUAL_TO and time.value > 0.0 and condition.intervals:
                    yield at(
                        time,
                        f"simulation time = {time.value:g} s holds only if a time step ends there to the microsecond",
                        'write rule="greaterOrEqual"',
                    )


def no_stop_trigger(context: LintContext) -> Iterator[Diagnostic]:
    """Yield the storyboard if it has no stop trigger."""
    trigger = context.scenario.storyboard.stop_trigger
    if trigger is None or not trigger.condition_group:
        problem = "has no stop trigger" if trigger is None else "has an empty stop trigger"
        end = "the run ends when every story has ended" if context.root.children else "the run does not end by itself"
        yield at(
            trigger or context.scenario.storyboard,
            f"the storyboard {problem}; {end}",
            "add a StopTrigger, such as a SimulationTimeCondition",
        )


def zero_executions(context: LintContext) -> Iterator[Diagnostic]:
    """Yield elements with maximumExecutionCount 0, which are never executed."""
    for node in context.nodes:
        if node.limit == 0:
            yield at(
                node.element,
                f"{node.title} has the maximumExecutionCount 0",
                "specify 1 or more, or remove the element",
            )


def _consequence(trigger: TriggerAnalysis) -> str:
    if trigger.intervals:
        return "this group is never fulfilled"
    return f"{trigger.owner.title} never starts" if trigger.starts else f"this never stops {trigger.owner.title}"


def _describe_condition(condition: Condition) -> str:
    time = _time(condition)
    if time is not None:
        return f"simulation time {describe_rule(time.rule)} {time.value:g} s"
    return f"condition {condition.name!r}"


def _describe_intervals(conditions: tuple[ConditionAnalysis, ...]) -> str:
    texts = [
        f"{_describe_condition(condition.condition)} {format_intervals(condition.intervals)}"
        for condition in conditions
        if format_intervals(condition.intervals) != "at any time"
    ]
    return ", ".join(texts)


def _time(condition: Condition) -> SimulationTimeCondition | None:
    by_value = condition.by_value_condition
    return by_value.simulation_time_condition if by_value is not None else None
