"""The state machine of the standard: storyboard, stories, acts, maneuver groups, maneuvers, events, actions.

A tick (`play`) begins with the actions that the last step brought to their goal: they end, and with them, from the
bottom up, what has nothing left to do. Then two phases take turns. The triggers judge (`judge`): elements stop and
start, from the top down, as far as they come. The running actions decide on the next step (`decide`), each once; those
that only set a value end at once. Where a phase changed a state the triggers judge again, so that a chain of elements
falls through in one tick: no transition consumes simulation time (ASAM OpenSCENARIO XML 1.3.1, 8.3.1).
An element starts at most once in a tick, which bounds the turns.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Composite

from eidrive_scenario.storyboard.progress import ElementRecord
from eidrive_scenario.storyboard.stage import Stage
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
        self._tried_at: int | None = None
        """The tick in which it last started or was skipped."""
        self.record: ElementRecord = stage.progress.enrol(self.kind, path)

    @property
    def state(self) -> State | None:
        """None while those above it do not run."""
        return self.record.state

    def stand_by(self) -> None:
        """Wait for the start trigger; the parent has begun to run. What may never be executed is complete."""
        self.executions = 0
        self._arm()
        if self.limit < 1:
            self._change(Transition.SKIP, State.COMPLETE, "its maximumExecutionCount is 0")

    def judge(self) -> None:
        """First phase of a turn: stop, start, and let the children do the same.

        A stop trigger is asked from the tick after the start on, that of the storyboard from the first tick.
        """
        record = self.record
        if record.state is State.COMPLETE:
            return
        tried = self._tried_at == self.stage.progress.tick
        if record.state is State.RUNNING and not tried and self.stop_leaf is not None and self.stop_leaf.fires():
            self.halt(self.stop_leaf.trigger.why)
            return
        if record.state is State.STANDBY and not tried and (self.start_leaf is None or self.start_leaf.fires()):
            self.begin(EMPTY if self.start_leaf is None else self.start_leaf.trigger.why)
        if record.state is State.RUNNING:
            for element in self.elements:
                if element.record.state is not State.COMPLETE:
                    element.judge()

    def begin(self, why: str = "") -> None:
        """standby -> running; the children stand by, or start where they have no trigger."""
        self._tried_at = self.stage.progress.tick
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

    def arrive(self) -> None:
        """What the last step brought to its goal ends."""
        if self.state is State.RUNNING:
            for element in self.elements:
                element.arrive()
            self.settle()

    def decide(self) -> None:
        """Second phase of a turn: the running children decide; all of them complete, so is this one."""
        self.status = Status.RUNNING
        if self.record.state is State.RUNNING:
            for element in self.elements:
                if element.record.state is State.RUNNING:
                    element.decide()
            self.settle()
        if self.record.state is State.COMPLETE:
            self.status = Status.SUCCESS

    def tick(self) -> Iterator[Behaviour]:
        """`decide` as py_trees asks for it."""
        self.decide()
        yield self

    def settle(self) -> None:
        """End if all children are complete; what has none has no end of its own, and runs until it is stopped."""
        if self.record.state is not State.RUNNING or not self.elements:
            return
        for element in self.elements:
            if element.record.state is not State.COMPLETE:
                return
        self.finish()

    def _arm(self) -> None:
        for leaf in (self.start_leaf, self.stop_leaf):
            if leaf is not None:
                leaf.stop(Status.INVALID)
        self._change(None, State.STANDBY)

    def _change(self, transition: Transition | None, after: State, why: str = "") -> None:
        self.stage.progress.change(self.record, transition, after, why)


class StoryboardElement(StoryElement):
    """The root. It ends by its stop trigger; the stories' end is its own only where it has none."""

    kind = "storyboard"

    def play(self, init: Behaviour | None = None) -> None:
        """One tick of the whole tree, and of the actions that Init left running."""
        progress = self.stage.progress
        if self.state is None:
            self.stand_by()
            self.begin()
            self._tried_at = None
        if self.stage.arriving:
            self.stage.arriving = False
            self.arrive()
        seen = -1
        while seen != len(progress.changes):
            seen = len(progress.changes)
            self.judge()
            if self.state is not State.RUNNING:
                return
            if init is not None:
                init.tick_once()
                init = None
            self.decide()
            if seen == len(progress.changes):
                waiting, self.stage.waiting = self.stage.waiting, []
                for action in waiting:
                    action.give_up()

    def settle(self) -> None:
        """End with the last story, if nothing else would end the storyboard."""
        if self.stop_leaf is None:
            super().settle()


class StoryNode(StoryElement):
    """A Story."""

    kind = "story"


@dataclass
class TriggeringEntities:
    """Those who fulfilled the start trigger of an act: actors in its groups that select them (1.3.1, 7.3.1)."""

    names: tuple[str, ...] = ()


class ActElement(StoryElement):
    """An Act."""

    kind = "act"

    def __init__(
        self,
        stage: Stage,
        path: tuple[str, ...],
        groups: Sequence[ManeuverGroupElement],
        *,
        start: WaitFor | None = None,
        stop: WaitFor | None = None,
        triggering: TriggeringEntities | None = None,
    ) -> None:
        super().__init__(stage, path, groups, start=start, stop=stop)
        self._triggering = triggering or TriggeringEntities()

    def begin(self, why: str = "") -> None:
        """standby -> running; whoever triggered it acts in it."""
        if self.start_leaf is not None:
            self._triggering.names = self.start_leaf.trigger.triggering
        super().begin(why)


class ManeuverGroupElement(StoryElement):
    """A ManeuverGroup: actors for the maneuvers below."""

    kind = "maneuverGroup"


class ManeuverElement(StoryElement):
    """A Maneuver: events that know each other's priorities."""

    kind = "maneuver"
