"""Conditions on how an entity moves: speed, acceleration, standstill, distance traveled."""

from __future__ import annotations

import math

from eidrive_scenario.api.actions import QuantityCondition, RuntimeContext, model
from eidrive_scenario.api.common import WorldView as View


def along(vector: list[float], yaw: float, direction: model.DirectionalDimension | None) -> float:
    """A component of a world vector in the frame of a body with this heading; its length where no axis is asked for."""
    x, y, z = vector
    if direction is None:
        return math.sqrt(x * x + y * y + z * z)
    if direction is model.DirectionalDimension.VERTICAL:
        return z
    cos, sin = math.cos(yaw), math.sin(yaw)
    return x * cos + y * sin if direction is model.DirectionalDimension.LONGITUDINAL else y * cos - x * sin


def velocity_of(view: View, entity: str) -> list[float]:
    """Velocity of an entity in the world frame [m/s]."""
    vector: list[float] = view.velocity[view.row(entity)].tolist()
    return vector


def _named(direction: model.DirectionalDimension | None) -> str:
    return "" if direction is None else f"{direction.value} "


class SpeedCondition(QuantityCondition):
    """Speed [m/s], signed along the heading; with a direction the velocity's component along that axis."""

    element: model.SpeedCondition
    unit = "m/s"

    def what(self) -> str:
        """What is compared."""
        return f"{_named(self.element.direction)}speed"

    def quantity(self, context: RuntimeContext, entity: str) -> float:
        """The speed."""
        if self.element.direction is None:
            return context.speed(entity)
        return along(velocity_of(context.view, entity), context.pose(entity).h, self.element.direction)


class RelativeSpeedCondition(QuantityCondition):
    """Own speed less another entity's [m/s]; with a direction along that axis of the other entity."""

    element: model.RelativeSpeedCondition
    unit = "m/s"

    def what(self) -> str:
        """What is compared."""
        return f"{_named(self.element.direction)}speed above that of {self.element.entity_ref}"

    def quantity(self, context: RuntimeContext, entity: str) -> float:
        """The difference."""
        other = self.element.entity_ref
        if other not in context.view:
            return math.nan
        if self.element.direction is None:
            return context.speed(entity) - context.speed(other)
        mine, theirs = velocity_of(context.view, entity), velocity_of(context.view, other)
        difference = [a - b for a, b in zip(mine, theirs, strict=True)]
        return along(difference, context.pose(other).h, self.element.direction)


class AccelerationCondition(QuantityCondition):
    """Acceleration [m/s²]: its amount, or with a direction its component along that axis."""

    element: model.AccelerationCondition
    unit = "m/s²"

    def what(self) -> str:
        """What is compared."""
        return f"{_named(self.element.direction)}acceleration"

    def quantity(self, context: RuntimeContext, entity: str) -> float:
        """The acceleration."""
        vector = context.view.acceleration[context.view.row(entity)].tolist()
        return along(vector, context.pose(entity).h, self.element.direction)


class StandStillCondition(QuantityCondition):
    """Has stood still for longer than a duration [s]."""

    element: model.StandStillCondition
    unit = "s"

    def explain_for(self, context: RuntimeContext, entity: str) -> str:
        """How long it stands."""
        return f"{entity}: {since(context, context.actors[entity].standing_since, 'standing', 'moving')}"

    def describe_for(self) -> str:
        """The duration."""
        return f"stands still for {self.element.duration:g} s"

    def quantity(self, context: RuntimeContext, entity: str) -> float:
        """How long it stands."""
        return span(context, context.actors[entity].standing_since)

    def threshold(self) -> tuple[model.Rule, float]:
        """Longer than the duration."""
        return model.Rule.GREATER_THAN, self.element.duration


class TraveledDistanceCondition(QuantityCondition):
    """Has covered a distance in the world [m]; jumps are left out."""

    element: model.TraveledDistanceCondition
    unit = "m"

    def what(self) -> str:
        """What is compared."""
        return "traveled"

    def quantity(self, context: RuntimeContext, entity: str) -> float:
        """The distance covered."""
        return context.actors[entity].traveled

    def threshold(self) -> tuple[model.Rule, float]:
        """At least the distance."""
        return model.Rule.GREATER_OR_EQUAL, self.element.value


def span(context: RuntimeContext, start: float | None) -> float:
    """How long something has gone on [s]; NaN where it does not."""
    return math.nan if start is None else context.time - start


def since(context: RuntimeContext, start: float | None, what: str, otherwise: str) -> str:
    """How long something has gone on, in words."""
    return otherwise if start is None else f"{what} for {context.time - start:.2f} s"
