"""The actions of Init: what holds before the first view, and what goes on from there."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Composite

from eidrive_scenario.storyboard.context.behaviour import ActionBehaviour
from eidrive_scenario.storyboard.context.preemption import DomainHolder
from eidrive_scenario.storyboard.context.protocols import EntityAbsentError
from eidrive_scenario.storyboard.context.runtime_context import RuntimeContext


class InitBlock(Composite):
    """The actions of Init. Those that need time go on until they end or a younger action takes their domain."""

    def __init__(self, context: RuntimeContext, behaviours: Sequence[ActionBehaviour]) -> None:
        super().__init__("Init", list(behaviours))
        self.context = context
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
                raise late[0].error("refers to an entity that nobody places", "place that entity in Init")
            waiting = late
        for behaviour in self.running:
            behaviour.settle()

    def _started(self, behaviour: ActionBehaviour) -> bool:
        try:
            behaviour.tick_once()
            if behaviour.third_party or behaviour.status is Status.INVALID:
                behaviour.check_decision()
        except EntityAbsentError:
            behaviour.stop(Status.INVALID)
            return False
        if behaviour.status is Status.RUNNING:
            self.context.acquire_domain(behaviour.actor_name, behaviour.controls, self, behaviour)
        else:
            self.running.remove(behaviour)
        return True

    def linked_behaviours(self, behaviour: DomainHolder) -> Sequence[DomainHolder]:
        """Those of one action: of a selection, else the one alone."""
        actions = [other.action for other in self.running if other is behaviour]
        return [other for other in self.running if any(other.action is action for action in actions)]

    def preempt(self, behaviour: DomainHolder, why: str) -> None:
        """A younger action took the domain."""
        for held in self.running:
            if held is behaviour:
                held.stop(Status.INVALID)
        self.running = [other for other in self.running if other is not behaviour]

    def tick(self) -> Iterator[Behaviour]:
        """`tick_once` as py_trees asks for it."""
        self.tick_once()
        yield self

    def tick_once(self) -> None:
        """Let the running ones decide on the next step."""
        for behaviour in tuple(self.running):
            try:
                behaviour.tick_once()
                if behaviour.third_party or behaviour.status is Status.INVALID:
                    behaviour.check_decision()
            except EntityAbsentError as who:
                behaviour.abort(who)
            if behaviour.status is not Status.RUNNING:
                self.running.remove(behaviour)
                self.context.release_domains(behaviour)
        self.status = Status.RUNNING if self.running else Status.SUCCESS
