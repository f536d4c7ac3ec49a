"""Events and their actions: priorities, actors, and who holds which domain."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from eidrive_scenario.storyboard.behaviour import ActionBehaviour
from eidrive_scenario.storyboard.elements import StoryElement
from eidrive_scenario.storyboard.stage import Holder, Stage
from eidrive_scenario.storyboard.states import State, Transition
from eidrive_scenario.storyboard.trigger import WaitFor


class EventElement(StoryElement):
    """An Event: actions that start together by its trigger.

    Its priority says what becomes of the running events of the same maneuver: `override` (before 1.2 `overwrite`)
    stops them, `skip` lets them run and skips this one, `parallel` lets all run.
    """

    kind = "event"

    def __init__(
        self,
        stage: Stage,
        path: tuple[str, ...],
        actions: Sequence[ActionElement],
        *,
        priority: str,
        start: WaitFor | None = None,
        limit: int = 1,
    ) -> None:
        super().__init__(stage, path, actions, start=start, limit=limit)
        self.priority = priority
        self.rivals: tuple[EventElement, ...] = ()
        """The other events of the maneuver."""

    def begin(self, why: str = "") -> None:
        """Start by priority."""
        running = [rival for rival in self.rivals if rival.state is State.RUNNING]
        if running and self.priority == "skip":
            self._change(Transition.SKIP, State.STANDBY, f"{running[0].name} is running")
            return
        if self.priority in ("override", "overwrite"):
            for rival in running:
                rival.overridden(self.name)
        self.executions += 1
        self._change(Transition.START, State.RUNNING, why)
        for action in self.elements:
            if isinstance(action, ActionElement):
                action.start_for(self.start_leaf.trigger.triggering if self.start_leaf is not None else ())

    def overridden(self, by: str) -> None:
        """Another event of the maneuver took over; where this one may be executed again, it stands by for that."""
        self.halt(f"{by} overrides it")
        if self.executions < self.limit:
            self._arm()


class ActionElement(StoryElement):
    """An Action: one behaviour per actor. `make(actor)` builds them, as the actors may be known only at the start."""

    kind = "action"

    def __init__(
        self,
        stage: Stage,
        path: tuple[str, ...],
        make: Callable[[str | None], list[ActionBehaviour]],
        actors: Sequence[str | None],
        *,
        by_trigger: bool = False,
    ) -> None:
        super().__init__(stage, path)
        self._make = make
        self.by_trigger = by_trigger
        self._made: dict[str | None, list[ActionBehaviour]] = {}
        self.actors = tuple(actors)
        self.running: list[ActionBehaviour] = []
        for actor in self.actors:
            self.add_children(list(self.behaviours(actor)))

    def behaviours(self, actor: str | None) -> list[ActionBehaviour]:
        """The behaviours for one actor."""
        if actor not in self._made:
            self._made[actor] = self._make(actor)
        return self._made[actor]

    def start_for(self, triggering: Sequence[str]) -> None:
        """Start for the actors of the group, or for the entities that fulfilled the trigger."""
        actors: Sequence[str | None] = self.actors
        if self.by_trigger:
            actors = tuple(dict.fromkeys([*actors, *triggering]))
        self.running = [behaviour for actor in actors for behaviour in self.behaviours(actor)]
        self.stand_by()
        self.executions += 1
        self._change(Transition.START, State.RUNNING)
        for behaviour in self.running:
            behaviour.stop(Status.INVALID)
            self.stage.occupy(behaviour.actor_name, behaviour.controls, self, behaviour)
            if behaviour.immediate:
                behaviour.tick_once()
        self.running = [behaviour for behaviour in self.running if behaviour.status is not Status.SUCCESS]
        if not self.running and not actors:
            self._change(Transition.END, State.COMPLETE)

    def displace(self, behaviour: Holder, why: str) -> None:
        """A younger action took the domain of this behaviour."""
        for held in self.running:
            if held is behaviour:
                held.stop(Status.INVALID)
        self.running = [other for other in self.running if other is not behaviour]
        if not self.running and self.state is State.RUNNING:
            self._change(Transition.STOP, State.COMPLETE, why)

    def halt(self, why: str = "") -> None:
        """Stop all its behaviours."""
        for behaviour in self.running:
            behaviour.stop(Status.INVALID)
            self.stage.release(behaviour)
        self.running = []
        self._change(Transition.STOP, State.COMPLETE, why)
        self.status = Status.INVALID

    def tick(self) -> Iterator[Behaviour]:
        """The behaviours decide; the last one done, so is the action."""
        self.status = Status.RUNNING
        for behaviour in tuple(self.running):
            yield from behaviour.tick()
            if behaviour.status is not Status.RUNNING:
                self.running.remove(behaviour)
                self.stage.release(behaviour)
        if not self.running and self.state is State.RUNNING:
            self._change(Transition.END, State.COMPLETE)
        if self.state is State.COMPLETE:
            self.status = Status.SUCCESS
        yield self
