"""Construction of the tree: elements, triggers, and registered actions and conditions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from copy import deepcopy
from dataclasses import dataclass

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Composite

from eidrive_scenario.errors import Diagnostic, RegistryError, ScenarioError, suggestion
from eidrive_scenario.extensions.registry import Registry, construct
from eidrive_scenario.openscenario import Scenario, model
from eidrive_scenario.openscenario.conventions import without_criteria
from eidrive_scenario.storyboard.context.behaviour import ActionBehaviour
from eidrive_scenario.storyboard.context.condition import Condition, EntityCondition
from eidrive_scenario.storyboard.context.contexts import EntityAbsentError, EntityUnavailableError
from eidrive_scenario.storyboard.context.runtime_context import RuntimeContext
from eidrive_scenario.storyboard.state.element_states import Domain
from eidrive_scenario.storyboard.tree.elements import (
    ActElement,
    ManeuverElement,
    ManeuverGroupElement,
    StoryboardElement,
    StoryNode,
    TriggeringEntities,
)
from eidrive_scenario.storyboard.tree.events import ActionElement, EventElement
from eidrive_scenario.storyboard.tree.selections import AnyMemberCondition, Selections
from eidrive_scenario.storyboard.tree.trigger import ConditionEvaluator, ConditionGroup, Trigger, WaitForTrigger


class InitBlock(Composite):
    """Actions of Init. Those that take time run until they end or another action acquires their domain."""

    def __init__(self, context: RuntimeContext, behaviours: Sequence[ActionBehaviour]) -> None:
        super().__init__("Init", list(behaviours))
        self.context = context
        self.actions = tuple(behaviours)
        self.running: list[ActionBehaviour] = list(behaviours)

    def start(self) -> None:
        """Execute the actions before the first view, in the order of the file.

        An action that refers to an entity that a later action places is executed after it, and one that reads the speed
        of an entity after the actions that set it; the actions of its actor on the same domain that follow it wait,
        too. Raise ScenarioError for cyclic references of positions.
        """
        pending, reads_speeds = list(self.running), False
        while pending:
            blocked: list[ActionBehaviour] = []
            for number, behaviour in enumerate(pending, 1):
                reference = None if reads_speeds else behaviour.speed_reference
                later = [*blocked, *pending[number:]] if reference is not None else ()
                awaits_speed = any(
                    other.actor_name == reference and other.controls & Domain.LONGITUDINAL for other in later
                )
                name, is_blocked = behaviour.actor_name, awaits_speed
                if name is not None and behaviour.actor.present:
                    is_blocked |= any(
                        other.actor_name == name and other.controls & behaviour.controls for other in blocked
                    )
                if is_blocked or not self._start_behaviour(behaviour):
                    blocked.append(behaviour)
            if len(blocked) == len(pending) and reads_speeds:
                raise blocked[0].error(
                    "the position refers to an entity without a position", "place that entity in Init"
                )
            # Speeds that refer to each other in a cycle are read in the order of the file.
            pending, reads_speeds = blocked, len(blocked) == len(pending)
        for behaviour in self.running:
            behaviour.finish_init()

    def _start_behaviour(self, behaviour: ActionBehaviour) -> bool:
        try:
            behaviour.tick_checked()
        except EntityAbsentError:
            behaviour.stop(Status.INVALID)
            return False
        if behaviour.status is Status.RUNNING:
            self.context.acquire_domain(behaviour.actor_name, behaviour.controls, self, behaviour)
        else:
            self.running.remove(behaviour)
        return True

    def linked_behaviours(self, behaviour: ActionBehaviour) -> Sequence[ActionBehaviour]:
        """Return the behaviours of the same action, several for an entity selection."""
        return [other for other in self.running if other.action is behaviour.action]

    def preempt(self, behaviour: ActionBehaviour, why: str) -> None:
        """Stop a behaviour whose domain another action acquired."""
        if behaviour in self.running:
            behaviour.stop(Status.INVALID)
            self.running.remove(behaviour)

    def tick(self) -> Iterator[Behaviour]:
        """Tick once; the interface of py_trees."""
        self.tick_once()
        yield self

    def tick_once(self) -> None:
        """Update the running behaviours."""
        is_first = self.status is Status.INVALID
        for behaviour in tuple(self.running):
            if is_first and behaviour.is_actor_missing:
                continue  # The actor may enter the world at this instant.
            try:
                if behaviour.is_actor_missing:
                    behaviour.check_actor()
                behaviour.tick_checked()
            except EntityUnavailableError as unavailable:
                behaviour.abort(unavailable)
            if behaviour.status is not Status.RUNNING:
                self.running.remove(behaviour)
                self.context.release_domains(behaviour)
        self.status = Status.RUNNING if self.running else Status.SUCCESS


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
"""Types that only wrap actions."""

ElementPath = tuple[str, ...]


@dataclass(frozen=True)
class ActorBindings:
    """Actors of a maneuver group, its entity selections, and the triggering entities of its act."""

    actors: Sequence[str]
    selections: Sequence[Sequence[str]]
    triggering: TriggeringEntities | None


class Builder:
    """Builder of one storyboard. It collects diagnostics, which `build` raises together."""

    def __init__(self, scenario: Scenario, context: RuntimeContext, actions: Registry, conditions: Registry) -> None:
        self._scenario = scenario
        self._context = context
        self._actions = actions
        self._conditions = conditions
        self._diagnostics: list[Diagnostic] = []
        self._is_built = False
        self._built: list[Condition] = []
        self.extensions: set[tuple[str, str]] = set()
        """Group and name of each action and condition of the storyboard."""
        self._selections = Selections(scenario)

    def build(self) -> tuple[InitBlock, StoryboardElement]:
        """Return the actions of Init and the tree. Raise ScenarioError with all elements that are not executable."""
        storyboard = self._scenario.storyboard
        init = InitBlock(self._context, self._init(storyboard.init.actions))
        stories = [self._story(story) for story in storyboard.story]
        trigger = storyboard.stop_trigger
        stop = self._wait("stop", without_criteria(trigger) if trigger is not None else None)
        root = StoryboardElement(self._context, ("storyboard",), stories, stop=stop)
        for condition in self._built:
            with self._collecting_errors():
                condition.bind(self._context)
        self._diagnostics += self._context.signals.errors
        if self._diagnostics:
            raise ScenarioError(sorted(dict.fromkeys(self._diagnostics), key=lambda p: (p.source, p.line or 0)))
        self._is_built = True
        return init, root

    def _init(self, actions: model.InitActions) -> list[ActionBehaviour]:
        behaviours: list[ActionBehaviour] = []
        for wrapper in (*actions.global_action, *actions.user_defined_action):
            behaviours += self._behaviours(wrapper, None)
        by_actor: dict[str, list[ActionBehaviour]] = {}
        for private in actions.private:
            for actor in self._entities(private.entity_ref):
                for action in private.private_action:
                    by_actor.setdefault(actor, []).extend(self._behaviours(action, actor))
        for own in by_actor.values():
            behaviours += sorted(own, key=_phase_of_init)
        return behaviours

    def _story(self, story: model.Story) -> StoryNode:
        path = (story.name,)
        return StoryNode(self._context, path, [self._act(act, path) for act in story.act])

    def _act(self, act: model.Act, parents: ElementPath) -> ActElement:
        path = (*parents, act.name)
        conditions = act.start_trigger.walk() if act.start_trigger is not None else ()
        named = [element for element in conditions if isinstance(element, model.TriggeringEntities)]
        candidates = [
            name for entities in named for ref in entities.entity_ref for name in self._entities(ref.entity_ref)
        ]
        triggering = TriggeringEntities(tuple(dict.fromkeys(candidates)))
        return ActElement(
            self._context,
            path,
            [self._group(group, path, triggering) for group in act.maneuver_group],
            start=self._wait("start", act.start_trigger),
            stop=self._wait("stop", act.stop_trigger),
            triggering=triggering,
        )

    def _group(
        self, group: model.ManeuverGroup, parents: ElementPath, triggering: TriggeringEntities
    ) -> ManeuverGroupElement:
        path = (*parents, group.name)
        members = [self._entities(ref.entity_ref) for ref in group.actors.entity_ref]
        actors = list(dict.fromkeys(name for names in members for name in names))
        selected = triggering if group.actors.select_triggering_entities else None
        bindings = ActorBindings(actors, [names for names in members if len(names) > 1], selected)
        maneuvers = list(group.maneuver)
        scope = self._scenario.scope
        shared = {id(parameter): parameter for parameter in scope.parameters.values()} if scope is not None else {}
        for reference in group.catalog_reference:
            with self._collecting_errors():
                maneuver = self._context.catalog_entry(reference, model.Maneuver, group)
                # Equal references have the same entry, but each use has its own parameters, beside the scenario's.
                maneuvers.append(deepcopy(maneuver, dict(shared)) if maneuver.parameter_declarations else maneuver)
        children = [self._maneuver(maneuver, path, bindings) for maneuver in maneuvers]
        return ManeuverGroupElement(self._context, path, children, limit=group.maximum_execution_count)

    def _maneuver(self, maneuver: model.Maneuver, parents: ElementPath, bindings: ActorBindings) -> ManeuverElement:
        path = (*parents, maneuver.name)
        events = tuple(self._event(event, path, bindings) for event in maneuver.event)
        EventElement.resolve_priorities(events)
        return ManeuverElement(self._context, path, events)

    def _event(self, event: model.Event, parents: ElementPath, bindings: ActorBindings) -> EventElement:
        path = (*parents, event.name)
        limit = 1 if event.maximum_execution_count is None else event.maximum_execution_count
        return EventElement(
            self._context,
            path,
            [self._action(action, path, bindings) for action in event.action],
            priority=event.priority.value,
            start=self._wait("start", event.start_trigger),
            limit=limit,
        )

    def _action(self, action: model.Action, parents: ElementPath, bindings: ActorBindings) -> ActionElement:
        private = action.private_action is not None
        return ActionElement(
            self._context,
            (*parents, action.name),
            lambda actor: self._behaviours(action, actor),
            bindings.actors if private else (None,),
            selections=bindings.selections,
            triggering=bindings.triggering if private else None,
        )

    def _behaviours(self, wrapper: model.Element, actor: str | None) -> list[ActionBehaviour]:
        behaviours = []
        for leaf, parent in _leaves(wrapper, wrapper):
            name = self._registered_name(leaf, self._actions)
            if name is None:
                continue
            with self._collecting_errors():
                make, element = self._actions.load(name, ActionBehaviour), self._selections.single(leaf)
                for parent_element in [element] if parent is leaf else self._selections.alternatives(parent):
                    behaviour = construct(make, element, self._context, actor=actor, parent=parent_element)
                    if not isinstance(behaviour, ActionBehaviour):
                        raise RegistryError(f"{self._actions.describe(name)} is not a subclass of ActionBehaviour")
                    behaviours.append(behaviour)
        return behaviours

    def _wait(self, name: str, trigger: model.Trigger | None) -> WaitForTrigger | None:
        if trigger is None or not trigger.condition_group:
            return None
        groups = []
        for group in trigger.condition_group:
            evaluators = []
            for element in group.condition:
                with self._collecting_errors():
                    condition = self._build_condition(element)
                    if condition is not None:
                        self._built.append(condition)
                        edge = element.condition_edge.value
                        evaluators.append(
                            ConditionEvaluator(condition, name=element.name, edge=edge, delay=element.delay)
                        )
            groups.append(ConditionGroup(tuple(evaluators)))
        return WaitForTrigger(name, Trigger(groups), self._context)

    def _build_condition(self, element: model.Condition) -> Condition | None:
        by_entity = element.by_entity_condition
        leaf = (element.chosen() if by_entity is None else by_entity.entity_condition).chosen()
        name = self._registered_name(leaf, self._conditions)
        if name is None:
            return None
        make = self._conditions.load(name, Condition)
        base = Condition if by_entity is None else EntityCondition
        type_error = RegistryError(f"{self._conditions.describe(name)} is not a subclass of {base.__name__}")
        if by_entity is None:
            condition = construct(make, leaf)
            if not isinstance(condition, Condition):
                raise type_error
            return condition
        triggering = by_entity.triggering_entities
        entities = [entity for ref in triggering.entity_ref for entity in self._entities(ref.entity_ref)]
        rule = triggering.triggering_entities_rule.value
        conditions = [construct(make, member, entities, rule) for member in self._selections.alternatives(leaf)]
        if not all(isinstance(condition, EntityCondition) for condition in conditions):
            raise type_error
        return conditions[0] if len(conditions) == 1 else AnyMemberCondition(leaf, entities, rule, conditions)

    def _registered_name(self, leaf: model.Element, registry: Registry) -> str | None:
        """Return the registered name of an action or condition: its type, or the name of a user-defined one.

        Add a diagnostic and return None if it is not registered.
        """
        own_name = {model.CustomCommandAction: "type", model.UserDefinedValueCondition: "name"}.get(type(leaf))
        name = getattr(leaf, own_name) if own_name is not None else None
        if name is None or name not in registry:
            name = type(leaf).__name__
        if name in registry:
            self.extensions.add((registry.kind, name))
            return str(name)
        hint = f"remove it, or install a package that registers it; {suggestion(name, registry)}"
        self._diagnostics.append(Diagnostic.at(leaf, f"{name} is not supported", hint))
        return None

    def _entities(self, name: str) -> list[str]:
        """Return the entity of this name, or the members of the selection of this name."""
        members: list[str] = []
        with self._collecting_errors():
            members = self._selections.members(name)
        return members

    @contextmanager
    def _collecting_errors(self) -> Iterator[None]:
        """Store the diagnostics of a ScenarioError, which ends the block. During the run it is raised."""
        try:
            yield
        except ScenarioError as error:
            if self._is_built:
                raise
            self._diagnostics += error.diagnostics


def _phase_of_init(behaviour: ActionBehaviour) -> int:
    """Return the order of an action of Init: state of its actor, lateral steps from there, motion over time."""
    return behaviour.moves_over_time + (behaviour.moves_over_time and not behaviour.at_once)


def _leaves(element: model.Element, parent: model.Element) -> Iterator[tuple[model.Element, model.Element]]:
    """Yield wrapped actions with their parent elements. Before 1.3 a ControllerAction may hold several actions."""
    if not isinstance(element, WRAPPERS):
        yield element, parent
        return
    for child in element.children():
        yield from _leaves(child, element)
