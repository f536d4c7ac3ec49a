"""Conditions on angles: of an entity to the world, to its lane or to another entity."""

from __future__ import annotations

import math

from eidrive_scenario.api import EntityCondition, Stage, model, wrap_angle


def angle_of(stage: Stage, entity: str, kind: model.AngleType) -> float:
    """Heading, pitch or roll of an entity in the world [rad]."""
    pose = stage.pose(entity)
    return {model.AngleType.HEADING: pose.h, model.AngleType.PITCH: pose.p, model.AngleType.ROLL: pose.r}[kind]


def reference_of(stage: Stage, entity: str, kind: model.AngleType, system: model.CoordinateSystem | None) -> float:
    """The angle from which an AngleCondition counts: the lane's or road's at the entity, 0 in other frames [rad]."""
    if system not in (model.CoordinateSystem.LANE, model.CoordinateSystem.ROAD) or stage.roads is None:
        return 0.0
    here = stage.location(entity)
    if here is None:
        return math.nan
    pose = (
        stage.roads.pose(here) if system is model.CoordinateSystem.LANE else stage.roads.road_pose_at(here.road, here.s)
    )
    return {model.AngleType.HEADING: pose.h, model.AngleType.PITCH: pose.p, model.AngleType.ROLL: pose.r}[kind]


class AngleCondition(EntityCondition):
    """An angle of the entity lies within a tolerance of a value [rad]."""

    element: model.AngleCondition
    unit = "rad"

    def holds_for(self, stage: Stage, entity: str) -> bool:
        """Compare it, the short way round the circle."""
        return self.quantity(stage, entity) <= self.element.angle_tolerance

    def quantity(self, stage: Stage, entity: str) -> float:
        """How far the angle is from the value."""
        return abs(wrap_angle(self._angle(stage, entity) - self.element.angle))

    def threshold(self) -> tuple[model.Rule, float]:
        """At most the tolerance."""
        return model.Rule.LESS_OR_EQUAL, self.element.angle_tolerance

    def explain_for(self, stage: Stage, entity: str) -> str:
        """The angle."""
        return f"{entity}: {self.describe_for()}, it is {wrap_angle(self._angle(stage, entity)):.3f} rad"

    def describe_for(self) -> str:
        """Value and tolerance."""
        what = self.element.angle_type.value
        return f"{what} {self.element.angle:g} ± {self.element.angle_tolerance:g} rad"

    def _angle(self, stage: Stage, entity: str) -> float:
        kind = self.element.angle_type
        return angle_of(stage, entity, kind) - reference_of(stage, entity, kind, self.element.coordinate_system)


class RelativeAngleCondition(EntityCondition):
    """An angle of the entity less that of another entity lies within a tolerance of a value [rad]."""

    element: model.RelativeAngleCondition
    unit = "rad"

    def holds_for(self, stage: Stage, entity: str) -> bool:
        """Compare it, the short way round the circle."""
        return self.quantity(stage, entity) <= self.element.angle_tolerance

    def quantity(self, stage: Stage, entity: str) -> float:
        """How far the angle is from the value."""
        if self.element.entity_ref not in stage.view:
            return math.nan
        return abs(wrap_angle(self._angle(stage, entity) - self.element.angle))

    def threshold(self) -> tuple[model.Rule, float]:
        """At most the tolerance."""
        return model.Rule.LESS_OR_EQUAL, self.element.angle_tolerance

    def explain_for(self, stage: Stage, entity: str) -> str:
        """The angle."""
        return f"{entity}: {self.describe_for()}, it is {wrap_angle(self._angle(stage, entity)):.3f} rad"

    def describe_for(self) -> str:
        """Value and tolerance."""
        what = f"{self.element.angle_type.value} to {self.element.entity_ref}"
        return f"{what} {self.element.angle:g} ± {self.element.angle_tolerance:g} rad"

    def _angle(self, stage: Stage, entity: str) -> float:
        kind = self.element.angle_type
        return angle_of(stage, entity, kind) - angle_of(stage, self.element.entity_ref, kind)
