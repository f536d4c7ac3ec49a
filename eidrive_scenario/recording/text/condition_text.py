"""Text description of the history of a condition over a run."""

from __future__ import annotations

from collections.abc import Iterator

from eidrive_scenario.storyboard.context.condition import EntityCondition
from eidrive_scenario.storyboard.tree.trigger import ConditionHistory, TrueIntervals

_CHANGES = {"rising": "became true", "falling": "became false", "risingOrFalling": "changed"}


def describe_history(history: ConditionHistory) -> Iterator[str]:
    """Yield the intervals in which the condition was true, its closest values, and the effect of edge and delay."""
    if not history.asked:
        yield "never evaluated"
        return
    yield _truth(history)
    if not history.true.count:
        yield from _nearest(history)
    elif history.monitor.edge != "none":
        yield _edge(history)
    if history.monitor.delay > 0.0 and (history.counted.count or history.true.count):
        yield _delay(history)


def _truth(history: ConditionHistory) -> str:
    true, evaluations = history.true, f"{history.asked} evaluations from {history.first_asked:.2f} s"
    if history.asked == 1:
        return f"{'true' if true.count else 'not true'} at its only evaluation, at {history.first_asked:.2f} s"
    if not true.count:
        return f"never true in {evaluations} to {history.last_asked:.2f} s"
    if true.count == 1 and true.first == (history.first_asked, history.last_asked):
        return f"true at all of {evaluations} to {history.last_asked:.2f} s"
    if true.count == 1:
        return f"true {_span(true.first, history.last_asked)}"
    return f"true {true.count} times: first {_span(true.first, history.last_asked)}, " + (
        f"last {_span(true.last, history.last_asked)}"
    )


def _span(span: tuple[float, float], end: float) -> str:
    begin, last = span
    if last >= end:
        return f"from {begin:.2f} s on"
    return f"at {begin:.2f} s" if begin == last else f"from {begin:.2f} s to {last:.2f} s"


def _nearest(history: ConditionHistory) -> Iterator[str]:
    """Yield the closest value of each entity, or the last state of a condition without a quantity."""
    for name, nearest in history.nearest.items():
        measure = nearest.measure
        subject = f"{name}: " if name else ""
        unit = f" {measure.unit}" if measure.unit else ""
        yield f"{subject}closest value {_number(measure.value)}{unit}, at {nearest.time:.2f} s"
    for name in sorted(history.undefined - history.nearest.keys()):
        yield f"{f'{name}: ' if name else ''}undefined or infinite at all evaluations"
    condition = history.monitor.condition
    if isinstance(condition, EntityCondition):
        for name in condition.entities:
            if name not in history.nearest and name not in history.undefined and not history.words:
                yield f"{name}: absent"
    if history.words and history.words != condition.describe():
        yield f"at the last evaluation {history.words}"


def _number(value: float) -> str:
    return f"{value:.0f}" if value == round(value) else f"{value:.2f}" if abs(value) >= 0.1 else f"{value:.3g}"


def _edge(history: ConditionHistory) -> str:
    edge = history.monitor.edge
    if history.edges.count:
        return f"{_CHANGES[edge]} {_moments(history.edges)}"
    effect = f"so edge {edge!r} never occurred"
    if edge == "rising":
        return f"true at the first evaluation, never became true afterwards, {effect}"
    return f"never {'became false' if edge == 'falling' else 'changed'}, {effect}"


def _delay(history: ConditionHistory) -> str:
    delay = history.monitor.delay
    if history.counted.count:
        return f"fulfilled after its delay of {delay:g} s, {_moments(history.counted)}"
    undelayed = history.true if history.monitor.edge == "none" else history.edges
    if not undelayed.count:
        return f"delay of {delay:g} s without effect"
    due = undelayed.first[0] + delay
    return f"due after its delay of {delay:g} s, at {due:.2f} s; last evaluated at {history.last_asked:.2f} s"


def _moments(times: TrueIntervals) -> str:
    first = f"at {times.first[0]:.2f} s"
    return first if times.count == 1 else f"{times.count} times, first {first}, last at {times.last[0]:.2f} s"
