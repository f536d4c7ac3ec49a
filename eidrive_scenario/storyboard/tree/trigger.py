"""Triggers: groups of conditions joined by OR, the conditions of a group by AND; edges and delays."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import py_trees
from py_trees.common import Status

from eidrive_scenario.errors import InvalidResult
from eidrive_scenario.storyboard.context.condition import Condition, truth
from eidrive_scenario.storyboard.context.runtime_context import RuntimeContext
from eidrive_scenario.tolerances import EPSILON


class ConditionEvaluator:
    """A condition with its edge and delay.

    An edge needs a value before it: the first evaluation yields none. It lasts for the rest of its tick, so that it
    meets what else comes true at that instant. With a delay, the answer at t is the edge's result at t - delay; before
    the first evaluation it is false.
    """

    def __init__(self, condition: Condition, *, name: str = "", edge: str = "none", delay: float = 0.0) -> None:
        self.condition = condition
        self.name = name
        self.edge = edge
        self.delay = delay
        self.evaluations = 0
        """How often the condition was asked."""
        self.reset()

    def reset(self) -> None:
        """Forget all evaluations."""
        self.value: bool | None = None
        """What the condition was when it was last asked, without edge and delay; None before the first time."""
        self.result = False
        """What it counted as then."""
        self.triggering: tuple[str, ...] = ()
        """The entities that made it so: those that fulfilled it or, where it counts as it ends, had fulfilled it."""
        self._fulfilled: tuple[str, ...] = ()
        self._asked_at: int | None = None
        self._pulse = False
        self._recorded = False
        self._history: deque[tuple[float, bool, str, tuple[str, ...]]] = deque()
        self._delayed: tuple[bool, str] = (False, "")

    def evaluate(self, context: RuntimeContext) -> bool:
        """Ask the condition and answer with edge and delay; again in one tick only where it may have changed since."""
        again = self._asked_at == context.progress.tick
        if again and not self.condition.instant:
            return self.result
        self._asked_at = context.progress.tick
        self.evaluations += 1
        held: object = self.condition.holds(context)
        result = self._edge(held if held is True or held is False else truth(self.condition, held))
        if again and self.edge != "none" and self._pulse:
            return self.result
        self._pulse = result
        before, self._fulfilled = self._fulfilled, getattr(self.condition, "fulfilled", ())
        who = self._fulfilled if self.value else before
        if self.delay <= 0.0:
            self.result, self.triggering = result, who
        else:
            self.result = self._late(context, result, who)
        return self.result

    def _late(self, context: RuntimeContext, result: bool, who: tuple[str, ...]) -> bool:
        """Return the result of the delay ago; each true one is kept with the values of its own instant."""
        if result or self._recorded:
            self._recorded = result
            self._history.append((context.time, result, self._words(context) if result else "", who))
        while self._history and self._history[0][0] <= context.time - self.delay + EPSILON:
            _, value, text, self.triggering = self._history.popleft()
            self._delayed = (value, text)
        return self._delayed[0]

    def _words(self, context: RuntimeContext) -> str:
        """Return the condition with its values of now."""
        text: object = self.condition.explain(context)
        if not isinstance(text, str):
            raise InvalidResult(self.condition, "explain", f"returned {text!r} (expected a text)")
        return text if self.value or self.edge == "none" else f"{text} (falling edge)"

    def _edge(self, value: bool) -> bool:
        before, self.value = self.value, value
        if self.edge == "none":
            return value
        if before is None or before == value:
            return False
        return self.edge == "risingOrFalling" or (self.edge == "rising") == value

    def why(self, context: RuntimeContext) -> str:
        """What made it true, in words, with the values of that instant; to be asked where it just was true."""
        if self.delay <= 0.0:
            return self._words(context)
        return f"{self._delayed[1]}, {self.delay:g} s ago"

    def describe(self) -> str:
        """The condition in words."""
        edge = {"none": "", "rising": " becomes true", "falling": " becomes false", "risingOrFalling": " changes"}
        late = f", {self.delay:g} s later" if self.delay > 0.0 else ""
        return f"{self.condition.describe()}{edge[self.edge]}{late}"


@dataclass(frozen=True)
class ConditionGroup:
    """An AND over conditions at one instant."""

    monitors: tuple[ConditionEvaluator, ...]

    def evaluate(self, context: RuntimeContext) -> bool:
        """True where all are; each is asked every time, as edges and delays live on what they saw before."""
        results = [monitor.evaluate(context) for monitor in self.monitors]
        return bool(results) and all(results)


class TriggerObserver(Protocol):
    """Looks on as one trigger is asked."""

    def on_evaluated(self, context: RuntimeContext) -> None:
        """The trigger has been asked."""


class Trigger:
    """An OR over condition groups."""

    def __init__(self, groups: Sequence[ConditionGroup]) -> None:
        self.groups = tuple(groups)
        self.why = ""
        self.witness: TriggerObserver | None = None
        self.triggering: tuple[str, ...] = ()
        """The entities that fulfilled the conditions of the groups that fired."""

    def __bool__(self) -> bool:
        return bool(self.groups)

    def evaluate(self, context: RuntimeContext) -> bool:
        """True where it fires; `why` then says what did it."""
        fired = [group for group in self.groups if group.evaluate(context)]
        if fired:
            self.why = " and ".join(monitor.why(context) for monitor in fired[0].monitors)
            names = [name for group in fired for monitor in group.monitors for name in monitor.triggering]
            self.triggering = tuple(dict.fromkeys(names))
        if self.witness is not None:
            self.witness.on_evaluated(context)
        return bool(fired)

    def reset(self) -> None:
        """Forget all evaluations, as before the first."""
        for group in self.groups:
            for monitor in group.monitors:
                monitor.reset()

    def describe(self) -> str:
        """The trigger in words."""
        return " or ".join(" and ".join(m.describe() for m in group.monitors) for group in self.groups)


class WaitForTrigger(py_trees.behaviour.Behaviour):
    """The leaf at which a trigger meets the tree: runs until it fires."""

    def __init__(self, name: str, trigger: Trigger, context: RuntimeContext) -> None:
        super().__init__(name)
        self.trigger = trigger
        self.context = context

    def initialise(self) -> None:
        """Forget what was seen in an earlier life."""
        if self.status is Status.INVALID:
            self.trigger.reset()

    def update(self) -> Status:
        """Ask the trigger."""
        return Status.SUCCESS if self.trigger.evaluate(self.context) else Status.RUNNING

    def is_fired(self) -> bool:
        """What `tick_once` does, without its ceremony: triggers are asked in every tick of a run."""
        self.initialise()
        self.status = self.update()
        return self.status is Status.SUCCESS
