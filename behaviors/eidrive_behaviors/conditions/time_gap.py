"""Conditions on distance over speed: time headway and time to collision."""

from __future__ import annotations

import math

from eidrive_behaviors.conditions.distance import frame_and_kind, measured, place_of
from eidrive_scenario.api import EntityCondition, Place, Stage, closing_speed, compares, in_words, model

STANDING = 1e-6


class TimeHeadwayCondition(EntityCondition):
    """Distance to another entity over the own speed [s]; that of a standing entity is without end."""

    element: model.TimeHeadwayCondition
    unit = "s"

    def holds_for(self, stage: Stage, entity: str) -> bool:
        """Compare the headway."""
        return compares(self.quantity(stage, entity), self.element.rule, self.element.value)

    def explain_for(self, stage: Stage, entity: str) -> str:
        """The headway."""
        value = self.quantity(stage, entity)
        rule = in_words(self.element.rule)
        return f"{entity}: time headway to {self.element.entity_ref} {value:.2f} s {rule} {self.element.value:g} s"

    def describe_for(self) -> str:
        """Rule and limit."""
        return f"time headway to {self.element.entity_ref} {in_words(self.element.rule)} {self.element.value:g} s"

    def quantity(self, stage: Stage, entity: str) -> float:
        """The headway."""
        speed, gap = abs(stage.speed(entity)), abs(measured(stage, entity, self.element.entity_ref, self.element))
        return gap / speed if speed > STANDING else gap * math.inf if gap > 0.0 else gap


class TimeToCollisionCondition(EntityCondition):
    """Distance to an entity or a position over the speed of approach [s]; where they do not approach there is none.

    The speed is that in which the distance shrinks, by the same coordinate system and along the same axis.
    """

    element: model.TimeToCollisionCondition
    unit = "s"

    def holds_for(self, stage: Stage, entity: str) -> bool:
        """Compare the time to collision."""
        return compares(self.quantity(stage, entity), self.element.rule, self.element.value)

    def explain_for(self, stage: Stage, entity: str) -> str:
        """The time to collision."""
        value, rule = self.quantity(stage, entity), in_words(self.element.rule)
        return f"{entity}: time to collision with {self._target()} {value:.2f} s {rule} {self.element.value:g} s"

    def describe_for(self) -> str:
        """Rule and limit."""
        return f"time to collision with {self._target()} {in_words(self.element.rule)} {self.element.value:g} s"

    def _target(self) -> str:
        target = self.element.time_to_collision_condition_target
        return target.entity_ref.entity_ref if target.entity_ref is not None else "the position"

    def quantity(self, stage: Stage, entity: str) -> float:
        """The time to collision."""
        to = self._towards(stage, entity)
        if to is None:
            return math.nan
        gap = measured(stage, entity, to, self.element)
        frame, kind = frame_and_kind(self.element)
        closing = closing_speed(stage, entity, to, frame=frame, kind=kind, algorithm=self.element.routing_algorithm)
        return abs(gap) / closing if closing > STANDING else math.nan

    def _towards(self, stage: Stage, entity: str) -> str | Place | None:
        """The other entity, or the place; None while it is not in the world."""
        target = self.element.time_to_collision_condition_target
        if target.entity_ref is not None:
            return target.entity_ref.entity_ref if target.entity_ref.entity_ref in stage.view else None
        assert target.position is not None
        return place_of(stage, target.position, entity)
