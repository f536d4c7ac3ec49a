"""The state machine of the standard: storyboard, stories, acts, maneuver groups, maneuvers, events, actions.

A tick has two phases. First the triggers judge the view (`judge`): elements stop and start, from the top down, as far
as they come. Then the running actions decide on the next step (py_trees' `tick`), and what has come to its end ends,
from the bottom up; conditions see such an end in the next tick.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Composite

from eidrive_scenario.storyboard.behaviour import ActionBehaviour
from eidrive_scenario.storyboard.progress import ElementRecord
from eidrive_scenario.storyboard.stage import Absent, Holder, Stage
from eidrive_scenario.storyboard.states import State, Transition
from eidrive_scenario.storyboard.trigger import WaitFor

EMPTY = "it has no start trigger"


class StoryElement(Composite):
    """An element with children: it starts by its trigger or with its parent, and ends when all its children have.

    `limit` is the maximumExecutionCount: having ended before it is reached, the element stands by again.
    """

    kind = ""

    def __init__(
        self,
        stage: Stage,
        path: tuple[str, ...],
        children: Sequence[StoryElement] = (),
        *,
        start: WaitFor | None = None,
        stop: WaitFor | None = None,
        limit: int = 1,
    ) -> None:
        self.start_leaf, self.stop_leaf = start, stop
        leaves: list[Behaviour] = [leaf for leaf in (start, stop) if leaf is not None]
        super().__init__(path[-1], [*leaves, *children])
        self.stage = stage
        self.elements = tuple(children)
        self.limit = limit
        self.executions = 0
        self.record: ElementRecord = stage.progress.enrol(self.kind, path)

    @property
    def state(self) -> State | None:
        """None while those above it do not run."""
        return self.record.state

    def stand_by(self) -> None:
        """Wait for the start trigger; the parent has begun to run."""
        self.executions = 0
        self._arm()

    def judge(self) -> None:
        """First phase of a tick: stop, start, and let the children do the same."""
        if self.state is State.RUNNING and self.stop_leaf is not None:
            self.stop_leaf.tick_once()
            if self.stop_leaf.status is Status.SUCCESS:
                self.halt(self.stop_leaf.trigger.why)
                return
        if self.state is State.STANDBY and self._may_start():
            self.begin(EMPTY if self.start_leaf is None else self.start_leaf.trigger.why)
        if self.state is State.RUNNING:
            for element in self.elements:
                element.judge()

    def begin(self, why: str = "") -> None:
        """standby -> running; the children stand by, or start where they have no trigger."""
        self.executions += 1
        self._change(Transition.START, State.RUNNING, why)
        for element in self.elements:
            element.stand_by()

    def halt(self, why: str = "") -> None:
        """Stop at once, with all that is below."""
        for element in self.elements:
            if element.state in (State.STANDBY, State.RUNNING):
                element.halt(why)
        self._change(Transition.STOP, State.COMPLETE, why)
        self.stop(Status.INVALID)

    def finish(self) -> None:
        """running -> complete, or standby where it may be executed again."""
        if self.executions < self.limit:
            self._change(Transition.END, State.STANDBY)
            self._arm()
        else:
            self._change(Transition.END, State.COMPLETE)

    def tick(self) -> Iterator[Behaviour]:
        """Second phase of a tick: the running children tick; all of them complete, so is this one."""
        self.status = Status.RUNNING
        if self.state is State.RUNNING:
            for element in self.elements:
                if element.state is State.RUNNING:
                    yield from element.tick()
            self.settle()
        if self.state is State.COMPLETE:
            self.status = Status.SUCCESS
        yield self

    def settle(self) -> None:
        """End if all children are complete; what has none has no end of its own, and runs until it is stopped."""
        if (
            self.state is State.RUNNING
            and self.elements
            and all(element.state is State.COMPLETE for element in self.elements)
        ):
            self.finish()

    def _arm(self) -> None:
        for leaf in (self.start_leaf, self.stop_leaf):
            if leaf is not None:
                leaf.stop(Status.INVALID)
        self._change(None, State.STANDBY)

    def _may_start(self) -> bool:
        if self.start_leaf is None:
            return True
        self.start_leaf.tick_once()
        return self.start_leaf.status is Status.SUCCESS

    def _change(self, transition: Transition | None, after: State, why: str = "") -> None:
        self.stage.progress.change(self.record, transition, after, why)


class StoryboardElement(StoryElement):
    """The root. It ends by its stop trigger; the stories' end is its own only where it has none."""

    kind = "storyboard"

    def settle(self) -> None:
        """End with the last story, if nothing else would end the storyboard."""
        if self.stop_leaf is None:
            super().settle()


class StoryNode(StoryElement):
    """A Story."""

    kind = "story"


class ActElement(StoryElement):
    """An Act."""

    kind = "act"


class ManeuverGroupElement(StoryElement):
    """A ManeuverGroup: actors for the maneuvers below."""

    kind = "maneuverGroup"


class ManeuverElement(StoryElement):
    """A Maneuver: events that know each other's priorities."""

    kind = "maneuver"


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


class InitBlock(Composite):
    """The actions of Init. Those that need time go on until they end or a younger action takes their domain."""

    def __init__(self, stage: Stage, behaviours: Sequence[ActionBehaviour]) -> None:
        super().__init__("Init", list(behaviours))
        self.stage = stage
        self.actions = tuple(behaviours)
        self.running: list[ActionBehaviour] = list(behaviours)

    def start(self) -> None:
        """Do what holds before the first view, in the order of the file.

        An action whose position refers to an entity that is placed further below waits for it. Raises ScenarioError
        where entities refer to each other in a circle.
        """
        waiting = list(self.running)
        while waiting:
            late = [behaviour for behaviour in waiting if not self._started(behaviour)]
            if len(late) == len(waiting):
                raise late[0].problem("refers to an entity that nobody places", "place that entity in Init")
            waiting = late

    def _started(self, behaviour: ActionBehaviour) -> bool:
        try:
            behaviour.tick_once()
        except Absent:
            behaviour.stop(Status.INVALID)
            return False
        if behaviour.status is Status.RUNNING:
            self.stage.occupy(behaviour.actor_name, behaviour.controls, self, behaviour)
        else:
            self.running.remove(behaviour)
        return True

    def displace(self, behaviour: Holder, why: str) -> None:
        """A younger action took the domain."""
        self.running = [other for other in self.running if other is not behaviour]

    def tick(self) -> Iterator[Behaviour]:
        """The running ones decide on the next step."""
        for behaviour in tuple(self.running):
            yield from behaviour.tick()
            if behaviour.status is not Status.RUNNING:
                self.running.remove(behaviour)
                self.stage.release(behaviour)
        self.status = Status.RUNNING if self.running else Status.SUCCESS
        yield self
