"""Actions of Init: executed before the first view, and continued from there."""

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
    """Actions of Init. Those that take time run until they end or another action acquires their domain."""

    def __init__(self, context: RuntimeContext, behaviours: Sequence[ActionBehaviour]) -> None:
        super().__init__("Init", list(behaviours))
        self.context = context
        self.actions = tuple(behaviours)
        self.running: list[ActionBehaviour] = list(behaviours)

    def start(self) -> None:
        """Execute the actions before the first view, in the order of the file.

        An action that refers to an entity that a later action places is executed after it. Raise ScenarioError for
        cyclic references.
        """
        pending = list(self.running)
        while pending:
            blocked = [behaviour for behaviour in pending if not self._start_behaviour(behaviour)]
            if len(blocked) == len(pending):
                raise blocked[0].error(
                    "the position refers to an entity without a position", "place that entity in Init"
                )
            pending = blocked
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

    def linked_behaviours(self, behaviour: DomainHolder) -> Sequence[DomainHolder]:
        """Return the behaviours of the same action, several for an entity selection."""
        actions = [other.action for other in self.running if other is behaviour]
        return [other for other in self.running if any(other.action is action for action in actions)]

    def preempt(self, behaviour: DomainHolder, why: str) -> None:
        """Stop a behaviour whose domain another action acquired."""
        for other in self.running:
            if other is behaviour:
                other.stop(Status.INVALID)
        self.running = [other for other in self.running if other is not behaviour]

    def tick(self) -> Iterator[Behaviour]:
        """Tick once; the interface of py_trees."""
        self.tick_once()
        yield self

    def tick_once(self) -> None:
        """Update the running behaviours."""
        for behaviour in tuple(self.running):
            try:
                behaviour.tick_checked()
            except EntityAbsentError as absent:
                behaviour.abort(absent)
            if behaviour.status is not Status.RUNNING:
                self.running.remove(behaviour)
                self.context.release_domains(behaviour)
        self.status = Status.RUNNING if self.running else Status.SUCCESS
