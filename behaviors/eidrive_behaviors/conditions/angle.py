"""Conditions on angles: of an entity to the world, to its lane or to another entity."""

from __future__ import annotations

import math
from abc import abstractmethod

from eidrive_scenario.api.actions import QuantityCondition, RuntimeContext, model
from eidrive_scenario.api.common import Pose, wrap_angle


def angle_of(context: RuntimeContext, entity: str, kind: model.AngleType) -> float:
    """Heading, pitch or roll of an entity in the world [rad]."""
    return _of(context.pose(entity), kind)


def reference_of(
    context: RuntimeContext, entity: str, kind: model.AngleType, system: model.CoordinateSystem | None
) -> float:
    """The angle from which an AngleCondition counts [rad]: that of the lane, road or trajectory at the entity.

    Without a word it is 0, the world's. The entity's own axes are at no angle to themselves; the same is meant where it
    follows no trajectory. NaN off the road.
    """
    if system is None or system is model.CoordinateSystem.WORLD:
        return 0.0
    if system is model.CoordinateSystem.ENTITY:
        return _of(context.pose(entity), kind)
    if system is model.CoordinateSystem.TRAJECTORY:
        pose, progress = context.pose(entity), context.actors[entity].progress
        if progress is None:
            return _of(pose, kind)
        station = progress.at(context.view.tick)
        return _of(progress.layout.at(station)._replace(h=progress.layout.tangent(station)), kind)
    here = context.location(entity)
    if context.roads is None or here is None:
        return math.nan
    lane = system is model.CoordinateSystem.LANE
    return _of(context.roads.pose(here) if lane else context.roads.road_pose_at(here.road, here.s), kind)


def _of(pose: Pose, kind: model.AngleType) -> float:
    return {model.AngleType.HEADING: pose.h, model.AngleType.PITCH: pose.p, model.AngleType.ROLL: pose.r}[kind]


class AngleWithin(QuantityCondition):
    """An angle of the entity lies within a tolerance of a value [rad]; compared is how far it is from that."""

    element: model.AngleCondition | model.RelativeAngleCondition
    unit = "rad"

    def quantity(self, context: RuntimeContext, entity: str) -> float:
        """How far the angle is from the value, the short way round the circle."""
        return abs(wrap_angle(self.angle(context, entity) - self.element.angle))

    def threshold(self) -> tuple[model.Rule, float]:
        """At most the tolerance."""
        return model.Rule.LESS_OR_EQUAL, self.element.angle_tolerance

    def explain_for(self, context: RuntimeContext, entity: str) -> str:
        """The angle."""
        return f"{entity}: {self.describe_for()}, it is {wrap_angle(self.angle(context, entity)):.3f} rad"

    def describe_for(self) -> str:
        """Value and tolerance."""
        return f"{self.what()} {self.element.angle:g} ± {self.element.angle_tolerance:g} rad"

    @abstractmethod
    def angle(self, context: RuntimeContext, entity: str) -> float:
        """The angle; NaN where there is none now."""


class AngleCondition(AngleWithin):
    """An angle to the axes of a coordinate system."""

    element: model.AngleCondition

    def what(self) -> str:
        """Which angle."""
        return str(self.element.angle_type.value)

    def angle(self, context: RuntimeContext, entity: str) -> float:
        """The angle to the axes at the entity."""
        kind = self.element.angle_type
        return angle_of(context, entity, kind) - reference_of(context, entity, kind, self.element.coordinate_system)


class RelativeAngleCondition(AngleWithin):
    """An angle of the entity less that of another one."""

    element: model.RelativeAngleCondition

    def what(self) -> str:
        """Which angle, and to whom."""
        return f"{self.element.angle_type.value} to {self.element.entity_ref}"

    def angle(self, context: RuntimeContext, entity: str) -> float:
        """The difference."""
        if self.element.entity_ref not in context.view:
            return math.nan
        kind = self.element.angle_type
        return angle_of(context, entity, kind) - angle_of(context, self.element.entity_ref, kind)
