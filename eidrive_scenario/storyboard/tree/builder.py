"""Makes the tree from the scenario: elements, triggers, and through the registries actions and conditions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from eidrive_scenario.errors import Diagnostic, RegistryError, ScenarioError, suggestion
from eidrive_scenario.openscenario import Scenario, model
from eidrive_scenario.registry import Registry, construct
from eidrive_scenario.storyboard.context.behaviour import ActionBehaviour
from eidrive_scenario.storyboard.context.condition import Condition, EntityCondition
from eidrive_scenario.storyboard.context.runtime_context import RuntimeContext
from eidrive_scenario.storyboard.tree.elements import (
    ActElement,
    ManeuverElement,
    ManeuverGroupElement,
    StoryboardElement,
    StoryNode,
    TriggeringEntities,
)
from eidrive_scenario.storyboard.tree.events import ActionElement, EventElement
from eidrive_scenario.storyboard.tree.init_block import InitBlock
from eidrive_scenario.storyboard.tree.selections import AnyMemberCondition, Selections
from eidrive_scenario.storyboard.tree.trigger import ConditionEvaluator, ConditionGroup, Trigger, WaitForTrigger

WRAPPERS = (
    model.Action,
    model.PrivateAction,
    model.GlobalAction,
    model.UserDefinedAction,
    model.LongitudinalAction,
    model.LateralAction,
    model.RoutingAction,
    model.ControllerAction,
    model.EntityAction,
    model.ParameterAction,
    model.VariableAction,
    model.InfrastructureAction,
    model.TrafficSignalAction,
    model.TrafficAction,
    model.AppearanceAction,
    model.TrailerAction,
)
"""Types that only wrap the actions below them."""

CRITERION = "criteria_"
"""Conditions with such names in the storyboard's stop trigger are criteria, as ScenarioRunner has them."""

ElementPath = tuple[str, ...]


class ActorBindings(NamedTuple):
    """Who acts in a maneuver group: by name, each once, which of them form selections, and whom its act selects."""

    actors: Sequence[str]
    selections: Sequence[Sequence[str]]
    triggering: TriggeringEntities | None


class Builder:
    """Builds one storyboard. What is wrong with the scenario is gathered, and raised in one go by `build`."""

    def __init__(self, scenario: Scenario, context: RuntimeContext, actions: Registry, conditions: Registry) -> None:
        self._scenario = scenario
        self._context = context
        self._actions = actions
        self._conditions = conditions
        self._diagnostics: list[Diagnostic] = []
        self._made: list[Condition] = []
        self._selections = Selections(scenario)

    def build(self) -> tuple[InitBlock, StoryboardElement]:
        """The actions of Init and the tree. Raises ScenarioError with all that cannot be executed."""
        storyboard = self._scenario.storyboard
        init = InitBlock(self._context, self._init(storyboard.init.actions))
        stories = [self._story(story) for story in storyboard.story]
        stop = self._wait("stop", _without_criteria(storyboard.stop_trigger))
        root = StoryboardElement(self._context, ("storyboard",), stories, stop=stop)
        for condition in self._made:
            try:
                condition.bind(self._context)
            except ScenarioError as error:
                self._diagnostics += error.diagnostics
        self._diagnostics += self._context.signals.errors
        if self._diagnostics:
            raise ScenarioError(sorted(dict.fromkeys(self._diagnostics), key=lambda p: (p.source, p.line or 0)))
        return init, root

    def _init(self, actions: model.InitActions) -> list[ActionBehaviour]:
        behaviours: list[ActionBehaviour] = []
        for wrapper in (*actions.global_action, *actions.user_defined_action):
            behaviours += self._behaviours(wrapper, None)
        for private in actions.private:
            for actor in self._entities(private.entity_ref):
                for action in private.private_action:
                    behaviours += self._behaviours(action, actor)
        return behaviours

    def _story(self, story: model.Story) -> StoryNode:
        path = (story.name,)
        return StoryNode(self._context, path, [self._act(act, path) for act in story.act])

    def _act(self, act: model.Act, above: ElementPath) -> ActElement:
        path = (*above, act.name)
        triggering = TriggeringEntities()
        return ActElement(
            self._context,
            path,
            [self._group(group, path, triggering) for group in act.maneuver_group],
            start=self._wait("start", act.start_trigger),
            stop=self._wait("stop", act.stop_trigger),
            triggering=triggering,
        )

    def _group(
        self, group: model.ManeuverGroup, above: ElementPath, triggering: TriggeringEntities
    ) -> ManeuverGroupElement:
        path = (*above, group.name)
        members = [self._entities(ref.entity_ref) for ref in group.actors.entity_ref]
        actors = list(dict.fromkeys(name for names in members for name in names))
        selected = triggering if group.actors.select_triggering_entities else None
        cast = ActorBindings(actors, [names for names in members if len(names) > 1], selected)
        maneuvers = list(group.maneuver)
        for reference in group.catalog_reference:
            try:
                maneuvers.append(self._context.catalog_entry(reference, model.Maneuver, group))
            except ScenarioError as error:
                self._diagnostics += error.diagnostics
        children = [self._maneuver(maneuver, path, cast) for maneuver in maneuvers]
        return ManeuverGroupElement(self._context, path, children, limit=group.maximum_execution_count)

    def _maneuver(self, maneuver: model.Maneuver, above: ElementPath, cast: ActorBindings) -> ManeuverElement:
        path = (*above, maneuver.name)
        events = tuple(self._event(event, path, cast) for event in maneuver.event)
        EventElement.resolve_priorities(events)
        return ManeuverElement(self._context, path, events)

    def _event(self, event: model.Event, above: ElementPath, cast: ActorBindings) -> EventElement:
        path = (*above, event.name)
        limit = 1 if event.maximum_execution_count is None else event.maximum_execution_count
        return EventElement(
            self._context,
            path,
            [self._action(action, path, cast) for action in event.action],
            priority=event.priority.value,
            start=self._wait("start", event.start_trigger),
            limit=limit,
        )

    def _action(self, action: model.Action, above: ElementPath, cast: ActorBindings) -> ActionElement:
        private = action.private_action is not None
        return ActionElement(
            self._context,
            (*above, action.name),
            lambda actor: self._behaviours(action, actor),
            cast.actors if private else (None,),
            selections=cast.selections,
            triggering=cast.triggering if private else None,
        )

    def _behaviours(self, wrapper: model.Element, actor: str | None) -> list[ActionBehaviour]:
        behaviours = []
        for leaf, parent in _leaves(wrapper, wrapper):
            name = _registered(leaf, self._actions)
            if not self._known(name, self._actions, leaf, f"{name} is not executed yet"):
                continue
            try:
                one = self._selections.single(leaf)
                for around in [one] if parent is leaf else self._selections.alternatives(parent):
                    made = construct(
                        self._actions.load(name, ActionBehaviour), one, self._context, actor=actor, parent=around
                    )
                    if not isinstance(made, ActionBehaviour):
                        raise RegistryError(f"actions {name!r} ({self._actions.value(name)}) is no ActionBehaviour")
                    behaviours.append(made)
            except ScenarioError as error:
                self._diagnostics += error.diagnostics
        return behaviours

    def _wait(self, name: str, trigger: model.Trigger | None) -> WaitForTrigger | None:
        if trigger is None or not trigger.condition_group:
            return None
        groups = []
        for group in trigger.condition_group:
            monitors = [monitor for entry in group.condition if (monitor := self._monitor(entry)) is not None]
            groups.append(ConditionGroup(tuple(monitors)))
        return WaitForTrigger(name, Trigger(groups), self._context)

    def _monitor(self, entry: model.Condition) -> ConditionEvaluator | None:
        try:
            condition = self._condition(entry)
        except ScenarioError as error:
            self._diagnostics += error.diagnostics
            return None
        if condition is None:
            return None
        self._made.append(condition)
        return ConditionEvaluator(condition, name=entry.name, edge=entry.condition_edge.value, delay=entry.delay)

    def _condition(self, entry: model.Condition) -> Condition | None:
        by_entity = entry.by_entity_condition
        leaf = (entry.chosen() if by_entity is None else by_entity.entity_condition).chosen()
        name = _registered(leaf, self._conditions)
        if not self._known(name, self._conditions, leaf, f"{name} is not evaluated yet"):
            return None
        make = self._conditions.load(name, Condition)
        wrong = RegistryError(f"conditions {name!r} ({self._conditions.value(name)}) is no Condition of this kind")
        if by_entity is None:
            condition = construct(make, leaf)
            if not isinstance(condition, Condition):
                raise wrong
            return condition
        triggering = by_entity.triggering_entities
        names = [one for ref in triggering.entity_ref for one in self._entities(ref.entity_ref)]
        rule = triggering.triggering_entities_rule.value
        towards = [construct(make, one, names, rule) for one in self._selections.alternatives(leaf)]
        if not all(isinstance(one, EntityCondition) for one in towards):
            raise wrong
        return towards[0] if len(towards) == 1 else AnyMemberCondition(leaf, names, rule, towards)

    def _known(self, name: str, registry: Registry, leaf: model.Element, otherwise: str) -> bool:
        """Whether something of that name is registered; if not, that is a problem."""
        if name in registry:
            return True
        hint = f"take it out, or install a package that registers it; {suggestion(name, registry)}"
        self._diagnostics.append(Diagnostic(otherwise, hint, leaf.source, leaf.line))
        return False

    def _entities(self, name: str) -> list[str]:
        """The entity of this name, or the members of the selection of this name."""
        try:
            return self._selections.members(name)
        except ScenarioError as error:
            self._diagnostics += error.diagnostics
            return []


def _leaves(element: model.Element, parent: model.Element) -> Iterator[tuple[model.Element, model.Element]]:
    """The actions below wrappers, each with the element around it. Before 1.3 a ControllerAction may hold several."""
    if not isinstance(element, WRAPPERS):
        yield element, parent
        return
    for below in element.children():
        yield from _leaves(below, element)


def _without_criteria(trigger: model.Trigger | None) -> model.Trigger | None:
    if trigger is None:
        return None
    groups = []
    for group in trigger.condition_group:
        kept = tuple(entry for entry in group.condition if not entry.name.startswith(CRITERION))
        if kept:
            groups.append(model.ConditionGroup(condition=kept, line=group.line, source=group.source))
    return model.Trigger(condition_group=tuple(groups), line=trigger.line, source=trigger.source)


def _registered(leaf: model.Element, registry: Registry) -> str:
    """Under which name an action or condition is registered: its type, or what a user-defined one calls itself."""
    own = {model.CustomCommandAction: "type", model.UserDefinedValueCondition: "name"}.get(type(leaf))
    name = getattr(leaf, own) if own is not None else None
    return name if name is not None and name in registry else type(leaf).__name__
