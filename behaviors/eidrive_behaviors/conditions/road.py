"""Conditions on an entity and its road: end of the road, off the road."""

from __future__ import annotations

from eidrive_behaviors.conditions.motion import DurationCondition
from eidrive_scenario.api.actions import ConditionContext, model


class EndOfRoadCondition(DurationCondition):
    """End of the road reached for a duration [s]: the reference point is at an end of its lane without continuation.

    A driven vehicle has reached the end from 1 m before it.
    """

    element: model.EndOfRoadCondition
    state, otherwise, requirement = "at the end of its road", "on its way", "at the end of its road"
    rule_of_duration = model.Rule.GREATER_OR_EQUAL

    def bind(self, context: ConditionContext) -> None:
        """Enable the check of driven entities, which runs without this condition do not need."""
        for name in self.entities:
            context.actors[name].track_end_of_road()

    def since(self, context: ConditionContext, entity: str) -> float | None:
        """Return the time at which the end was reached [s]."""
        return context.actors[entity].end_of_road_since


class OffroadCondition(DurationCondition):
    """Reference point off the road for longer than a duration [s]. Lanes of type `none` are not part of the road."""

    element: model.OffroadCondition
    state, otherwise, requirement = "off the road", "on the road", "off the road"

    def bind(self, context: ConditionContext) -> None:
        """Enable the off-road check of the entities, which runs without this condition do not need."""
        for name in self.entities:
            context.actors[name].track_off_road()

    def since(self, context: ConditionContext, entity: str) -> float | None:
        """Return the time at which the entity left the road [s]."""
        return context.actors[entity].off_road_since
