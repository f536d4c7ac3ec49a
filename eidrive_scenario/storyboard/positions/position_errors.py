"""Errors of positions, with file and line, and the road network and lane on which a position depends."""

from __future__ import annotations

from typing import Any

from eidrive_scenario.errors import Diagnostic, ScenarioError
from eidrive_scenario.openscenario import model
from eidrive_scenario.roads import LaneLocation, RoadNetwork
from eidrive_scenario.storyboard.context.protocols import ConditionContext


def roads_of(frame: model.Element, context: ConditionContext) -> RoadNetwork:
    """Return the road network. Raise ScenarioError if the scenario has none."""
    if context.roads is None:
        raise position_error(frame, "needs a road network", "name one in RoadNetwork/LogicFile, or use a WorldPosition")
    return context.roads


def road_origin(frame: Any, context: ConditionContext) -> LaneLocation:
    """Return the place on the road of the entity that `frame` refers to. Raise ScenarioError if it is on none."""
    here = context.location(frame.entity_ref)
    if here is None:
        raise position_error(frame, f"starts from {frame.entity_ref}, which is not on a road")
    return here


def position_error(frame: model.Element, message: str, hint: str = "") -> ScenarioError:
    """Return the error for a position, with its file and line."""
    return ScenarioError(Diagnostic(f"{type(frame).__name__} {message}", hint, frame.source, frame.line))
