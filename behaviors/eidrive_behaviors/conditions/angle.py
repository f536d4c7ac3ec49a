"""Conditions on angles of an entity: in the world, to its lane or to another entity."""

from __future__ import annotations

import math
from abc import abstractmethod

from eidrive_scenario.api.actions import ConditionContext, QuantityCondition, model
from eidrive_scenario.api.common import Pose, wrap_angle

ROAD_SYSTEMS = (model.CoordinateSystem.LANE, model.CoordinateSystem.ROAD)
"""Coordinate systems whose axes turn along the road."""


def angle_in_world(context: ConditionContext, entity: str, kind: model.AngleType) -> float:
    """Return heading, pitch or roll of an entity in the world [rad]."""
    return _component(context.pose(entity), kind)


def reference_angle(
    context: ConditionContext, entity: str, kind: model.AngleType, system: model.CoordinateSystem | None
) -> float:
    """Return the reference angle of an AngleCondition [rad]: that of lane, road or trajectory at the entity.

    Without a coordinate system it is 0, that of the world. In the entity's own system the angle is always 0, and so it
    is for an entity without a trajectory. NaN off the road.
    """
    if system is None or system is model.CoordinateSystem.WORLD:
        return 0.0
    if system is model.CoordinateSystem.ENTITY:
        return _component(context.pose(entity), kind)
    if system is model.CoordinateSystem.TRAJECTORY:
        pose, progress = context.pose(entity), context.actors[entity].progress
        if progress is None:
            return _component(pose, kind)
        station = progress.at(context.view.tick)
        return _component(progress.layout.at(station)._replace(h=progress.layout.tangent(station)), kind)
    here = context.location(entity)
    if context.roads is None or here is None:
        return math.nan
    lane = system is model.CoordinateSystem.LANE
    return _component(context.roads.pose(here) if lane else context.roads.road_pose_at(here.road, here.s), kind)


def _component(pose: Pose, kind: model.AngleType) -> float:
    return {model.AngleType.HEADING: pose.h, model.AngleType.PITCH: pose.p, model.AngleType.ROLL: pose.r}[kind]


class AngleWithin(QuantityCondition):
    """Angle of the entity within a tolerance of a value [rad]. The compared quantity is the absolute difference."""

    element: model.AngleCondition | model.RelativeAngleCondition
    unit = "rad"

    def quantity(self, context: ConditionContext, entity: str) -> float:
        """Return the absolute difference between angle and value, in [0, π] [rad]."""
        return abs(wrap_angle(self.angle(context, entity) - self.element.angle))

    def threshold(self) -> tuple[model.Rule, float]:
        """Return the rule: at most the tolerance."""
        return model.Rule.LESS_OR_EQUAL, self.element.angle_tolerance

    def explain_for(self, context: ConditionContext, entity: str) -> str:
        """Describe the current angle."""
        return f"{entity}: {self.describe_for()}, it is {wrap_angle(self.angle(context, entity)):.3f} rad"

    def describe_for(self) -> str:
        """Describe value and tolerance."""
        return f"{self.what()} {self.element.angle:g} ± {self.element.angle_tolerance:g} rad"

    @abstractmethod
    def angle(self, context: ConditionContext, entity: str) -> float:
        """Return the angle [rad]; NaN if there is none now."""


class AngleCondition(AngleWithin):
    """Angle to the axes of a coordinate system."""

    element: model.AngleCondition

    def what(self) -> str:
        """Describe the angle."""
        return str(self.element.angle_type.value)

    def angle(self, context: ConditionContext, entity: str) -> float:
        """Return the angle to the axes at the entity [rad]."""
        kind = self.element.angle_type
        return angle_in_world(context, entity, kind) - reference_angle(
            context, entity, kind, self.element.coordinate_system
        )


class RelativeAngleCondition(AngleWithin):
    """Angle of the entity minus that of another one, in the system of lane or road each to its axes at that entity."""

    element: model.RelativeAngleCondition

    def what(self) -> str:
        """Describe the angle and the other entity."""
        return f"{self.element.angle_type.value} to {self.element.entity_ref}"

    def angle(self, context: ConditionContext, entity: str) -> float:
        """Return the difference of the angles [rad]."""
        if self.element.entity_ref not in context.view:
            return math.nan
        kind, system = self.element.angle_type, self.element.coordinate_system
        mine, theirs = (
            angle_in_world(context, name, kind)
            - (reference_angle(context, name, kind, system) if system in ROAD_SYSTEMS else 0.0)
            for name in (entity, self.element.entity_ref)
        )
        return mine - theirs
