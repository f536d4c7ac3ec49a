"""Events and their actions: priorities, actors, and who holds which domain."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence

from py_trees.common import Status

from eidrive_scenario.storyboard.context.behaviour import ActionBehaviour
from eidrive_scenario.storyboard.context.preemption import DomainHolder
from eidrive_scenario.storyboard.context.protocols import EntityAbsentError
from eidrive_scenario.storyboard.context.runtime_context import RuntimeContext
from eidrive_scenario.storyboard.state.states import ElementState, ElementTransition
from eidrive_scenario.storyboard.tree.elements import StoryElement, TriggeringEntities
from eidrive_scenario.storyboard.tree.trigger import WaitForTrigger


class EventElement(StoryElement):
    """An Event: actions that start together by its trigger.

    Its priority says what becomes of the running events of the same maneuver: `override` (before 1.2 `overwrite`)
    stops them, however many executions they have left, `skip` lets them run and skips this one, which counts as one of
    its executions, `parallel` lets all run (ASAM OpenSCENARIO XML 1.3.1, 8.4.2).
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
        self.priority = priority
        self._running: dict[EventElement, None] = {}
        """The running events of the maneuver, in the order in which they started."""

    def start(self, why: str = "") -> None:
        """Start by priority."""
        self._tried_at = self.context.progress.tick
        alone = self.priority == "parallel"
        running = [] if alone else list(self._running)
        if running and self.priority == "skip":
            self.executions += 1
            after = ElementState.STANDBY if self.executions < self.limit else ElementState.COMPLETE
            self._change(ElementTransition.SKIP, after, f"{running[0].name} is running")
            return
        if self.priority in ("override", "overwrite"):
            for rival in running:
                rival.stop_element(f"{self.name} overrides it")
        self.executions += 1
        self._change(ElementTransition.START, ElementState.RUNNING, why)
        for action in sorted(self.elements, key=_takes_time):
            action.start()

    def _change(self, transition: ElementTransition | None, after: ElementState, why: str = "") -> None:
        super()._change(transition, after, why)
        if after is ElementState.RUNNING:
            self._running[self] = None
        else:
            self._running.pop(self, None)

    @staticmethod
    def resolve_priorities(events: Iterable[EventElement]) -> None:
        """Let the priorities of these events count against each other."""
        running: dict[EventElement, None] = {}
        for event in events:
            event._running = running


class ActionElement(StoryElement):
    """An Action: one behaviour per actor. `make(actor)` builds them, as the actors may be known only at the start.

    `selections` are the groups among the actors: of these it loses its domains together.
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
        """Who acts beside the actors."""
        self._made: dict[str | None, list[ActionBehaviour]] = {}
        self.actors = tuple(actors)
        self.running: list[ActionBehaviour] = []
        self._there: list[ActionBehaviour] = []
        """Those that the step which goes on brings to their goal; they hold their domains until they are there."""
        self._waiting: dict[DomainHolder, tuple[ActionBehaviour, EntityAbsentError]] = {}
        """Those that start at this instant, but for somebody who is not in the world, and may be when all is done."""
        self._decided_at: int | None = None
        for actor in self.actors:
            self.add_children(list(self.behaviours(actor)))

    def behaviours(self, actor: str | None) -> list[ActionBehaviour]:
        """The behaviours for one actor."""
        if actor not in self._made:
            self._made[actor] = self._make(actor)
        return self._made[actor]

    def start(self, why: str = "") -> None:
        """standby -> running, for the actors of the group and those whom it selects."""
        actors = self.actors
        if self.triggering is not None:
            actors = tuple(dict.fromkeys([*actors, *self.triggering.names]))
        self.running = [behaviour for actor in actors for behaviour in self.behaviours(actor)]
        self.enter_standby()
        self._tried_at, self._decided_at = self.context.progress.tick, None
        self._there, self._waiting = [], {}
        self.executions += 1
        self._change(ElementTransition.START, ElementState.RUNNING, why)
        for behaviour in self.running:
            behaviour.stop(Status.INVALID)
            self.context.acquire_domain(behaviour.actor_name, behaviour.controls, self, behaviour)
            if behaviour.immediate:
                self._let_decide(behaviour)
        for behaviour in [behaviour for behaviour in self.running if behaviour.status is Status.SUCCESS]:
            self.running.remove(behaviour)
            self.context.release_domains(behaviour)
        if not self.running and not actors:
            self._change(ElementTransition.END, ElementState.COMPLETE)

    def linked_behaviours(self, behaviour: DomainHolder) -> Sequence[DomainHolder]:
        """That one, and those of the entities with which its actor forms a selection among the actors."""
        names = {held.actor_name for held in self.running if held is behaviour}
        for members in self._selections:
            if not names.isdisjoint(members):
                names |= set(members)
        return [held for held in self.running if held.actor_name in names]

    @property
    def takes_time(self) -> bool:
        """Whether any of its behaviours lasts longer than the instant at which it starts."""
        return not all(held.at_once for actor in self.actors for held in self.behaviours(actor))

    def preempt(self, behaviour: DomainHolder, why: str) -> None:
        """A younger action took the domain of this behaviour. One that takes no time has its effect before that."""
        done = False
        for held in self.running:
            if held is behaviour:
                if held.at_once and self._decided_at is None and self._tried_at == self.context.progress.tick:
                    self._let_decide(held)
                    done = held.status is Status.SUCCESS
                held.stop(Status.INVALID)
        self.running = [other for other in self.running if other is not behaviour]
        self._there = [other for other in self._there if other is not behaviour]
        self._waiting.pop(behaviour, None)
        if not self.running and self.state is ElementState.RUNNING:
            if done:
                self._change(ElementTransition.END, ElementState.COMPLETE)
            else:
                self._change(ElementTransition.STOP, ElementState.COMPLETE, why)

    def stop_element(self, why: str = "") -> None:
        """Stop all its behaviours."""
        for behaviour in self.running:
            behaviour.stop(Status.INVALID)
            self.context.release_domains(behaviour)
        self.running, self._there, self._waiting = [], [], {}
        self._change(ElementTransition.STOP, ElementState.COMPLETE, why)
        self.status = Status.INVALID

    def complete_finished(self) -> None:
        """The behaviours that the last step brought to their goal are done; the last one, and so is the action."""
        if self.state is ElementState.RUNNING:
            there, self._there = self._there, []
            self._let_go(there)

    def update_children(self) -> None:
        """The behaviours decide, once per tick; what they bring about shows at the end of the step: there they end."""
        self.status = Status.RUNNING
        now = self.context.progress.tick
        if self._decided_at != now:
            self._decided_at = now
            self._decide(self.running)
        elif self._waiting:
            self._decide([behaviour for behaviour, _ in self._waiting.values()])
        if self.state is ElementState.COMPLETE:
            self.status = Status.SUCCESS

    def _decide(self, behaviours: Sequence[ActionBehaviour]) -> None:
        done: list[ActionBehaviour] = []
        for behaviour in tuple(behaviours):
            self._let_decide(behaviour)
            if behaviour.status in (Status.SUCCESS, Status.FAILURE):
                (done if behaviour.immediate else self._there).append(behaviour)
        self.context.completes_this_step = self.context.completes_this_step or bool(self._there)
        self._let_go(done)

    def _let_decide(self, behaviour: ActionBehaviour) -> None:
        self._waiting.pop(behaviour, None)
        try:
            if behaviour.status is not Status.RUNNING and behaviour.is_actor_missing:
                raise EntityAbsentError(behaviour.actor_name)
            behaviour.tick_once()
            if behaviour.third_party or behaviour.status is Status.INVALID:
                behaviour.check_decision()
        except EntityAbsentError as who:
            if self._tried_at == self.context.progress.tick:
                behaviour.stop(Status.INVALID)
                self._waiting[behaviour] = behaviour, who
                self.context.pending_actions.append(self)
            else:
                self._abort_behaviour(behaviour, who)

    def abort(self) -> None:
        """Stop what waited in vain for somebody to enter the world at this instant."""
        waiting, self._waiting = self._waiting, {}
        for behaviour, who in waiting.values():
            self._abort_behaviour(behaviour, who)

    def _abort_behaviour(self, behaviour: ActionBehaviour, absent: EntityAbsentError) -> None:
        why = behaviour.abort(absent)
        self.context.release_domains(behaviour)
        self.preempt(behaviour, why)

    def _let_go(self, done: Sequence[ActionBehaviour]) -> None:
        for behaviour in done:
            self.running.remove(behaviour)
            self.context.release_domains(behaviour)
        if not self.running and self.state is ElementState.RUNNING:
            self._change(ElementTransition.END, ElementState.COMPLETE)


def _takes_time(action: StoryElement) -> bool:
    """Sort key: actions of one event start together, and those that take no time have their effect first."""
    return isinstance(action, ActionElement) and action.takes_time
