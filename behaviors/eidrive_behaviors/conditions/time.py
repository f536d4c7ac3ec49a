"""Conditions on time: of the simulation, and of the day."""

from __future__ import annotations

from datetime import datetime

from eidrive_scenario.api import Condition, Diagnostic, Measure, Stage, compares, in_words, model, relation


class SimulationTimeCondition(Condition):
    """The time since the start of the run [s]."""

    element: model.SimulationTimeCondition

    def holds(self, stage: Stage) -> bool:
        """Compare the time of this view."""
        return compares(stage.time, self.element.rule, self.element.value)

    def explain(self, stage: Stage) -> str:
        """The time."""
        sign = relation(self.element.rule, self.holds(stage))
        return f"simulation time {stage.time:.2f} s {sign} {self.element.value:g} s"

    def describe(self) -> str:
        """Rule and limit."""
        return f"simulation time {in_words(self.element.rule)} {self.element.value:g} s"

    def measures(self, stage: Stage) -> tuple[Measure, ...]:
        """The time."""
        return (Measure("", stage.time, self.element.rule, self.element.value, "s"),)


class TimeOfDayCondition(Condition):
    """The date and time of the day in the simulated world.

    The clock starts with the environment's TimeOfDay and runs with the simulation where that is animated. Without an
    environment that says so there is no time of day, and the condition does not hold. Where one of the two times has
    a zone and the other has none, both count in that zone.
    """

    instant = True
    element: model.TimeOfDayCondition

    def bind(self, stage: Stage) -> None:
        """Say so where nothing in the scenario states a time of day."""
        scenario = stage.scenario
        trees = (scenario.document, *scenario.entries.values())
        if not any(isinstance(below, model.TimeOfDay) for tree in trees for below in tree.walk()):
            what = "TimeOfDayCondition never holds: no environment of the scenario has a TimeOfDay"
            remedy = "give one by an EnvironmentAction in Init"
            stage.warnings.append(Diagnostic(what, remedy, self.element.source, self.element.line))

    def holds(self, stage: Stage) -> bool:
        """Compare the clock."""
        now = stage.environment.clock(stage.time)
        if now is None:
            return False
        return compares((now - _like(self.element.date_time, now)).total_seconds(), self.element.rule, 0.0)

    def explain(self, stage: Stage) -> str:
        """The clock."""
        now = stage.environment.clock(stage.time)
        shown = "unknown" if now is None else now.isoformat()
        sign = relation(self.element.rule, self.holds(stage))
        return f"time of day {shown} {sign} {self.element.date_time.isoformat()}"

    def describe(self) -> str:
        """Rule and limit."""
        return f"time of day {in_words(self.element.rule)} {self.element.date_time.isoformat()}"


def _like(moment: datetime, other: datetime) -> datetime:
    """A moment with or without a time zone, as the other has one or not."""
    if (moment.tzinfo is None) == (other.tzinfo is None):
        return moment
    return moment.replace(tzinfo=other.tzinfo)
