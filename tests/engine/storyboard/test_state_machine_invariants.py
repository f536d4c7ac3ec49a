"""Invariants of the standard for storyboards with random trees, priorities, counts and triggers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from eidrive_scenario.storyboard.context.behaviour import ActionBehaviour
from eidrive_scenario.storyboard.context.runtime_context import RuntimeContext
from eidrive_scenario.storyboard.state.element_states import Domain, ElementState, ElementTransition, StateChange
from eidrive_scenario.storyboard.tree.elements import (
    ActElement,
    ManeuverElement,
    ManeuverGroupElement,
    StoryboardElement,
    StoryElement,
    StoryNode,
)
from eidrive_scenario.storyboard.tree.events import ActionElement, EventElement
from eidrive_scenario.storyboard.tree.trigger import ConditionEvaluator, ConditionGroup, Trigger, WaitForTrigger

TICKS = 14
LEGAL = {
    ElementTransition.START: {(ElementState.STANDBY, ElementState.RUNNING)},
    ElementTransition.END: {
        (ElementState.RUNNING, ElementState.COMPLETE),
        (ElementState.RUNNING, ElementState.STANDBY),
    },
    ElementTransition.STOP: {
        (ElementState.STANDBY, ElementState.COMPLETE),
        (ElementState.RUNNING, ElementState.COMPLETE),
    },
    ElementTransition.SKIP: {
        (ElementState.STANDBY, ElementState.STANDBY),
        (ElementState.STANDBY, ElementState.COMPLETE),
    },
}


@dataclass(frozen=True)
class Condition:
    values: list[bool]
    edge: str
    delay: float


@dataclass(frozen=True)
class Event:
    priority: str
    limit: int
    start: list[list[Condition]] | None
    tasks: list[tuple[int, str, Domain]]


@dataclass(frozen=True)
class Act:
    start: list[list[Condition]] | None
    stop: list[list[Condition]] | None
    groups: list[tuple[int, list[list[Event]]]]


CONDITIONS = st.builds(
    Condition,
    values=st.lists(st.booleans(), min_size=1, max_size=8),
    edge=st.sampled_from(["none", "rising", "falling", "risingOrFalling"]),
    delay=st.sampled_from([0.0, 0.0, 0.1, 0.25]),
)
TRIGGERS = st.none() | st.lists(st.lists(CONDITIONS, min_size=1, max_size=2), min_size=1, max_size=2)
DOMAINS = st.sampled_from([Domain.LONGITUDINAL, Domain.LATERAL, Domain.LONGITUDINAL | Domain.LATERAL, Domain.NONE])
EVENTS = st.builds(
    Event,
    priority=st.sampled_from(["override", "overwrite", "skip", "parallel"]),
    limit=st.integers(1, 3),
    start=TRIGGERS,
    tasks=st.lists(st.tuples(st.integers(1, 4), st.sampled_from("AB"), DOMAINS), max_size=2),
)
MANEUVERS = st.lists(st.lists(EVENTS, min_size=1, max_size=3), min_size=1, max_size=2)
GROUPS = st.lists(st.tuples(st.integers(1, 2), MANEUVERS), min_size=1, max_size=2)
ACTS = st.lists(st.builds(Act, start=TRIGGERS, stop=TRIGGERS, groups=GROUPS), min_size=1, max_size=2)


class Tree:
    """Storyboard of a plan, with its state changes."""

    def __init__(
        self, plan: list[Act], stop: list[list[Condition]] | None, context: RuntimeContext, script: Any, task: Any
    ) -> None:
        self.context, self._script, self._task = context, script, task
        self.scripts: list[Any] = []
        self.rivals: dict[str, list[str]] = {}
        """Other events of the same maneuver, by event."""
        acts = [self._act(act, f"act{number}") for number, act in enumerate(plan)]
        self.root = StoryboardElement(
            context, ("storyboard",), [StoryNode(context, ("story",), acts)], stop=self._wait(stop)
        )
        self.elements = {element.name: element for element in below(self.root)}

    def _wait(self, groups: list[list[Condition]] | None) -> WaitForTrigger | None:
        if groups is None:
            return None
        made = []
        for group in groups:
            scripts = [self._script(one.values) for one in group]
            self.scripts += scripts
            monitors = (
                ConditionEvaluator(script, edge=one.edge, delay=one.delay)
                for script, one in zip(scripts, group, strict=True)
            )
            made.append(ConditionGroup(tuple(monitors)))
        return WaitForTrigger("trigger", Trigger(made), self.context)

    def _act(self, act: Act, name: str) -> ActElement:
        groups = []
        for number, (limit, maneuvers) in enumerate(act.groups):
            path = f"{name}.{number}"
            children = [self._maneuver(events, f"{path}.{index}") for index, events in enumerate(maneuvers)]
            groups.append(ManeuverGroupElement(self.context, (path,), children, limit=limit))
        return ActElement(self.context, (name,), groups, start=self._wait(act.start), stop=self._wait(act.stop))

    def _maneuver(self, plans: list[Event], name: str) -> ManeuverElement:
        events = [self._event(plan, f"{name}.{number}") for number, plan in enumerate(plans)]
        EventElement.resolve_priorities(events)
        self.rivals |= {event.name: [other.name for other in events if other is not event] for event in events}
        return ManeuverElement(self.context, (name,), events)

    def _event(self, plan: Event, name: str) -> EventElement:
        actions = []
        for number, (ticks, actor, domain) in enumerate(plan.tasks):
            behaviour = self._task(ticks, actor=actor, domain=domain)
            behaviours: dict[str | None, list[ActionBehaviour]] = {actor: [behaviour]}
            make = behaviours.__getitem__
            actions.append(ActionElement(self.context, (f"{name}.{number}",), make, [actor]))
        return EventElement(
            self.context, (name,), actions, priority=plan.priority, start=self._wait(plan.start), limit=plan.limit
        )

    def tick(self) -> list[StateChange]:
        self.root.tick_tree()
        return list(self.context.progress.changes)


def below(element: StoryElement) -> Iterator[StoryElement]:
    yield element
    for child in element.elements:
        yield from below(child)


def play(plan: list[Act], stop: Any, fresh: Any) -> Iterator[tuple[Tree, list[StateChange]]]:
    context, clock, script, task = fresh()
    tree = Tree(plan, stop, context, script, task)
    for _ in range(TICKS):
        clock.step()
        yield tree, tree.tick()


RANDOM = settings(
    max_examples=100, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


def changes_are_legal_transitions(tree: Tree, changes: list[StateChange]) -> None:
    for change in changes:
        assert change.time == tree.context.time
        if change.transition is not None:
            assert (change.before, change.after) in LEGAL[change.transition]


def children_are_active_only_in_running_parents(tree: Tree) -> None:
    for element in tree.elements.values():
        if element.state is not ElementState.RUNNING:
            assert all(child.state is not ElementState.RUNNING for child in element.elements)
        if element.state is ElementState.COMPLETE:
            assert all(child.state is not ElementState.STANDBY for child in element.elements)


def elements_end_when_all_children_are_complete(
    tree: Tree, change: StateChange, states: dict[str, ElementState]
) -> None:
    if change.transition is ElementTransition.END:
        children = tree.elements[change.element].elements
        assert all(states.get(child.name) is ElementState.COMPLETE for child in children)


def executions_do_not_exceed_the_execution_count(tree: Tree) -> None:
    assert all(element.executions <= element.limit for element in tree.elements.values())


def priorities_apply_to_the_events_of_a_maneuver(
    tree: Tree, change: StateChange, states: dict[str, ElementState]
) -> None:
    event = tree.elements[change.element]
    if isinstance(event, EventElement):
        rivals = [states.get(rival) is ElementState.RUNNING for rival in tree.rivals[event.name]]
        if change.transition is ElementTransition.START and event.priority != "parallel":
            assert not any(rivals)
        if change.transition is ElementTransition.SKIP:
            assert event.priority == "skip"
            assert any(rivals)


def one_action_controls_a_domain_of_an_actor(tree: Tree) -> None:
    held: list[tuple[str | None, Domain]] = []
    for element in tree.elements.values():
        if isinstance(element, ActionElement) and element.state is ElementState.RUNNING:
            held += [(one.actor_name, domain) for one in element.running for domain in one.controls]
    assert len(held) == len(set(held))


def running_actions_have_running_behaviours(tree: Tree) -> None:
    for element in tree.elements.values():
        if isinstance(element, ActionElement):
            assert (element.state is ElementState.RUNNING) == bool(element.running)


@RANDOM
@given(plan=ACTS, stop=TRIGGERS)
def test_invariants_hold_at_every_tick_of_random_storyboards(plan: Any, stop: Any, fresh: Any) -> None:
    states: dict[str, ElementState] = {}
    over = False
    for number, (tree, changes) in enumerate(play(plan, stop, fresh), start=1):
        changes_are_legal_transitions(tree, changes)
        children_are_active_only_in_running_parents(tree)
        executions_do_not_exceed_the_execution_count(tree)
        one_action_controls_a_domain_of_an_actor(tree)
        running_actions_have_running_behaviours(tree)
        for change in changes:
            elements_end_when_all_children_are_complete(tree, change, states)
            priorities_apply_to_the_events_of_a_maneuver(tree, change, states)
            states[change.element] = change.after
        assert all(script.asked <= number for script in tree.scripts), "conditions are evaluated at most once per tick"
        assert not (over and changes), "a stopped storyboard does not change"
        over = over or tree.root.state is ElementState.COMPLETE


@pytest.mark.exhaustive
@RANDOM
@given(plan=ACTS, stop=TRIGGERS)
def test_equal_plans_have_equal_changes(plan: Any, stop: Any, fresh: Any) -> None:
    first = [changes for _, changes in play(plan, stop, fresh)]
    assert first == [changes for _, changes in play(plan, stop, fresh)]
