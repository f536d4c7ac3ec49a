"""When the elements of the storyboard can be in a state at the earliest, and when a condition can see that."""

from __future__ import annotations

import math
from collections.abc import Iterator

from eidrive_scenario.checks.scenario_rules.intervals import ALWAYS
from eidrive_scenario.checks.scenario_rules.outline import Node, Outline
from eidrive_scenario.checks.scenario_rules.termination import never_ends
from eidrive_scenario.checks.scenario_rules.truth_intervals import OPEN, STATE, WAITS, TruthIntervals, never
from eidrive_scenario.openscenario.model import (
    Action,
    Condition,
    Event,
    Priority,
    StoryboardElementState,
    StoryboardElementStateCondition,
    StoryboardElementType,
)

_OVERRIDING = (Priority.OVERWRITE, Priority.OVERRIDE)
_AFTER = (
    StoryboardElementState.COMPLETE_STATE,
    StoryboardElementState.END_TRANSITION,
    StoryboardElementState.STOP_TRANSITION,
)


def asks_for_state(condition: Condition) -> bool:
    """Whether a condition looks at the storyboard itself."""
    return _question(condition) is not None


def _question(condition: Condition) -> StoryboardElementStateCondition | None:
    by_value = condition.by_value_condition
    return by_value.storyboard_element_state_condition if by_value is not None else None


class States:
    """Lower bounds of the times at which elements start, end and are stopped [s]; inf for never."""

    def __init__(self, outline: Outline) -> None:
        self._outline = outline
        self.start: dict[Node, float] = dict.fromkeys(outline.nodes, math.inf)
        self._stopped: dict[Node, float] = dict.fromkeys(outline.nodes, math.inf)

    def improve(self, node: Node, start: float, stopped: float) -> bool:
        """Earlier times for an element; False where these were known."""
        better = start < self.start[node] or stopped < self._stopped[node]
        self.start[node] = min(start, self.start[node])
        self._stopped[node] = min(stopped, self._stopped[node])
        return better

    def looked_at(self, condition: Condition) -> Iterator[Node]:
        """The elements that a condition asks for; whether one is stopped depends on all events of its maneuver."""
        question = _question(condition)
        if question is None:
            return
        for node in self._outline.find(question.storyboard_element_type, question.storyboard_element_ref):
            event = node.parent if isinstance(node.element, Action) else node
            stops = question.state is StoryboardElementState.STOP_TRANSITION
            rivalry = stops and event is not None and isinstance(event.element, Event)
            yield event.parent if rivalry and event is not None and event.parent is not None else node

    def truth(self, condition: Condition, owner: Node, starts: bool) -> TruthIntervals:
        """When a condition on states can hold for a trigger that starts or stops its owner."""
        question = _question(condition)
        assert question is not None
        state = question.state
        meant = self._outline.find(question.storyboard_element_type, question.storyboard_element_ref)
        if not meant:
            return OPEN
        around = [*owner.above(), *(() if starts else (owner,))]
        if all(node in around for node in meant):
            return _around(meant[0], state, owner)
        if meant == [owner] and owner.limit == 1:
            if state is StoryboardElementState.STANDBY_STATE:
                return TruthIntervals(steady=f"{owner.title} stands by as long as it waits")
            return never(f"{owner.title} waits for itself", WAITS)
        spoken = " or ".join(reason for node in meant if (reason := self._unreal(node, state)))
        if spoken and all(self._unreal(node, state) for node in meant):
            return never(spoken, STATE)
        earliest = min(self._earliest(node, state) for node in meant)
        if earliest == math.inf:
            return never(self._missed(meant[0], state), WAITS)
        return TruthIntervals(((earliest, math.inf),))

    def _unreal(self, node: Node, state: StoryboardElementState) -> str:
        """Why an element of this make never is in a state, "" where it may be."""
        if state is StoryboardElementState.SKIP_TRANSITION:
            if not isinstance(node.element, Event):
                return f"only events are skipped, {node.title} is none"
            if node.element.priority is not Priority.SKIP:
                return f"{node.title} has the priority {node.element.priority.value!r}; only 'skip' is ever skipped"
        if state is StoryboardElementState.STOP_TRANSITION and not _can_be_stopped(node):
            return f"nothing stops {node.title}"
        if state is StoryboardElementState.END_TRANSITION and isinstance(node.element, Action):
            endless = never_ends(node.element)
            return f"{node.title} does not end by itself: {endless}" if endless else ""
        return ""

    def _earliest(self, node: Node, state: StoryboardElementState) -> float:
        match state:
            case StoryboardElementState.STANDBY_STATE:
                return self.start[node.parent] if node.parent else 0.0
            case StoryboardElementState.COMPLETE_STATE:
                return self._complete(node)
            case StoryboardElementState.END_TRANSITION:
                return self._end(node)
            case StoryboardElementState.STOP_TRANSITION:
                return self._stop(node)
        return self.start[node]

    def _end(self, node: Node) -> float:
        if node.level in (StoryboardElementType.EVENT, StoryboardElementType.ACTION):
            return self.start[node]
        if not node.children:
            return math.inf
        latest = self.start[node]
        for child in node.children:
            latest = max(latest, self._complete(child))
            if latest == math.inf:
                break
        return latest

    def _stop(self, node: Node) -> float:
        """By its own trigger, with those above it, by another event of its maneuver, by another action."""
        times = [self._halted(node)]
        event = node.parent if isinstance(node.element, Action) else node
        if isinstance(node.element, Action):
            times.append(self.start[node])
        if event is not None and isinstance(event.element, Event):
            times += [max(self.start[event], self.start[rival]) for rival in _rivals(event)]
        return min(times)

    def _halted(self, node: Node) -> float:
        """By its own trigger, or with those above it."""
        return min(self._stopped[one] for one in (node, *node.above()))

    def _complete(self, node: Node) -> float:
        """Whatever displaces an event or an action does so after its start, at which it may be over."""
        return min(self._end(node), self._halted(node))

    def _missed(self, node: Node, state: StoryboardElementState) -> str:
        """Why a state is never reached."""
        if self.start[node] == math.inf:
            return f"{node.title} never starts"
        if state is StoryboardElementState.STOP_TRANSITION:
            return f"{node.title} is never stopped"
        late = next((one for one in node.walk() if self.start[one] == math.inf), None)
        return f"{node.title} never ends, as {late.title} never starts" if late else f"{node.title} never ends"


def _around(node: Node, state: StoryboardElementState, owner: Node) -> TruthIntervals:
    """Of an element that runs as long as the trigger is asked."""
    runs = f"{node.title} runs as long as {owner.title} waits" if node is not owner else f"{node.title} runs"
    if state is StoryboardElementState.RUNNING_STATE:
        return TruthIntervals(ALWAYS, steady=runs)
    if state is StoryboardElementState.START_TRANSITION:
        return TruthIntervals(ALWAYS, risen=f"{node.title} has started before {owner.title} first looks")
    if state is StoryboardElementState.STANDBY_STATE:
        return never(f"{runs}, so it does not stand by", STATE)
    if state in _AFTER:
        return never(f"{node.title} is not over before {owner.title} is", WAITS)
    return never(f"only events are skipped, {node.title} is none", STATE)


def _can_be_stopped(node: Node) -> bool:
    if isinstance(node.element, Action):
        return True
    acts = [one for one in (node, *node.above()) if one.level is StoryboardElementType.ACT]
    stopped = any(getattr(act.element, "stop_trigger", None) is not None for act in acts)
    return stopped or any(True for _ in _rivals(node))


def _rivals(node: Node) -> Iterator[Node]:
    """The other events of its maneuver that end it when they start."""
    if not isinstance(node.element, Event) or node.parent is None:
        return
    for one in node.parent.children:
        if one is not node and isinstance(one.element, Event) and one.element.priority in _OVERRIDING:
            yield one
