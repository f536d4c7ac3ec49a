"""Conditions on the motion of an entity: speed, acceleration, standstill, traveled distance."""

from __future__ import annotations

import math

from eidrive_scenario.api.actions import ConditionContext, QuantityCondition, model
from eidrive_scenario.api.common import WorldView as View


def component_of(vector: list[float], yaw: float, direction: model.DirectionalDimension | None) -> float:
    """Return a component of a world vector in the frame of a body with this heading; its length without a direction."""
    x, y, z = vector
    if direction is None:
        return math.sqrt(x * x + y * y + z * z)
    if direction is model.DirectionalDimension.VERTICAL:
        return z
    cos, sin = math.cos(yaw), math.sin(yaw)
    return x * cos + y * sin if direction is model.DirectionalDimension.LONGITUDINAL else y * cos - x * sin


def velocity_of(view: View, entity: str) -> list[float]:
    """Return the velocity of an entity in the world frame [m/s]."""
    vector: list[float] = view.velocity[view.row(entity)].tolist()
    return vector


def _direction_prefix(direction: model.DirectionalDimension | None) -> str:
    return "" if direction is None else f"{direction.value} "


class SpeedCondition(QuantityCondition):
    """Speed [m/s], signed along the heading; with a direction the component of the velocity along that axis."""

    element: model.SpeedCondition
    unit = "m/s"

    def what(self) -> str:
        """Describe the compared quantity."""
        return f"{_direction_prefix(self.element.direction)}speed"

    def quantity(self, context: ConditionContext, entity: str) -> float:
        """Return the speed [m/s]."""
        if self.element.direction is None:
            return context.speed(entity)
        return component_of(velocity_of(context.view, entity), context.pose(entity).h, self.element.direction)


class RelativeSpeedCondition(QuantityCondition):
    """Own speed minus another entity's [m/s]; with a direction along that axis of the other entity."""

    element: model.RelativeSpeedCondition
    unit = "m/s"

    def what(self) -> str:
        """Describe the compared quantity."""
        return f"{_direction_prefix(self.element.direction)}speed above that of {self.element.entity_ref}"

    def quantity(self, context: ConditionContext, entity: str) -> float:
        """Return the speed difference [m/s]."""
        other = self.element.entity_ref
        if other not in context.view:
            return math.nan
        if self.element.direction is None:
            return context.speed(entity) - context.speed(other)
        mine, theirs = velocity_of(context.view, entity), velocity_of(context.view, other)
        difference = [a - b for a, b in zip(mine, theirs, strict=True)]
        return component_of(difference, context.pose(other).h, self.element.direction)


class AccelerationCondition(QuantityCondition):
    """Acceleration [m/s²]: its magnitude, or with a direction its component along that axis."""

    element: model.AccelerationCondition
    unit = "m/s²"

    def what(self) -> str:
        """Describe the compared quantity."""
        return f"{_direction_prefix(self.element.direction)}acceleration"

    def quantity(self, context: ConditionContext, entity: str) -> float:
        """Return the acceleration [m/s²]."""
        vector = context.view.acceleration[context.view.row(entity)].tolist()
        return component_of(vector, context.pose(entity).h, self.element.direction)


class StandStillCondition(QuantityCondition):
    """Standstill for longer than a duration [s]."""

    element: model.StandStillCondition
    unit = "s"

    def explain_for(self, context: ConditionContext, entity: str) -> str:
        """Describe the duration of the standstill."""
        return f"{entity}: {describe_elapsed(context, context.actors[entity].standing_since, 'standing', 'moving')}"

    def describe_for(self) -> str:
        """Describe the required duration."""
        return f"stands still for {self.element.duration:g} s"

    def quantity(self, context: ConditionContext, entity: str) -> float:
        """Return the duration of the standstill [s]."""
        return elapsed_time(context, context.actors[entity].standing_since)

    def threshold(self) -> tuple[model.Rule, float]:
        """Return the rule: longer than the duration."""
        return model.Rule.GREATER_THAN, self.element.duration


class TraveledDistanceCondition(QuantityCondition):
    """Distance covered in the world [m], without teleports."""

    element: model.TraveledDistanceCondition
    unit = "m"

    def what(self) -> str:
        """Describe the compared quantity."""
        return "traveled"

    def quantity(self, context: ConditionContext, entity: str) -> float:
        """Return the covered distance [m]."""
        return context.actors[entity].traveled

    def threshold(self) -> tuple[model.Rule, float]:
        """Return the rule: at least the distance."""
        return model.Rule.GREATER_OR_EQUAL, self.element.value


def elapsed_time(context: ConditionContext, start: float | None) -> float:
    """Return the time since a state began [s]; NaN if it does not hold."""
    return math.nan if start is None else context.time - start


def describe_elapsed(context: ConditionContext, start: float | None, what: str, otherwise: str) -> str:
    """Describe the time since a state began, or `otherwise`."""
    return otherwise if start is None else f"{what} for {context.time - start:.2f} s"
