"""Conditions on distances: to a position, to another entity, and on reaching a position."""

from __future__ import annotations

import math

from eidrive_scenario.api import (
    Absent,
    Place,
    QuantityCondition,
    Stage,
    distance,
    frame_of,
    kind_of,
    model,
    resolve,
)

Measured = (
    model.DistanceCondition
    | model.RelativeDistanceCondition
    | model.TimeHeadwayCondition
    | model.TimeToCollisionCondition
)
"""Conditions that measure a distance."""


def frame_and_kind(element: Measured) -> tuple[str, str]:
    """How an element of the standard asks for a distance.

    The `alongRoute` of 1.0 asks for the distance along the road; without it and without a word a distance is straight.
    """
    if getattr(element, "along_route", None):
        return "road", "longitudinal"
    return frame_of(element.coordinate_system), kind_of(element.relative_distance_type)


def measured(stage: Stage, entity: str, target: str | Place, element: Measured) -> float:
    """The distance as an element of the standard asks for it [m], signed; NaN where there is none."""
    frame, kind = frame_and_kind(element)
    how = element.routing_algorithm
    try:
        return distance(stage, entity, target, frame=frame, kind=kind, freespace=element.freespace, algorithm=how)
    except Absent:
        return math.nan


def place_of(stage: Stage, position: model.Position, entity: str) -> Place | None:
    """The place of a position now, None where it refers to an entity that is not in the world."""
    try:
        return resolve(position, stage, entity)
    except Absent:
        return None


class DistanceCondition(QuantityCondition):
    """Distance to a position [m]; positions relative to entities move with them."""

    element: model.DistanceCondition
    unit = "m"

    def what(self) -> str:
        """What is compared."""
        return f"distance to {type(self.element.position.chosen()).__name__}"

    def quantity(self, stage: Stage, entity: str) -> float:
        """The amount of the distance."""
        place = place_of(stage, self.element.position, entity)
        return math.nan if place is None else abs(measured(stage, entity, place, self.element))


class RelativeDistanceCondition(QuantityCondition):
    """Distance to another entity [m]."""

    element: model.RelativeDistanceCondition
    unit = "m"

    def quantity(self, stage: Stage, entity: str) -> float:
        """The amount of the distance."""
        return abs(measured(stage, entity, self.element.entity_ref, self.element))

    def what(self) -> str:
        """Which distance, and to whom."""
        gap = " free" if self.element.freespace else ""
        kind = kind_of(self.element.relative_distance_type).removesuffix("Distance").replace("euclidian", "straight")
        return f"{kind}{gap} distance to {self.element.entity_ref}"


class ReachPositionCondition(QuantityCondition):
    """Within a tolerance [m] of a position, seen from above."""

    element: model.ReachPositionCondition
    unit = "m"

    def explain_for(self, stage: Stage, entity: str) -> str:
        """The distance."""
        gap = self.quantity(stage, entity)
        return f"{entity}: {gap:.2f} m from the position, tolerance {self.element.tolerance:g} m"

    def describe_for(self) -> str:
        """The tolerance."""
        return f"within {self.element.tolerance:g} m of {type(self.element.position.chosen()).__name__}"

    def quantity(self, stage: Stage, entity: str) -> float:
        """The distance between the reference point and the position; infinite where that is nowhere."""
        place = place_of(stage, self.element.position, entity)
        if place is None:
            return math.inf
        here = stage.pose(entity)
        return math.hypot(place.pose.x - here.x, place.pose.y - here.y)

    def threshold(self) -> tuple[model.Rule, float]:
        """At most the tolerance."""
        return model.Rule.LESS_OR_EQUAL, self.element.tolerance
