"""Conditions on an entity and its road: end of the road, off the road."""

from __future__ import annotations

from eidrive_behaviors.conditions.motion import describe_elapsed, elapsed_time
from eidrive_scenario.api.actions import ConditionContext, QuantityCondition, model


class EndOfRoadCondition(QuantityCondition):
    """End of the road reached for a duration [s]."""

    element: model.EndOfRoadCondition
    unit = "s"

    def explain_for(self, context: ConditionContext, entity: str) -> str:
        """Describe the current duration."""
        start = context.actors[entity].end_of_road_since
        return f"{entity}: {describe_elapsed(context, start, 'at the end of its road', 'on its way')}"

    def describe_for(self) -> str:
        """Describe the required duration."""
        return f"at the end of its road for {self.element.duration:g} s"

    def quantity(self, context: ConditionContext, entity: str) -> float:
        """Return the time at the end of the road [s]."""
        return elapsed_time(context, context.actors[entity].end_of_road_since)

    def threshold(self) -> tuple[model.Rule, float]:
        """Return the rule: at least the duration."""
        return model.Rule.GREATER_OR_EQUAL, self.element.duration


class OffroadCondition(QuantityCondition):
    """Reference point off the road for longer than a duration [s]. Lanes of type `none` are not part of the road."""

    element: model.OffroadCondition
    unit = "s"

    def bind(self, context: ConditionContext) -> None:
        """Enable the off-road check of the entities, which runs without this condition do not need."""
        for name in self.entities:
            context.actors[name].track_off_road()

    def explain_for(self, context: ConditionContext, entity: str) -> str:
        """Describe the current duration."""
        start = context.actors[entity].off_road_since
        return f"{entity}: {describe_elapsed(context, start, 'off the road', 'on the road')}"

    def describe_for(self) -> str:
        """Describe the required duration."""
        return f"off the road for {self.element.duration:g} s"

    def quantity(self, context: ConditionContext, entity: str) -> float:
        """Return the time off the road [s]."""
        return elapsed_time(context, context.actors[entity].off_road_since)

    def threshold(self) -> tuple[model.Rule, float]:
        """Return the rule: longer than the duration."""
        return model.Rule.GREATER_THAN, self.element.duration
