"""Earliest times of the states of storyboard elements, and the intervals in which conditions on them can hold."""

from __future__ import annotations

import math
from collections.abc import Iterator

from eidrive_scenario.checks.scenario_rules.outline import Node, Outline
from eidrive_scenario.checks.scenario_rules.truth_intervals import (
    ALWAYS,
    IMPOSSIBLE_STATE,
    OPEN,
    UNREACHABLE,
    TruthIntervals,
    never,
)
from eidrive_scenario.openscenario import model

_OVERRIDING = (model.Priority.OVERWRITE, model.Priority.OVERRIDE)
_AFTER = (
    model.StoryboardElementState.COMPLETE_STATE,
    model.StoryboardElementState.END_TRANSITION,
    model.StoryboardElementState.STOP_TRANSITION,
)


def is_state_condition(condition: model.Condition) -> bool:
    """Whether a condition is a StoryboardElementStateCondition."""
    return _state_condition(condition) is not None


def _state_condition(condition: model.Condition) -> model.StoryboardElementStateCondition | None:
    by_value = condition.by_value_condition
    return by_value.storyboard_element_state_condition if by_value is not None else None


class States:
    """Lower bounds of the times at which elements start, end and are stopped [s]; inf for never."""

    def __init__(self, outline: Outline) -> None:
        self._outline = outline
        self.start: dict[Node, float] = dict.fromkeys(outline.nodes, math.inf)
        self._stopped: dict[Node, float] = dict.fromkeys(outline.nodes, math.inf)

    def improve(self, node: Node, start: float, stopped: float) -> bool:
        """Lower the bounds of an element; return whether one of them was lowered."""
        lowered = start < self.start[node] or stopped < self._stopped[node]
        self.start[node] = min(start, self.start[node])
        self._stopped[node] = min(stopped, self._stopped[node])
        return lowered

    def dependencies(self, condition: model.Condition) -> Iterator[Node]:
        """Yield the elements on whose state a condition depends.

        For the stop of an event or action it is the maneuver, as all of its events may cause the stop.
        """
        leaf = _state_condition(condition)
        if leaf is None:
            return
        for node in self._outline.find(leaf.storyboard_element_type, leaf.storyboard_element_ref):
            event = node.parent if isinstance(node.element, model.Action) else node
            is_stop = leaf.state is model.StoryboardElementState.STOP_TRANSITION
            of_maneuver = is_stop and event is not None and isinstance(event.element, model.Event)
            yield event.parent if of_maneuver and event is not None and event.parent is not None else node

    def truth(self, condition: model.Condition, owner: Node, starts: bool) -> TruthIntervals:
        """Return the intervals in which a state condition can hold, for a trigger that starts or stops its owner."""
        leaf = _state_condition(condition)
        assert leaf is not None
        state = leaf.state
        nodes = self._outline.find(leaf.storyboard_element_type, leaf.storyboard_element_ref)
        if not nodes:
            return OPEN
        running = [*owner.above(), *(() if starts else (owner,))]
        if all(node in running for node in nodes):
            return _truth_of_running(nodes[0], state, owner)
        if nodes == [owner] and owner.limit == 1:
            if state is model.StoryboardElementState.STANDBY_STATE:
                return TruthIntervals(steady=f"{owner.title} is in standbyState as long as it waits")
            return never(f"{owner.title} waits for itself", UNREACHABLE)
        reasons = [reason for node in nodes if (reason := self._impossible(node, state))]
        if len(reasons) == len(nodes):
            return never(" or ".join(reasons), IMPOSSIBLE_STATE)
        earliest = min(self._earliest(node, state) for node in nodes)
        if earliest == math.inf:
            return never(self._unreached(nodes[0], state), UNREACHABLE)
        return TruthIntervals(((earliest, math.inf),))

    def _impossible(self, node: Node, state: model.StoryboardElementState) -> str:
        """Return why an element of this kind is never in a state; "" if it may be."""
        if state is model.StoryboardElementState.SKIP_TRANSITION:
            if not isinstance(node.element, model.Event):
                return f"only events can be skipped, but not {node.title}"
            if node.element.priority is not model.Priority.SKIP:
                return (
                    f"{node.title} has the priority {node.element.priority.value!r}; only 'skip' events can be skipped"
                )
        if state is model.StoryboardElementState.STOP_TRANSITION and not _can_be_stopped(node):
            return f"{node.title} cannot be stopped"
        if state is model.StoryboardElementState.END_TRANSITION and isinstance(node.element, model.Action):
            endless = never_ends(node.element)
            return f"{node.title} does not end by itself: {endless}" if endless else ""
        return ""

    def _earliest(self, node: Node, state: model.StoryboardElementState) -> float:
        match state:
            case model.StoryboardElementState.STANDBY_STATE:
                return self.start[node.parent] if node.parent else 0.0
            case model.StoryboardElementState.COMPLETE_STATE:
                return self._complete(node)
            case model.StoryboardElementState.END_TRANSITION:
                return self._end(node)
            case model.StoryboardElementState.STOP_TRANSITION:
                return self._stop(node)
        return self.start[node]

    def _end(self, node: Node) -> float:
        if node.level in (model.StoryboardElementType.EVENT, model.StoryboardElementType.ACTION):
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
        """Return the earliest stop by a trigger, by another event of the maneuver, or by another action [s]."""
        times = [self._stopped_by_trigger(node)]
        event = node.parent if isinstance(node.element, model.Action) else node
        if isinstance(node.element, model.Action):
            times.append(self.start[node])
        if event is not None and isinstance(event.element, model.Event):
            times += [max(self.start[event], self.start[other]) for other in _overriding_events(event)]
        return min(times)

    def _stopped_by_trigger(self, node: Node) -> float:
        """Return the earliest stop by the trigger of the element or of an element above [s]."""
        return min(self._stopped[element] for element in (node, *node.above()))

    def _complete(self, node: Node) -> float:
        """Return the earliest completion [s].

        A preemption of an event or action needs no term: it follows the start, at which the element may already end.
        """
        return min(self._end(node), self._stopped_by_trigger(node))

    def _unreached(self, node: Node, state: model.StoryboardElementState) -> str:
        """Return why a state is never reached."""
        if self.start[node] == math.inf:
            return f"{node.title} never starts"
        if state is model.StoryboardElementState.STOP_TRANSITION:
            return f"{node.title} is never stopped"
        missing = next((element for element in node.walk() if self.start[element] == math.inf), None)
        return f"{node.title} never ends, as {missing.title} never starts" if missing else f"{node.title} never ends"


def _truth_of_running(node: Node, state: model.StoryboardElementState, owner: Node) -> TruthIntervals:
    """Return the intervals for an element that runs during all evaluations of the trigger."""
    runs = f"{node.title} runs as long as {owner.title} waits" if node is not owner else f"{node.title} runs"
    if state is model.StoryboardElementState.RUNNING_STATE:
        return TruthIntervals(ALWAYS, steady=runs)
    if state is model.StoryboardElementState.START_TRANSITION:
        return TruthIntervals(ALWAYS, risen=f"{node.title} has started before the first evaluation by {owner.title}")
    if state is model.StoryboardElementState.STANDBY_STATE:
        return never(f"{runs}, so it is not in standbyState", IMPOSSIBLE_STATE)
    if state in _AFTER:
        return never(f"{node.title} does not end before {owner.title}", UNREACHABLE)
    return never(f"only events can be skipped, but not {node.title}", IMPOSSIBLE_STATE)


def _can_be_stopped(node: Node) -> bool:
    if isinstance(node.element, model.Action):
        return True
    acts = [enclosing for enclosing in (node, *node.above()) if enclosing.level is model.StoryboardElementType.ACT]
    stopped = any(getattr(act.element, "stop_trigger", None) is not None for act in acts)
    return stopped or any(True for _ in _overriding_events(node))


def _overriding_events(node: Node) -> Iterator[Node]:
    """Yield the other events of the maneuver that stop an event by their start."""
    if not isinstance(node.element, model.Event) or node.parent is None:
        return
    for event in node.parent.children:
        if event is not node and isinstance(event.element, model.Event) and event.element.priority in _OVERRIDING:
            yield event


_CONTINUOUS = (
    model.LaneOffsetAction,
    model.LateralDistanceAction,
    model.LongitudinalDistanceAction,
    model.RelativeTargetSpeed,
)


def never_ends(action: model.Action) -> str:
    """Return why an action does not end by itself; "" if it may."""
    for element in action.walk():
        if isinstance(element, _CONTINUOUS) and element.continuous:
            return f"{type(element).__name__} is continuous"
        if isinstance(element, model.TransitionDynamics) and has_zero_rate(element):
            return f"its rate is {element.value:g}"
    return ""


def has_zero_rate(dynamics: model.TransitionDynamics) -> bool:
    """Whether a transition never reaches its target because its rate is 0."""
    by_rate = dynamics.dynamics_dimension is model.DynamicsDimension.RATE and dynamics.value == 0.0
    return by_rate and dynamics.dynamics_shape is not model.DynamicsShape.STEP
