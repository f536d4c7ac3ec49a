"""Conditions on distance over speed: time headway and time to collision."""

from __future__ import annotations

import math

from eidrive_behaviors.conditions.distance import measured, place_of
from eidrive_scenario.api import EntityCondition, Stage, compares, in_words, kind_of, model

STANDING = 1e-6


class TimeHeadwayCondition(EntityCondition):
    """Distance to another entity over the own speed [s]; that of a standing entity is without end."""

    element: model.TimeHeadwayCondition
    unit = "s"

    def holds_for(self, stage: Stage, entity: str) -> bool:
        """Compare the headway."""
        return compares(self.quantity(stage, entity), self.element.rule, self.element.value)

    def explain_for(self, stage: Stage, entity: str) -> str:
        """The headway."""
        value = self.quantity(stage, entity)
        rule = in_words(self.element.rule)
        return f"{entity}: time headway to {self.element.entity_ref} {value:.2f} s {rule} {self.element.value:g} s"

    def describe_for(self) -> str:
        """Rule and limit."""
        return f"time headway to {self.element.entity_ref} {in_words(self.element.rule)} {self.element.value:g} s"

    def quantity(self, stage: Stage, entity: str) -> float:
        """The headway."""
        speed, gap = abs(stage.speed(entity)), abs(measured(stage, entity, self.element.entity_ref, self.element))
        return gap / speed if speed > STANDING else gap * math.inf if gap > 0.0 else gap


class TimeToCollisionCondition(EntityCondition):
    """Distance to an entity or a position over the speed of approach [s]; where they do not approach there is none."""

    element: model.TimeToCollisionCondition
    unit = "s"

    def holds_for(self, stage: Stage, entity: str) -> bool:
        """Compare the time to collision."""
        return compares(self.quantity(stage, entity), self.element.rule, self.element.value)

    def explain_for(self, stage: Stage, entity: str) -> str:
        """The time to collision."""
        value, rule = self.quantity(stage, entity), in_words(self.element.rule)
        return f"{entity}: time to collision with {self._target()} {value:.2f} s {rule} {self.element.value:g} s"

    def describe_for(self) -> str:
        """Rule and limit."""
        return f"time to collision with {self._target()} {in_words(self.element.rule)} {self.element.value:g} s"

    def _target(self) -> str:
        target = self.element.time_to_collision_condition_target
        return target.entity_ref.entity_ref if target.entity_ref is not None else "the position"

    def quantity(self, stage: Stage, entity: str) -> float:
        """The time to collision."""
        target = self.element.time_to_collision_condition_target
        kind = "longitudinal" if self.element.along_route else kind_of(self.element.relative_distance_type)
        row = stage.view.row(entity)
        vx, vy = stage.view.velocity[row, :2].tolist()
        if target.entity_ref is not None:
            name = target.entity_ref.entity_ref
            if name not in stage.view:
                return math.nan
            other = stage.view.row(name)
            vx -= float(stage.view.velocity[other, 0])
            vy -= float(stage.view.velocity[other, 1])
            there = stage.pose(name)
            gap = measured(stage, entity, name, self.element)
        else:
            assert target.position is not None
            place = place_of(stage, target.position, entity)
            if place is None:
                return math.nan
            there = place.pose
            gap = measured(stage, entity, place, self.element)
        here = stage.pose(entity)
        dx, dy = there.x - here.x, there.y - here.y
        if kind == "euclidianDistance":
            length = math.hypot(dx, dy)
            closing = (vx * dx + vy * dy) / length if length > 0.0 else 0.0
        else:
            cos, sin = math.cos(here.h), math.sin(here.h)
            closing = vx * cos + vy * sin if kind == "longitudinal" else vy * cos - vx * sin
            closing = math.copysign(1.0, gap) * closing
        return abs(gap) / closing if closing > STANDING else math.nan
