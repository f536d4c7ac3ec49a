"""Conditions on distances: to a position, to another entity, and on reaching a position."""

from __future__ import annotations

import math
from collections.abc import Sequence

from eidrive_scenario.api.actions import (
    EntityAbsentError,
    QuantityCondition,
    ResolvedPosition,
    RuntimeContext,
    distance,
    model,
    resolve_coordinate_system,
    resolve_distance_type,
    resolve_position,
)

Measured = (
    model.DistanceCondition
    | model.RelativeDistanceCondition
    | model.TimeHeadwayCondition
    | model.TimeToCollisionCondition
)
"""Conditions that measure a distance."""


class GapCondition(QuantityCondition):
    """A condition that measures a distance, in the coordinate system and along the axis that its element names.

    The `alongRoute` of 1.0 asks for the distance along the road; without it and without a word a distance is straight.
    """

    element: Measured

    def __init__(self, element: Measured, entities: Sequence[str], rule: str = "any") -> None:
        super().__init__(element, entities, rule)
        along = bool(getattr(element, "along_route", None))
        self.frame = "road" if along else resolve_coordinate_system(element.coordinate_system)
        self.kind = "longitudinal" if along else resolve_distance_type(element.relative_distance_type)

    def gap(self, context: RuntimeContext, entity: str, target: str | ResolvedPosition) -> float:
        """The distance [m], signed; NaN where there is none."""
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


def place_of(context: RuntimeContext, position: model.Position, entity: str) -> ResolvedPosition | None:
    """The place of a position now, None where it refers to an entity that is not in the world."""
    try:
        return resolve_position(position, context, entity)
    except EntityAbsentError:
        return None


class DistanceCondition(GapCondition):
    """Distance to a position [m]; positions relative to entities move with them."""

    element: model.DistanceCondition
    unit = "m"

    def what(self) -> str:
        """What is compared."""
        return f"distance to {type(self.element.position.chosen()).__name__}"

    def quantity(self, context: RuntimeContext, entity: str) -> float:
        """The amount of the distance."""
        place = place_of(context, self.element.position, entity)
        return math.nan if place is None else abs(self.gap(context, entity, place))


class RelativeDistanceCondition(GapCondition):
    """Distance to another entity [m]."""

    element: model.RelativeDistanceCondition
    unit = "m"

    def quantity(self, context: RuntimeContext, entity: str) -> float:
        """The amount of the distance."""
        return abs(self.gap(context, entity, self.element.entity_ref))

    def what(self) -> str:
        """Which distance, and to whom."""
        gap = " free" if self.element.freespace else ""
        kind = (
            resolve_distance_type(self.element.relative_distance_type)
            .removesuffix("Distance")
            .replace("euclidian", "straight")
        )
        return f"{kind}{gap} distance to {self.element.entity_ref}"


class ReachPositionCondition(QuantityCondition):
    """Within a tolerance [m] of a position, seen from above."""

    element: model.ReachPositionCondition
    unit = "m"

    def explain_for(self, context: RuntimeContext, entity: str) -> str:
        """The distance."""
        gap = self.quantity(context, entity)
        return f"{entity}: {gap:.2f} m from the position, tolerance {self.element.tolerance:g} m"

    def describe_for(self) -> str:
        """The tolerance."""
        return f"within {self.element.tolerance:g} m of {type(self.element.position.chosen()).__name__}"

    def quantity(self, context: RuntimeContext, entity: str) -> float:
        """The distance between the reference point and the position; infinite where that is nowhere."""
        place = place_of(context, self.element.position, entity)
        if place is None:
            return math.inf
        here = context.pose(entity)
        return math.hypot(place.pose.x - here.x, place.pose.y - here.y)

    def threshold(self) -> tuple[model.Rule, float]:
        """At most the tolerance."""
        return model.Rule.LESS_OR_EQUAL, self.element.tolerance
