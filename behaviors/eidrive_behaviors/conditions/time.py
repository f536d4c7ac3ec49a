"""Conditions on the simulation time and on the time of day."""

from __future__ import annotations

from datetime import datetime

from eidrive_scenario.api.actions import (
    Condition,
    ConditionContext,
    Measure,
    describe_rule,
    model,
    next_change,
    relation,
    satisfies_rule,
)
from eidrive_scenario.api.common import Diagnostic


class SimulationTimeCondition(Condition):
    """Time since the start of the run [s]."""

    reads = ()
    element: model.SimulationTimeCondition

    def holds(self, context: ConditionContext) -> bool:
        """Compare the time of this view."""
        return satisfies_rule(context.time, self.element.rule, self.element.value)

    def constant_until(self, context: ConditionContext) -> float:
        """Return the limit while it is ahead [s]."""
        return next_change(context.time, self.element.value)

    def explain(self, context: ConditionContext) -> str:
        """Describe the current time."""
        sign = relation(self.element.rule, self.holds(context))
        return f"simulation time {context.time:.2f} s {sign} {self.element.value:g} s"

    def describe(self) -> str:
        """Describe rule and limit."""
        return f"simulation time {describe_rule(self.element.rule)} {self.element.value:g} s"

    def measures(self, context: ConditionContext) -> tuple[Measure, ...]:
        """Return the time."""
        return (Measure("", context.time, self.element.rule, self.element.value, "s"),)


class TimeOfDayCondition(Condition):
    """Date and time of day in the simulated world.

    The clock starts with the environment's TimeOfDay and runs with the simulation if that is animated. If no
    environment specifies a TimeOfDay, the condition is false. If only one of the two times has a time zone, both refer
    to that zone.
    """

    instant = True
    element: model.TimeOfDayCondition

    def bind(self, context: ConditionContext) -> None:
        """Warn if no environment of the scenario specifies a time of day."""
        scenario = context.scenario
        trees = (scenario.document, *scenario.entries.values())
        if not any(isinstance(below, model.TimeOfDay) for tree in trees for below in tree.walk()):
            what = "TimeOfDayCondition is never fulfilled: no environment of the scenario has a TimeOfDay"
            hint = "specify one in an EnvironmentAction in Init"
            context.warn(Diagnostic.at(self.element, what, hint))

    def holds(self, context: ConditionContext) -> bool:
        """Compare the clock."""
        now = context.environment.clock(context.time)
        if now is None:
            return False
        return satisfies_rule(
            (now - _match_time_zone(self.element.date_time, now)).total_seconds(), self.element.rule, 0.0
        )

    def explain(self, context: ConditionContext) -> str:
        """Describe the current time."""
        now = context.environment.clock(context.time)
        shown = "unknown" if now is None else now.isoformat()
        sign = relation(self.element.rule, self.holds(context))
        return f"time of day {shown} {sign} {self.element.date_time.isoformat()}"

    def describe(self) -> str:
        """Describe rule and limit."""
        return f"time of day {describe_rule(self.element.rule)} {self.element.date_time.isoformat()}"


def _match_time_zone(moment: datetime, other: datetime) -> datetime:
    """Return a moment with or without a time zone, as the other one."""
    if (moment.tzinfo is None) == (other.tzinfo is None):
        return moment
    return moment.replace(tzinfo=other.tzinfo)
