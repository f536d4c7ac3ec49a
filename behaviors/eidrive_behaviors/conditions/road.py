"""Conditions on an entity and its road: the end of the road, off the road."""

from __future__ import annotations

from eidrive_behaviors.conditions.motion import lasted, since
from eidrive_scenario.api import EntityCondition, Stage, model


class EndOfRoadCondition(EntityCondition):
    """Has been at the end of its road for longer than a duration [s]."""

    element: model.EndOfRoadCondition

    def holds_for(self, stage: Stage, entity: str) -> bool:
        """Compare how long."""
        return lasted(stage, stage.actors[entity].end_of_road_since, self.element.duration)

    def explain_for(self, stage: Stage, entity: str) -> str:
        """How long."""
        return (
            f"{entity}: {since(stage, stage.actors[entity].end_of_road_since, 'at the end of its road', 'on its way')}"
        )

    def describe_for(self) -> str:
        """The duration."""
        return f"at the end of its road for {self.element.duration:g} s"


class OffroadCondition(EntityCondition):
    """Has been off the road with its reference point for longer than a duration [s]."""

    element: model.OffroadCondition

    def holds_for(self, stage: Stage, entity: str) -> bool:
        """Compare how long. The state is looked at here, so that runs without this condition need not pay for it."""
        actor = stage.actors[entity]
        here = stage.location(entity)
        if here is not None and stage.roads is not None and stage.roads.on_road(here):
            actor.off_road_since = None
        elif actor.off_road_since is None:
            actor.off_road_since = stage.time
        return lasted(stage, actor.off_road_since, self.element.duration)

    def explain_for(self, stage: Stage, entity: str) -> str:
        """How long."""
        return f"{entity}: {since(stage, stage.actors[entity].off_road_since, 'off the road', 'on the road')}"

    def describe_for(self) -> str:
        """The duration."""
        return f"off the road for {self.element.duration:g} s"
