"""State machines of the storyboard elements: storyboard, story, act, maneuver group, maneuver, event, action.

`tick_tree` executes one tick:

1. Actions that the last step completed end, and with them, bottom up, the elements whose children are complete.
2. Triggers are evaluated, and stop and start elements, top down.
3. `update_children` updates the actions that only set a value, which end, and ends the elements that are complete.
4. All other running actions decide on the next step, once per tick.

Steps 2 and 3 repeat until no state changes, so that a chain of elements is executed in one tick: transitions consume no
simulation time (ASAM OpenSCENARIO XML 1.3.1, 8.3.1), and an action that the chain stops moves nothing in this tick. All
steps repeat if step 4 changes a state, as by the removal of an entity. An element starts at most once in a tick, which
bounds the loop. Until a state changes, they visit the elements that wait for a trigger, and the running actions only.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Composite

from eidrive_scenario.storyboard.context.runtime_context import RuntimeContext
from eidrive_scenario.storyboard.state.element_states import ElementRecord, ElementState, ElementTransition
from eidrive_scenario.storyboard.tree.trigger import Trigger, WaitForTrigger

NO_TRIGGER = "it has no start trigger"
"""Reason for the start of an element without a start trigger."""
ALWAYS = Trigger(())
"""Trigger of an element that starts with its parent; it does not rest."""


class RunningAction(Protocol):
    """Action in runningState."""

    def update_children(self) -> None:
        """Update the behaviours of an action that only sets a value."""

    def decide(self) -> None:
        """Update the behaviours, once per tick."""


class StoryElement(Composite):
    """Element with children. It starts by its trigger or with its parent, and ends when all its children are complete.

    `limit` is the maximumExecutionCount: an element that ends before it is reached returns to standbyState.
    """

    kind = ""

    def __init__(
        self,
        context: RuntimeContext,
        path: tuple[str, ...],
        children: Sequence[StoryElement] = (),
        *,
        start: WaitForTrigger | None = None,
        stop: WaitForTrigger | None = None,
        limit: int = 1,
    ) -> None:
        self.start_leaf, self.stop_leaf = start, stop
        leaves: list[Behaviour] = [leaf for leaf in (start, stop) if leaf is not None]
        super().__init__(path[-1], [*leaves, *children])
        self.context = context
        self.elements = tuple(children)
        self.limit = limit
        self.executions = 0
        self._tried_at: int | None = None
        """Last tick in which it started or was skipped."""
        self.record: ElementRecord = context.progress.register(self.kind, path)

    @property
    def state(self) -> ElementState | None:
        """State of the element; None before its parent starts."""
        return self.record.state

    def enter_standby(self) -> None:
        """Enter standbyState as the parent starts. An element with maximumExecutionCount 0 is complete."""
        self.executions = 0
        self._reset_triggers()
        if self.limit < 1:
            self._change(ElementTransition.SKIP, ElementState.COMPLETE, "maximumExecutionCount is 0")

    def list_active(self, awaited: list[tuple[StoryElement, Trigger]], actions: list[RunningAction]) -> None:
        """Add the elements from this one down that await a trigger, and the running actions, to the lists, top down."""
        state = self.record.state
        if state is ElementState.STANDBY:
            awaited.append((self, ALWAYS if self.start_leaf is None else self.start_leaf.trigger))
        elif state is ElementState.RUNNING:
            if self.stop_leaf is not None:
                awaited.append((self, self.stop_leaf.trigger))
            for element in self.elements:
                element.list_active(awaited, actions)

    def is_stop_triggered(self) -> bool:
        """Whether the element runs and its stop trigger fires, which is evaluated from the tick after the start on.

        That of the storyboard is evaluated from the first tick on.
        """
        if self.stop_leaf is None or self.record.state is not ElementState.RUNNING or self._is_tried:
            return False
        return self.stop_leaf.is_fired()

    def is_start_triggered(self) -> bool:
        """Whether the element waits and its start trigger fires, or it has none."""
        if self.record.state is not ElementState.STANDBY or self._is_tried:
            return False
        return self.start_leaf is None or self.start_leaf.is_fired()

    @property
    def start_reason(self) -> str:
        """Reason for the start after its trigger fired."""
        return NO_TRIGGER if self.start_leaf is None else self.start_leaf.trigger.why

    @property
    def stop_reason(self) -> str:
        """Reason for the stop after its trigger fired."""
        return "" if self.stop_leaf is None else self.stop_leaf.trigger.why

    @property
    def _is_tried(self) -> bool:
        """Whether it started or was skipped in this tick."""
        return self._tried_at == self.context.progress.tick

    def start(self, why: str = "") -> None:
        """Enter runningState; the children enter standbyState."""
        self._tried_at = self.context.progress.tick
        self.executions += 1
        self._change(ElementTransition.START, ElementState.RUNNING, why)
        for element in self.elements:
            element.enter_standby()

    def stop_element(self, why: str = "") -> None:
        """Stop this element and its children."""
        for element in self.elements:
            if element.state in (ElementState.STANDBY, ElementState.RUNNING):
                element.stop_element(why)
        self._change(ElementTransition.STOP, ElementState.COMPLETE, why)
        self.stop(Status.INVALID)

    def end(self) -> None:
        """Enter completeState, or standbyState if executions are left."""
        if self.executions < self.limit:
            self._change(ElementTransition.END, ElementState.STANDBY)
            self._reset_triggers()
        else:
            self._change(ElementTransition.END, ElementState.COMPLETE)

    def complete_finished(self) -> None:
        """End the actions that reached their goals in the last step, and completed parents."""
        if self.state is ElementState.RUNNING:
            for element in self.elements:
                element.complete_finished()
            self.complete_if_done()

    def update_children(self) -> None:
        """Update the running children; end if all of them are complete."""
        self.status = Status.RUNNING
        if self.record.state is ElementState.RUNNING:
            for element in self.elements:
                if element.record.state is ElementState.RUNNING:
                    element.update_children()
            self.complete_if_done()
        if self.record.state is ElementState.COMPLETE:
            self.status = Status.SUCCESS

    def tick(self) -> Iterator[Behaviour]:
        """Update the children; the interface of py_trees."""
        self.update_children()
        yield self

    def complete_if_done(self) -> None:
        """End if all children are complete; an element without children runs until it is stopped."""
        if self.record.state is not ElementState.RUNNING or not self.elements:
            return
        for element in self.elements:
            if element.record.state is not ElementState.COMPLETE:
                return
        self.end()

    def _reset_triggers(self) -> None:
        for leaf in (self.start_leaf, self.stop_leaf):
            if leaf is not None:
                leaf.stop(Status.INVALID)
        self._change(None, ElementState.STANDBY)

    def _change(self, transition: ElementTransition | None, after: ElementState, why: str = "") -> None:
        self.context.progress.change(self.record, transition, after, why)


class StoryboardElement(StoryElement):
    """Root of the tree. It ends by its stop trigger; without one with its last story."""

    kind = "storyboard"
    _listed = _updated = -1
    """Number of state changes before the lists of elements were made, and before all elements were updated."""
    _awaited: Sequence[tuple[StoryElement, Trigger]] = ()
    _running_actions: Sequence[RunningAction] = ()

    def tick_tree(self, init: Behaviour | None = None) -> None:
        """Tick the tree, and the actions of Init that are running."""
        progress, moved, time = self.context.progress, self.context.moved, self.context.time
        if self.state is None:
            self.enter_standby()
            self.start()
            self._tried_at = None
        if self.context.completes_this_step:
            self.context.completes_this_step = False
            self.complete_finished()
        seen = awaiting = -1
        while seen != len(progress.changes):
            seen = len(progress.changes)
            if self._listed != progress.version:
                self._listed = progress.version
                awaited: list[tuple[StoryElement, Trigger]] = []
                actions: list[RunningAction] = []
                self.list_active(awaited, actions)
                self._awaited, self._running_actions = awaited, actions
            version = progress.version
            due = [
                element
                for element, trigger in self._awaited
                if trigger.version < version or trigger.rests_until <= time or not moved.isdisjoint(trigger.reads)
            ]
            has_stopped = self._stop_elements(due)
            if self.state is not ElementState.RUNNING:
                return
            if has_stopped:
                continue  # Elements start once no further one stops.
            self._start_elements(due)
            moved, time = set(), math.nan  # Motion and time are constant within a tick.
            self.update_children()
            if seen != len(progress.changes):
                continue
            if init is not None:
                init.tick_once()
                init = None
            for action in self._running_actions:
                action.decide()
                if seen != len(progress.changes):
                    break
            pending, self.context.pending_actions = self.context.pending_actions, []
            if pending and seen == len(progress.changes):
                if len(pending) != awaiting:
                    awaiting, seen = len(pending), -1  # An action of this tick may have added their entity.
                else:
                    for abort in pending:
                        abort()

    def _stop_elements(self, elements: Sequence[StoryElement]) -> bool:
        """Stop elements by their triggers, which are evaluated together before; return whether one stops."""
        stopping = [element for element in elements if element.is_stop_triggered()]
        for element in stopping:
            if element.record.state is ElementState.RUNNING:  # otherwise it has stopped with its parent
                element.stop_element(element.stop_reason)
        return bool(stopping)

    def _start_elements(self, elements: Sequence[StoryElement]) -> None:
        """Start elements, and children of those that start, by their triggers.

        A trigger is evaluated before elements of its level start, and before events start, so that it observes these
        starts as changes, independently of the order in the file. Events start in this order.
        """
        events: list[StoryElement] = []
        while elements:
            triggered = [element for element in elements if element.is_start_triggered()]
            events += [element for element in triggered if element.kind == "event"]
            parents = [element for element in triggered if element.kind != "event"]
            for element in parents:
                element.start(element.start_reason)
            elements = [child for element in parents for child in element.elements]
        for event in sorted(events, key=lambda event: event.record.number):
            event.start(event.start_reason)

    def update_children(self) -> None:
        """Update the running actions. From the first change of a state on, other elements may be complete as well."""
        progress, version = self.context.progress, self.context.progress.version
        if self._updated == version:
            for action in self._running_actions:
                action.update_children()
                if progress.version != version:
                    break
            else:
                return
        super().update_children()
        self._updated = version

    def complete_if_done(self) -> None:
        """End with the last story if the storyboard has no stop trigger."""
        if self.stop_leaf is None:
            super().complete_if_done()


class StoryNode(StoryElement):
    """Story of the standard."""

    kind = "story"


@dataclass
class TriggeringEntities:
    """Entities that fulfilled the start trigger of an act; groups may select them as actors (1.3.1, 7.3.1).

    candidates  entities of the conditions of the trigger
    """

    candidates: tuple[str, ...] = ()
    names: tuple[str, ...] = ()


class ActElement(StoryElement):
    """Act of the standard."""

    kind = "act"

    def __init__(
        self,
        context: RuntimeContext,
        path: tuple[str, ...],
        groups: Sequence[ManeuverGroupElement],
        *,
        start: WaitForTrigger | None = None,
        stop: WaitForTrigger | None = None,
        triggering: TriggeringEntities | None = None,
    ) -> None:
        super().__init__(context, path, groups, start=start, stop=stop)
        self._triggering = triggering or TriggeringEntities()

    def start(self, why: str = "") -> None:
        """Enter runningState and store the triggering entities."""
        if self.start_leaf is not None:
            self._triggering.names = self.start_leaf.trigger.triggering
        super().start(why)


class ManeuverGroupElement(StoryElement):
    """ManeuverGroup of the standard: actors of its maneuvers."""

    kind = "maneuverGroup"


class ManeuverElement(StoryElement):
    """Maneuver of the standard: events with priorities."""

    kind = "maneuver"
