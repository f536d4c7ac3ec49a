"""Conditions on time headway and time to collision, that is distance over speed."""

from __future__ import annotations

import math

from eidrive_behaviors.conditions.distance import GapCondition, current_place
from eidrive_scenario.api.actions import (
    TIME_DELTA,
    ConditionContext,
    MovedContext,
    ResolvedPosition,
    closing_speed,
    model,
)
from eidrive_scenario.api.common import EPSILON


class TimeHeadwayCondition(GapCondition):
    """Distance to another entity over the own speed [s]; infinite for a standing entity."""

    element: model.TimeHeadwayCondition
    unit = "s"

    def what(self) -> str:
        """Describe the compared quantity."""
        return f"time headway to {self.element.entity_ref}"

    def quantity(self, context: ConditionContext, entity: str) -> float:
        """Return the headway [s]."""
        speed, gap = abs(context.speed(entity)), abs(self.gap(context, entity, self.element.entity_ref))
        return gap / speed if speed > EPSILON else gap * math.inf if gap > 0.0 else gap


class TimeToCollisionCondition(GapCondition):
    """Distance to an entity or position over the closing speed [s]; undefined if the distance does not shrink.

    The closing speed is measured in the same coordinate system and along the same axis as the distance. A position
    moves with the entities that it refers to.
    """

    element: model.TimeToCollisionCondition
    unit = "s"

    def what(self) -> str:
        """Describe the compared quantity and the target."""
        other = self.element.time_to_collision_condition_target.entity_ref
        return f"time to collision with {'the position' if other is None else other.entity_ref}"

    def quantity(self, context: ConditionContext, entity: str) -> float:
        """Return the time to collision [s]."""
        to, later = (self._target(at, entity) for at in (context, MovedContext(context, TIME_DELTA)))
        if to is None or later is None:
            return math.nan
        velocity = (0.0, 0.0, 0.0)
        if isinstance(to, ResolvedPosition) and isinstance(later, ResolvedPosition):
            x, y, z = ((after - now) / TIME_DELTA for now, after in zip(to.pose[:3], later.pose[:3], strict=True))
            velocity = x, y, z
        closing = closing_speed(
            context,
            entity,
            to,
            frame=self.frame,
            kind=self.kind,
            freespace=self.element.freespace,
            algorithm=self.element.routing_algorithm,
            velocity=velocity,
        )
        gap = self.gap(context, entity, to)
        return abs(gap) / closing if closing > EPSILON else math.nan

    def _target(self, context: ConditionContext, entity: str) -> str | ResolvedPosition | None:
        """Return the other entity or the place; None while it is absent."""
        target = self.element.time_to_collision_condition_target
        if target.entity_ref is not None:
            return target.entity_ref.entity_ref if target.entity_ref.entity_ref in context.view else None
        assert target.position is not None
        return current_place(context, target.position, entity)
