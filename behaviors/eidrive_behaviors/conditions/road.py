"""Conditions on an entity and its road: the end of the road, off the road."""

from __future__ import annotations

from eidrive_behaviors.conditions.motion import since, span
from eidrive_scenario.api.actions import QuantityCondition, RuntimeContext, model


class EndOfRoadCondition(QuantityCondition):
    """Has been at the end of its road for a duration [s]."""

    element: model.EndOfRoadCondition
    unit = "s"

    def explain_for(self, context: RuntimeContext, entity: str) -> str:
        """How long."""
        begin = context.actors[entity].end_of_road_since
        return f"{entity}: {since(context, begin, 'at the end of its road', 'on its way')}"

    def describe_for(self) -> str:
        """The duration."""
        return f"at the end of its road for {self.element.duration:g} s"

    def quantity(self, context: RuntimeContext, entity: str) -> float:
        """How long it is there."""
        return span(context, context.actors[entity].end_of_road_since)

    def threshold(self) -> tuple[model.Rule, float]:
        """At least the duration."""
        return model.Rule.GREATER_OR_EQUAL, self.element.duration


class OffroadCondition(QuantityCondition):
    """Has been off the road with its reference point for longer than a duration [s]. Lanes `none` are no road."""

    element: model.OffroadCondition
    unit = "s"

    def bind(self, context: RuntimeContext) -> None:
        """Have it kept up since when they are off the road; runs without this condition need not pay for it."""
        for name in self.entities:
            context.actors[name].off_road_wanted = True

    def explain_for(self, context: RuntimeContext, entity: str) -> str:
        """How long."""
        return f"{entity}: {since(context, context.actors[entity].off_road_since, 'off the road', 'on the road')}"

    def describe_for(self) -> str:
        """The duration."""
        return f"off the road for {self.element.duration:g} s"

    def quantity(self, context: RuntimeContext, entity: str) -> float:
        """How long it is off the road."""
        return span(context, context.actors[entity].off_road_since)

    def threshold(self) -> tuple[model.Rule, float]:
        """Longer than the duration."""
        return model.Rule.GREATER_THAN, self.element.duration
