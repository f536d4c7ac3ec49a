"""Events and actions: priorities, actors and control domains."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence
from itertools import takewhile

from py_trees.common import Status

from eidrive_scenario.storyboard.context.behaviour import ActionBehaviour
from eidrive_scenario.storyboard.context.contexts import EntityUnavailableError
from eidrive_scenario.storyboard.context.runtime_context import RuntimeContext
from eidrive_scenario.storyboard.state.element_states import ElementState, ElementTransition
from eidrive_scenario.storyboard.tree.elements import RunningAction, StoryElement, TriggeringEntities
from eidrive_scenario.storyboard.tree.trigger import Trigger, WaitForTrigger


class EventElement(StoryElement):
    """Event: actions that start together by its trigger.

    Its priority determines the effect on running events of the same maneuver (ASAM OpenSCENARIO XML 1.3.1, 8.4.2):

    - `override` (before 1.2 `overwrite`) stops them, regardless of their remaining executions.
    - `skip` skips this event, which counts as one of its executions.
    - `parallel` has no effect on them.
    """

    kind = "event"

    def __init__(
        self,
        context: RuntimeContext,
        path: tuple[str, ...],
        actions: Sequence[ActionElement],
        *,
        priority: str,
        start: WaitForTrigger | None = None,
        limit: int = 1,
    ) -> None:
        super().__init__(context, path, actions, start=start, limit=limit)
        self._actions = tuple(actions)
        self.priority = priority
        self._running: dict[EventElement, None] = {}
        """Running events of the maneuver, in order of their starts."""

    def start(self, why: str = "") -> None:
        """Start or skip the event by its priority."""
        self._tried_at = self.context.progress.tick
        alone = self.priority == "parallel"
        running = [] if alone else list(self._running)
        if running and self.priority == "skip":
            self.executions += 1
            after = ElementState.STANDBY if self.executions < self.limit else ElementState.COMPLETE
            self._change(ElementTransition.SKIP, after, f"{running[0].name} is running")
            return
        if self.priority in ("override", "overwrite"):
            for event in running:
                event.stop_element(f"overridden by {self.name}")
        self.executions += 1
        self._change(ElementTransition.START, ElementState.RUNNING, why)
        # Those that take no time are executed first
        for action in sorted(self._actions, key=lambda action: action.takes_time):
            action.start()

    def _change(self, transition: ElementTransition | None, after: ElementState, why: str = "") -> None:
        super()._change(transition, after, why)
        if after is ElementState.RUNNING:
            self._running[self] = None
        else:
            self._running.pop(self, None)

    @staticmethod
    def resolve_priorities(events: Iterable[EventElement]) -> None:
        """Let the priorities of these events apply to each other."""
        running: dict[EventElement, None] = {}
        for event in events:
            event._running = running


class ActionElement(StoryElement):
    """Action: one behaviour per actor. `make(actor)` builds them, for all entities that its act may select.

    `selections` are the entity selections among the actors, whose members lose their domains together.
    """

    kind = "action"

    def __init__(
        self,
        context: RuntimeContext,
        path: tuple[str, ...],
        make: Callable[[str | None], list[ActionBehaviour]],
        actors: Sequence[str | None],
        *,
        triggering: TriggeringEntities | None = None,
        selections: Sequence[Collection[str]] = (),
    ) -> None:
        super().__init__(context, path)
        self._make = make
        self._selections = selections
        self.triggering = triggering
        """Triggering entities that are additional actors."""
        self._behaviours: dict[str | None, list[ActionBehaviour]] = {}
        self.actors = tuple(actors)
        self.running: list[ActionBehaviour] = []
        self._completing: list[ActionBehaviour] = []
        """Behaviours that reach their goals in the current step; they hold their domains until its end."""
        self._awaiting: dict[ActionBehaviour, EntityUnavailableError] = {}
        """Behaviours that start at this instant and await an entity that may enter the world, or be
        disconnected, at this instant."""
        self._decided_at: int | None = None
        self._sets_value = False
        for actor in self.actors:
            self.add_children(list(self.behaviours(actor)))
        for name in triggering.candidates if triggering is not None else ():
            self.behaviours(name)

    def behaviours(self, actor: str | None) -> list[ActionBehaviour]:
        """Return the behaviours of one actor."""
        if actor not in self._behaviours:
            self._behaviours[actor] = self._make(actor)
        return self._behaviours[actor]

    def start(self, why: str = "") -> None:
        """Enter runningState with the actors of the group and the triggering entities."""
        actors = self._selected_actors()
        self.running = [behaviour for actor in actors for behaviour in self.behaviours(actor)]
        self.enter_standby()
        self._tried_at, self._decided_at = self.context.progress.tick, None
        self._completing, self._awaiting = [], {}
        self.executions += 1
        self._change(ElementTransition.START, ElementState.RUNNING, why)
        if any(behaviour.at_once for behaviour in self.running):
            self.context.instant_actions.append(self.decide)
        for behaviour in self.running:
            behaviour.stop(Status.INVALID)
            self.context.acquire_domain(behaviour.actor_name, behaviour.controls, self, behaviour)
            if behaviour.immediate:
                self._update_behaviour(behaviour)
        for behaviour in [behaviour for behaviour in self.running if behaviour.status is Status.SUCCESS]:
            self.running.remove(behaviour)
            self.context.release_domains(behaviour)
        self._sets_value = all(behaviour.immediate for behaviour in self.running)
        if not self.running and not actors:
            self._change(ElementTransition.END, ElementState.COMPLETE)

    def linked_behaviours(self, behaviour: ActionBehaviour) -> Sequence[ActionBehaviour]:
        """Return the behaviours of the actor and of the entity selections that contain it or each other's members."""
        names, count = {behaviour.actor_name}, 0
        while len(names) > count:
            count = len(names)
            names.update(*(members for members in self._selections if not names.isdisjoint(members)))
        return [other for other in self.running if other.actor_name in names]

    @property
    def takes_time(self) -> bool:
        """Whether one of its behaviours does not end at its start."""
        return not all(other.at_once for actor in self._selected_actors() for other in self.behaviours(actor))

    def _selected_actors(self) -> Sequence[str | None]:
        """Return the actors of the group and the triggering entities."""
        return tuple(dict.fromkeys([*self.actors, *(self.triggering.names if self.triggering is not None else ())]))

    def preempt(self, behaviour: ActionBehaviour, why: str) -> None:
        """Stop a behaviour whose domain another action acquired. A behaviour that takes no time is executed before."""
        done = False
        if behaviour in self.running:
            if behaviour.at_once and self._decided_at is None and self._tried_at == self.context.progress.tick:
                # A lateral step starts from the place of a TeleportAction before it
                for decide in list(takewhile(self.decide.__ne__, self.context.instant_actions)):
                    decide()
                self._update_behaviour(behaviour)
                done = behaviour.status is Status.SUCCESS
            behaviour.stop(Status.INVALID)
        self.running = [other for other in self.running if other is not behaviour]
        self._completing = [other for other in self._completing if other is not behaviour]
        self._awaiting.pop(behaviour, None)
        if not self.running and self.state is ElementState.RUNNING:
            if done:
                self._change(ElementTransition.END, ElementState.COMPLETE)
            else:
                self._change(ElementTransition.STOP, ElementState.COMPLETE, why)

    def stop_element(self, why: str = "") -> None:
        """Stop all behaviours."""
        for behaviour in self.running:
            behaviour.stop(Status.INVALID)
            self.context.release_domains(behaviour)
        self.running, self._completing, self._awaiting = [], [], {}
        self._change(ElementTransition.STOP, ElementState.COMPLETE, why)
        self.status = Status.INVALID

    def complete_finished(self) -> None:
        """End the behaviours that reached their goals in the last step; end the action with the last one."""
        if self.state is ElementState.RUNNING:
            completing, self._completing = self._completing, []
            self._end_behaviours(completing)

    def list_active(self, awaited: list[tuple[StoryElement, Trigger]], actions: list[RunningAction]) -> None:
        """Add the action to the running ones if it is running."""
        if self.record.state is ElementState.RUNNING:
            actions.append(self)

    def update_children(self) -> None:
        """Update the behaviours of an action that only sets a value."""
        self.status = Status.RUNNING
        if self._sets_value:
            self.decide()
        if self.state is ElementState.COMPLETE:
            self.status = Status.SUCCESS

    def decide(self) -> None:
        """Update the behaviours once per tick; those that reach their goals end at the end of the step."""
        now = self.context.progress.tick
        if self._decided_at != now:
            self._decided_at = now
            self._update_all(self.running)
        elif self._awaiting:
            self._update_all(list(self._awaiting))

    def _update_all(self, behaviours: Sequence[ActionBehaviour]) -> None:
        done: list[ActionBehaviour] = []
        for behaviour in tuple(behaviours):
            self._update_behaviour(behaviour)
            if behaviour.status is Status.SUCCESS or behaviour.status is Status.FAILURE:
                (done if behaviour.immediate else self._completing).append(behaviour)
        if self._completing:
            self.context.completes_this_step = True
        self._end_behaviours(done)

    def _update_behaviour(self, behaviour: ActionBehaviour) -> None:
        if self._awaiting:
            self._awaiting.pop(behaviour, None)
        try:
            if behaviour.status is not Status.RUNNING:
                behaviour.check_actor()
            behaviour.tick_checked()
        except EntityUnavailableError as unavailable:
            if self._tried_at == self.context.progress.tick:
                behaviour.stop(Status.INVALID)
                self._awaiting[behaviour] = unavailable
                self.context.pending_actions.append(self.abort)
            else:
                self._abort_behaviour(behaviour, unavailable)

    def abort(self) -> None:
        """Stop the behaviours whose entity is still unavailable at this instant."""
        awaiting, self._awaiting = self._awaiting, {}
        for behaviour, unavailable in awaiting.items():
            self._abort_behaviour(behaviour, unavailable)

    def _abort_behaviour(self, behaviour: ActionBehaviour, unavailable: EntityUnavailableError) -> None:
        why = behaviour.abort(unavailable)
        self.context.release_domains(behaviour)
        self.preempt(behaviour, why)

    def _end_behaviours(self, done: Sequence[ActionBehaviour]) -> None:
        for behaviour in done:
            self.running.remove(behaviour)
            self.context.release_domains(behaviour)
        if not self.running and self.state is ElementState.RUNNING:
            self._change(ElementTransition.END, ElementState.COMPLETE)
