"""Conditions on distances: to a position, to another entity, and on reaching a position."""

from __future__ import annotations

import math
from collections.abc import Sequence

from eidrive_scenario.api.actions import (
    ConditionContext,
    EntityAbsentError,
    QuantityCondition,
    ResolvedPosition,
    distance,
    model,
    referenced_entities,
    resolve_coordinate_system,
    resolve_distance_type,
    resolve_position,
)
from eidrive_scenario.api.common import Diagnostic, ScenarioError

DistanceElement = (
    model.DistanceCondition
    | model.RelativeDistanceCondition
    | model.TimeHeadwayCondition
    | model.TimeToCollisionCondition
)
"""Elements that specify a distance."""


class GapCondition(QuantityCondition):
    """Base class of conditions that measure a distance in the coordinate system and along the axis of their element.

    `alongRoute` of version 1.0 requests the distance along the road; beside a coordinate system or a distance type it
    is ignored. Without all of them the distance is straight.
    """

    element: DistanceElement

    def __init__(self, element: DistanceElement, entities: Sequence[str], rule: str = "any") -> None:
        super().__init__(element, entities, rule)
        is_specified = element.coordinate_system is not None or element.relative_distance_type is not None
        along = not is_specified and bool(getattr(element, "along_route", None))
        self.frame = "road" if along else resolve_coordinate_system(element.coordinate_system)
        self.kind = "longitudinal" if along else resolve_distance_type(element.relative_distance_type)

    def gap(self, context: ConditionContext, entity: str, target: str | ResolvedPosition) -> float:
        """Return the signed distance [m]; NaN if there is none."""
        element = self.element
        try:
            return distance(
                context,
                entity,
                target,
                frame=self.frame,
                kind=self.kind,
                freespace=element.freespace,
                algorithm=element.routing_algorithm,
            )
        except EntityAbsentError:
            return math.nan


def current_place(context: ConditionContext, position: model.Position, entity: str) -> ResolvedPosition | None:
    """Return the current place of a position; None if it refers to an absent entity.

    A position that moves with an entity has no place beyond the roads either, which is a warning.
    """
    try:
        return resolve_position(position, context, entity)
    except EntityAbsentError:
        return None
    except ScenarioError:
        if not referenced_entities(position):
            raise
        frame = position.chosen()
        message = f"{type(frame).__name__}: its condition is not fulfilled while the position is beyond the roads"
        context.warn(Diagnostic.at(frame, message, "use a RelativeObjectPosition, which requires no road"))
        return None


class DistanceCondition(GapCondition):
    """Distance to a position [m]. Positions relative to entities move with them."""

    element: model.DistanceCondition
    unit = "m"

    def what(self) -> str:
        """Describe the compared quantity."""
        return f"distance to {type(self.element.position.chosen()).__name__}"

    def quantity(self, context: ConditionContext, entity: str) -> float:
        """Return the absolute distance [m]."""
        target = current_place(context, self.element.position, entity)
        return math.nan if target is None else abs(self.gap(context, entity, target))


class RelativeDistanceCondition(GapCondition):
    """Distance to another entity [m]."""

    element: model.RelativeDistanceCondition
    unit = "m"

    def quantity(self, context: ConditionContext, entity: str) -> float:
        """Return the absolute distance [m]."""
        return abs(self.gap(context, entity, self.element.entity_ref))

    def what(self) -> str:
        """Describe the distance and the other entity."""
        gap = " free" if self.element.freespace else ""
        kind = "straight" if self.kind == "euclidianDistance" else self.kind
        return f"{kind}{gap} distance to {self.element.entity_ref}"


class ReachPositionCondition(QuantityCondition):
    """Horizontal distance to a position within a tolerance [m]."""

    element: model.ReachPositionCondition
    unit = "m"

    def explain_for(self, context: ConditionContext, entity: str) -> str:
        """Describe the current distance."""
        gap = self.quantity(context, entity)
        return f"{entity}: {gap:.2f} m from the position, tolerance {self.element.tolerance:g} m"

    def describe_for(self) -> str:
        """Describe the tolerance."""
        return f"within {self.element.tolerance:g} m of {type(self.element.position.chosen()).__name__}"

    def quantity(self, context: ConditionContext, entity: str) -> float:
        """Return the distance between reference point and position [m]; infinite while the position is undefined."""
        target = current_place(context, self.element.position, entity)
        if target is None:
            return math.inf
        here = context.pose(entity)
        return math.hypot(target.pose.x - here.x, target.pose.y - here.y)

    def threshold(self) -> tuple[model.Rule, float]:
        """Return the rule: at most the tolerance."""
        return model.Rule.LESS_OR_EQUAL, self.element.tolerance
