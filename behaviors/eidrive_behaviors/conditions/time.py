"""Conditions on time: of the simulation, and of the day."""

from __future__ import annotations

from datetime import datetime

from eidrive_scenario.api.actions import (
    Condition,
    Measure,
    RuntimeContext,
    describe_rule,
    model,
    relation,
    satisfies_rule,
)
from eidrive_scenario.api.common import Diagnostic


class SimulationTimeCondition(Condition):
    """The time since the start of the run [s]."""

    element: model.SimulationTimeCondition

    def holds(self, context: RuntimeContext) -> bool:
        """Compare the time of this view."""
        return satisfies_rule(context.time, self.element.rule, self.element.value)

    def explain(self, context: RuntimeContext) -> str:
        """The time."""
        sign = relation(self.element.rule, self.holds(context))
        return f"simulation time {context.time:.2f} s {sign} {self.element.value:g} s"

    def describe(self) -> str:
        """Rule and limit."""
        return f"simulation time {describe_rule(self.element.rule)} {self.element.value:g} s"

    def measures(self, context: RuntimeContext) -> tuple[Measure, ...]:
        """The time."""
        return (Measure("", context.time, self.element.rule, self.element.value, "s"),)


class TimeOfDayCondition(Condition):
    """The date and time of the day in the simulated world.

    The clock starts with the environment's TimeOfDay and runs with the simulation where that is animated. Without an
    environment that says so there is no time of day, and the condition does not hold. Where one of the two times has
    a zone and the other has none, both count in that zone.
    """

    instant = True
    element: model.TimeOfDayCondition

    def bind(self, context: RuntimeContext) -> None:
        """Say so where nothing in the scenario states a time of day."""
        scenario = context.scenario
        trees = (scenario.document, *scenario.entries.values())
        if not any(isinstance(below, model.TimeOfDay) for tree in trees for below in tree.walk()):
            what = "TimeOfDayCondition never holds: no environment of the scenario has a TimeOfDay"
            hint = "give one by an EnvironmentAction in Init"
            context.warnings.append(Diagnostic(what, hint, self.element.source, self.element.line))

    def holds(self, context: RuntimeContext) -> bool:
        """Compare the clock."""
        now = context.environment.clock(context.time)
        if now is None:
            return False
        return satisfies_rule((now - _like(self.element.date_time, now)).total_seconds(), self.element.rule, 0.0)

    def explain(self, context: RuntimeContext) -> str:
        """The clock."""
        now = context.environment.clock(context.time)
        shown = "unknown" if now is None else now.isoformat()
        sign = relation(self.element.rule, self.holds(context))
        return f"time of day {shown} {sign} {self.element.date_time.isoformat()}"

    def describe(self) -> str:
        """Rule and limit."""
        return f"time of day {describe_rule(self.element.rule)} {self.element.date_time.isoformat()}"


def _like(moment: datetime, other: datetime) -> datetime:
    """A moment with or without a time zone, as the other has one or not."""
    if (moment.tzinfo is None) == (other.tzinfo is None):
        return moment
    return moment.replace(tzinfo=other.tzinfo)
