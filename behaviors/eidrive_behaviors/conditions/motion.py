"""Conditions on the motion of an entity: speed, acceleration, standstill, traveled distance."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Sequence
from typing import ClassVar

from eidrive_scenario.api.actions import ConditionContext, QuantityCondition, model, next_change, speed_change
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


class MotionCondition(QuantityCondition):
    """Base class of conditions on the motion of the entity alone, and of one that the element refers to."""

    by_speed: ClassVar[bool] = False
    """Whether only a change of the speed changes the value, unless the element has a direction."""

    def __init__(self, element: model.Element, entities: Sequence[str], rule: str = "any") -> None:
        super().__init__(element, entities, rule)
        names = {*entities, getattr(element, "entity_ref", None) or ""}
        by_speed = self.by_speed and getattr(element, "direction", None) is None
        self.reads = {speed_change(name) for name in names} if by_speed else names


def _direction_prefix(direction: model.DirectionalDimension | None) -> str:
    return "" if direction is None else f"{direction.value} "


class SpeedCondition(MotionCondition):
    """Speed [m/s], signed along the heading; with a direction the component of the velocity along that axis."""

    element: model.SpeedCondition
    unit = "m/s"
    by_speed = True

    def what(self) -> str:
        """Describe the compared quantity."""
        return f"{_direction_prefix(self.element.direction)}speed"

    def quantity(self, context: ConditionContext, entity: str) -> float:
        """Return the speed [m/s]."""
        if self.element.direction is None:
            return context.speed(entity)
        return component_of(velocity_of(context.view, entity), context.pose(entity).h, self.element.direction)


class RelativeSpeedCondition(MotionCondition):
    """Own speed minus another entity's [m/s]; with a direction along that own axis (1.3.1, RelativeSpeedCondition)."""

    element: model.RelativeSpeedCondition
    unit = "m/s"
    by_speed = True

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
        return component_of(difference, context.pose(entity).h, self.element.direction)


class AccelerationCondition(MotionCondition):
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


class DurationCondition(MotionCondition):
    """Base class of conditions on the time for which a state of the entity has lasted [s]."""

    element: model.StandStillCondition | model.EndOfRoadCondition | model.OffroadCondition
    unit = "s"
    state: ClassVar[str]
    """Description of the state, as in `standing for 2.00 s`."""
    otherwise: ClassVar[str]
    """Description of an entity outside of the state."""
    requirement: ClassVar[str]
    """Description of the condition without its duration."""
    rule_of_duration: ClassVar[model.Rule] = model.Rule.GREATER_THAN
    """Rule by which the time is compared with the duration."""

    @abstractmethod
    def since(self, context: ConditionContext, entity: str) -> float | None:
        """Return the start of the state [s]; None outside of it."""

    def explain_for(self, context: ConditionContext, entity: str) -> str:
        """Describe the current duration."""
        start = self.since(context, entity)
        text = self.otherwise if start is None else f"{self.state} for {context.time - start:.2f} s"
        return f"{entity}: {text}"

    def describe_for(self) -> str:
        """Describe the required duration."""
        return f"{self.requirement} for {self.element.duration:g} s"

    def quantity(self, context: ConditionContext, entity: str) -> float:
        """Return the time since the start of the state [s]; NaN outside of it."""
        start = self.since(context, entity)
        return math.nan if start is None else context.time - start

    def constant_until(self, context: ConditionContext) -> float:
        """Return the time at which a state reaches the duration [s]."""
        starts = [start for name in self.entities if (start := self.since(context, name)) is not None]
        return min((next_change(context.time, start + self.element.duration) for start in starts), default=math.inf)

    def threshold(self) -> tuple[model.Rule, float]:
        """Return the rule and the duration."""
        return self.rule_of_duration, self.element.duration


class StandStillCondition(DurationCondition):
    """Standstill for longer than a duration [s]."""

    element: model.StandStillCondition
    by_speed = True
    state, otherwise, requirement = "standing", "moving", "stands still"

    def since(self, context: ConditionContext, entity: str) -> float | None:
        """Return the start of the standstill [s]."""
        return context.actors[entity].standing_since


class TraveledDistanceCondition(MotionCondition):
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
