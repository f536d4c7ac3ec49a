"""Conditions on distance over speed: time headway and time to collision."""

from __future__ import annotations

import math

from eidrive_behaviors.conditions.distance import GapCondition, place_of
from eidrive_scenario.api.actions import ResolvedPosition, RuntimeContext, closing_speed, model

STANDING = 1e-6


class TimeHeadwayCondition(GapCondition):
    """Distance to another entity over the own speed [s]; that of a standing entity is without end."""

    element: model.TimeHeadwayCondition
    unit = "s"

    def what(self) -> str:
        """What is compared."""
        return f"time headway to {self.element.entity_ref}"

    def quantity(self, context: RuntimeContext, entity: str) -> float:
        """The headway."""
        speed, gap = abs(context.speed(entity)), abs(self.gap(context, entity, self.element.entity_ref))
        return gap / speed if speed > STANDING else gap * math.inf if gap > 0.0 else gap


class TimeToCollisionCondition(GapCondition):
    """Distance to an entity or a position over the speed of approach [s]; where they do not approach there is none.

    The speed is that in which the distance shrinks, by the same coordinate system and along the same axis.
    """

    element: model.TimeToCollisionCondition
    unit = "s"

    def what(self) -> str:
        """With whom."""
        other = self.element.time_to_collision_condition_target.entity_ref
        return f"time to collision with {'the position' if other is None else other.entity_ref}"

    def quantity(self, context: RuntimeContext, entity: str) -> float:
        """The time to collision."""
        to = self._towards(context, entity)
        if to is None:
            return math.nan
        gap, how = self.gap(context, entity, to), self.element.routing_algorithm
        closing = closing_speed(context, entity, to, frame=self.frame, kind=self.kind, algorithm=how)
        return abs(gap) / closing if closing > STANDING else math.nan

    def _towards(self, context: RuntimeContext, entity: str) -> str | ResolvedPosition | None:
        """The other entity, or the place; None while it is not in the world."""
        target = self.element.time_to_collision_condition_target
        if target.entity_ref is not None:
            return target.entity_ref.entity_ref if target.entity_ref.entity_ref in context.view else None
        assert target.position is not None
        return place_of(context, target.position, entity)
