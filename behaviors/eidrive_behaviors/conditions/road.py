"""Conditions on an entity and its road: the end of the road, off the road."""

from __future__ import annotations

from eidrive_behaviors.conditions.motion import since, span
from eidrive_scenario.api import QuantityCondition, Stage, model


class EndOfRoadCondition(QuantityCondition):
    """Has been at the end of its road for a duration [s]."""

    element: model.EndOfRoadCondition
    unit = "s"

    def explain_for(self, stage: Stage, entity: str) -> str:
        """How long."""
        return (
            f"{entity}: {since(stage, stage.actors[entity].end_of_road_since, 'at the end of its road', 'on its way')}"
        )

    def describe_for(self) -> str:
        """The duration."""
        return f"at the end of its road for {self.element.duration:g} s"

    def quantity(self, stage: Stage, entity: str) -> float:
        """How long it is there."""
        return span(stage, stage.actors[entity].end_of_road_since)

    def threshold(self) -> tuple[model.Rule, float]:
        """At least the duration."""
        return model.Rule.GREATER_OR_EQUAL, self.element.duration


class OffroadCondition(QuantityCondition):
    """Has been off the road with its reference point for longer than a duration [s]. Lanes `none` are no road."""

    element: model.OffroadCondition
    unit = "s"

    def bind(self, stage: Stage) -> None:
        """Have it kept up since when they are off the road; runs without this condition need not pay for it."""
        for name in self.entities:
            stage.actors[name].off_road_wanted = True

    def explain_for(self, stage: Stage, entity: str) -> str:
        """How long."""
        return f"{entity}: {since(stage, stage.actors[entity].off_road_since, 'off the road', 'on the road')}"

    def describe_for(self) -> str:
        """The duration."""
        return f"off the road for {self.element.duration:g} s"

    def quantity(self, stage: Stage, entity: str) -> float:
        """How long it is off the road."""
        return span(stage, stage.actors[entity].off_road_since)

    def threshold(self) -> tuple[model.Rule, float]:
        """Longer than the duration."""
        return model.Rule.GREATER_THAN, self.element.duration
