"""Errors of positions with file and line, and access to the road network that positions require."""

from __future__ import annotations

from typing import Any

from eidrive_scenario.errors import Diagnostic, ScenarioError
from eidrive_scenario.openscenario import model
from eidrive_scenario.roads import LaneLocation, RoadNetwork
from eidrive_scenario.storyboard.context.protocols import ConditionContext


def roads_of(frame: model.Element, context: ConditionContext) -> RoadNetwork:
    """Return the road network. Raise ScenarioError if the scenario has none."""
    if context.roads is None:
        raise position_error(
            frame, "the scenario has no road network", "specify RoadNetwork/LogicFile, or use a WorldPosition"
        )
    return context.roads


def road_origin(frame: Any, context: ConditionContext) -> LaneLocation:
    """Return the lane location of the entity that `frame` refers to. Raise ScenarioError if it is outside of roads."""
    here = context.location(frame.entity_ref)
    if here is None:
        raise position_error(frame, f"entity {frame.entity_ref!r} is not on a road")
    return here


def position_error(frame: model.Element, message: str, hint: str = "") -> ScenarioError:
    """Return an error of a position with its file and line."""
    return ScenarioError(Diagnostic(f"{type(frame).__name__}: {message}", hint, frame.source, frame.line))
