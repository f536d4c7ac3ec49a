"""Explanation of the start, or the missing start, of a storyboard element."""

from __future__ import annotations

from collections.abc import Iterator

from eidrive_scenario.errors import Diagnostic, SettingError, suggestion
from eidrive_scenario.openscenario.validation.names import is_suffix
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.storyboard.context.condition import EntityCondition
from eidrive_scenario.storyboard.state.element_states import ElementState, ElementTransition, StateChange
from eidrive_scenario.storyboard.storyboard import Storyboard
from eidrive_scenario.storyboard.tree.elements import ActElement, StoryElement
from eidrive_scenario.storyboard.tree.events import EventElement
from eidrive_scenario.storyboard.tree.trigger import (
    ConditionHistory,
    GroupHistory,
    TriggerHistory,
    TrueIntervals,
    WaitForTrigger,
)

_CHANGES = {"rising": "became true", "falling": "became false", "risingOrFalling": "changed"}


def describe_history(history: ConditionHistory) -> Iterator[str]:
    """Yield the intervals in which the condition was true, its closest values, and the effect of edge and delay."""
    if not history.asked:
        yield "never evaluated"
        return
    yield _truth(history)
    if not history.true.count:
        yield from _nearest(history)
    elif history.evaluator.edge != "none":
        yield _edge(history)
    if history.evaluator.delay > 0.0 and (history.counted.count or history.true.count):
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
    condition = history.evaluator.condition
    if isinstance(condition, EntityCondition):
        for name in condition.entities:
            if name not in history.nearest and name not in history.undefined and not history.words:
                yield f"{name}: absent"
    if history.words and history.words != condition.describe():
        yield f"at the last evaluation {history.words}"


def _number(value: float) -> str:
    return f"{value:.0f}" if value == round(value) else f"{value:.2f}" if abs(value) >= 0.1 else f"{value:.3g}"


def _edge(history: ConditionHistory) -> str:
    edge = history.evaluator.edge
    if history.edges.count:
        return f"{_CHANGES[edge]} {_moments(history.edges)}"
    effect = f"so edge {edge!r} never occurred"
    if edge == "rising":
        return f"true at the first evaluation, never became true afterwards, {effect}"
    return f"never {'became false' if edge == 'falling' else 'changed'}, {effect}"


def _delay(history: ConditionHistory) -> str:
    delay = history.evaluator.delay
    if history.counted.count:
        return f"fulfilled after its delay of {delay:g} s, {_moments(history.counted)}"
    undelayed = history.true if history.evaluator.edge == "none" else history.edges
    if not undelayed.count:
        return f"delay of {delay:g} s without effect"
    due = undelayed.first[0] + delay
    return f"due after its delay of {delay:g} s, at {due:.2f} s; last evaluated at {history.last_asked:.2f} s"


def _moments(times: TrueIntervals) -> str:
    first = f"at {times.first[0]:.2f} s"
    return first if times.count == 1 else f"{times.count} times, first {first}, last at {times.last[0]:.2f} s"


STORYBOARD = "storyboard"
_SHOWN = 5


class Explanation:
    """Observer of one run that explains one element: an event or an act, given by its name or a suffix of its path.

    The name "storyboard" selects the stop trigger of the storyboard.
    """

    def __init__(self, reference: str) -> None:
        self.reference = reference
        self._subjects: list[_Subject] = []

    def watch(self, storyboard: Storyboard) -> None:
        """Record the evaluations of the triggers. Raise SettingError if the storyboard has no such element."""
        if self.reference == STORYBOARD:
            self._subjects = [_Subject(storyboard.root, None, storyboard.root.stop_leaf)]
            return
        named = list(_named(storyboard.root, None))
        self._subjects = [
            _Subject(element, act, element.start_leaf)
            for element, act in named
            if is_suffix(self.reference, element.record.path)
        ]
        if not self._subjects:
            names = {element.name for element, _ in named} | {STORYBOARD}
            raise SettingError(
                Diagnostic(f"no event or act is named {self.reference!r}", suggestion(self.reference, names))
            )

    def observe(self, frame: Frame) -> None:
        """Record the state changes of the element."""
        for subject in self._subjects:
            subject.observe(frame)

    def close(self) -> None:
        """Do nothing: required by the observer protocol."""

    def lines(self) -> list[str]:
        """Return the explanation line by line."""
        return [line for subject in self._subjects for line in subject.lines()]


def _named(element: StoryElement, act: StoryElement | None) -> Iterator[tuple[StoryElement, StoryElement | None]]:
    """Yield all acts and events, each with its enclosing act."""
    if isinstance(element, ActElement | EventElement):
        yield element, act
    inner = element if isinstance(element, ActElement) else act
    for child in element.elements:
        yield from _named(child, inner)


class _Subject:
    """Explained element with its enclosing act and the history of its trigger."""

    def __init__(self, element: StoryElement, act: StoryElement | None, leaf: WaitForTrigger | None) -> None:
        self._element = element
        self._act = _Subject(act, None, act.start_leaf) if act is not None else None
        self._history = _history(leaf)
        self._changes: list[StateChange] = []
        self._now = 0.0

    def observe(self, frame: Frame) -> None:
        """Record the changes of the element and of its enclosing act."""
        self._now = frame.view.time
        path = "/".join(self._element.record.path)
        self._changes += [change for change in frame.changes if change.path == path]
        if self._act is not None:
            self._act.observe(frame)

    def lines(self) -> Iterator[str]:
        """Yield the state changes, then the history of the trigger."""
        element = self._element
        if isinstance(element, ActElement | EventElement):
            yield from self._starts()
            word = "start"
        else:
            yield f"the run {self._end()}"
            word = "stop"
        if self._history is None:
            without = f"it has no {word} trigger"
            starts = self._times(ElementTransition.START)
            if element.kind == STORYBOARD or any(without not in change.why for change in starts[:_SHOWN]):
                yield f"  {without}"
            return
        if not self._history.asked:
            return
        groups = self._history.groups
        yield f"  its {word} trigger" + (", fulfilled by any of its groups:" if len(groups) > 1 else ":")
        for number, group in enumerate(groups, 1):
            yield from _group_lines(group, f"group {number} of {len(groups)}" if len(groups) > 1 else "")

    def _starts(self) -> Iterator[str]:
        element = self._element
        title = f"{element.kind} {element.name} ({'/'.join(element.record.path)})"
        starts = self._times(ElementTransition.START)
        skips = self._times(ElementTransition.SKIP)
        if starts:
            often = "" if len(starts) == 1 else f" {len(starts)} times"
            yield f"{title} started{often}:"
        else:
            yield f"{title} never started"
        yield from (f"  at {change.time:.2f} s: {change.why or 'with its parent'}" for change in starts[:_SHOWN])
        if skips:
            yield f"  it was skipped {_times(len(skips))}, first at {skips[0].time:.2f} s: {skips[0].why}"
        if not starts and not any(change.after is ElementState.STANDBY for change in self._changes):
            yield from self._without_standby()
        elif not starts:
            yield f"  {self._standby()}"

    def _without_standby(self) -> Iterator[str]:
        """Yield the explanation of the enclosing act, which never ran."""
        if self._act is None:
            yield f"  its parent never ran (the run ended at {self._now:.2f} s)"
            return
        yield "  it never reached standbyState because its act did not run; explanation of the act:"
        yield from (f"  {line}" for line in self._act.lines())

    def _standby(self) -> str:
        begin = next(change.time for change in self._changes if change.after is ElementState.STANDBY)
        stop = next((change for change in self._changes if change.transition is ElementTransition.STOP), None)
        if stop is None:
            return f"it was in standbyState from {begin:.2f} s to the end of the run at {self._now:.2f} s"
        why = f" ({stop.why})" if stop.why else ""
        return f"it was in standbyState from {begin:.2f} s to {stop.time:.2f} s, when its parent was stopped{why}"

    def _end(self) -> str:
        last = self._changes[-1] if self._changes else None
        if last is None or last.after is not ElementState.COMPLETE:
            return f"was not ended by the storyboard; it lasted until {self._now:.2f} s"
        how = "stopped" if last.transition is ElementTransition.STOP else "ended with its last story"
        return f"{how} at {last.time:.2f} s" + (f": {last.why}" if last.why else "")

    def _times(self, transition: ElementTransition) -> list[StateChange]:
        return [change for change in self._changes if change.transition is transition]


def _history(leaf: WaitForTrigger | None) -> TriggerHistory | None:
    """Return the history of a trigger. All explanations of a trigger share one history."""
    if leaf is None:
        return None
    existing = leaf.trigger.observer
    return existing if isinstance(existing, TriggerHistory) else TriggerHistory(leaf.trigger)


def _group_lines(group: GroupHistory, title: str) -> Iterator[str]:
    indent = "    "
    if title:
        yield f"{indent}{title}: {_verdict(group)}"
        indent += "  "
    elif len(group.conditions) > 1:
        yield f"{indent}{_verdict(group)}"
    for condition in group.conditions:
        evaluator = condition.evaluator
        where = evaluator.condition.element
        yield f"{indent}{evaluator.describe()}  [{evaluator.name!r}, {where.source}:{where.line}]"
        yield from (f"{indent}  {fact}" for fact in describe_history(condition))


def _verdict(group: GroupHistory) -> str:
    if group.held.count:
        return f"fulfilled at {group.held.first[0]:.2f} s"
    total = len(group.conditions)
    if total == 1:
        return "never fulfilled"
    if all(condition.counted.count for condition in group.conditions):
        return f"each condition was fulfilled at some time, but never all {total} at once"
    if group.most <= 0:
        return f"none of the {total} conditions was ever fulfilled"
    missing = " and ".join(condition.evaluator.describe() for condition in group.missing)
    return f"{group.most} of {total} conditions at most, first at {group.most_at:.2f} s, without: {missing}"


def _times(count: int) -> str:
    return "once" if count == 1 else f"{count} times"
