"""Lint contexts with a road network, and the rules about the road file itself."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Protocol

import numpy as np

from eidrive_scenario.checks.rule import Level, Rule
from eidrive_scenario.checks.scenario_rules.context import LintContext
from eidrive_scenario.errors import Diagnostic, InputError
from eidrive_scenario.openscenario import Scenario
from eidrive_scenario.openscenario.model import Position
from eidrive_scenario.roads import PositionError, RoadNetwork
from eidrive_scenario.roads.model.map_warnings import MAP_RULES
from eidrive_scenario.storyboard.context.protocols import EntityAbsentError
from eidrive_scenario.storyboard.context.runtime_context import RuntimeContext
from eidrive_scenario.storyboard.kinematics.motion_state import ResolvedPosition
from eidrive_scenario.storyboard.positions.resolution import referenced_entities, resolve_position
from eidrive_scenario.world.view import WorldView


class RoadLintContext(LintContext):
    """Lint context of a scenario with its road network, without actors in the world."""

    def __init__(self, scenario: Scenario, roads: RoadNetwork | None, added: tuple[str | Path, ...] = ()) -> None:
        super().__init__(scenario, added)
        self.roads = roads
        self.context = RuntimeContext(scenario, roads, dt=0.0, seed=0, empty_view=_empty_view())

    def place(self, position: Position) -> ResolvedPosition | None:
        """Return the resolved position; None if it depends on an entity. Raise InputError if it does not exist."""
        if referenced_entities(position):
            return None
        try:
            return resolve_position(position, self.context)
        except (EntityAbsentError, ValueError):
            return None

    @cached_property
    def unresolved(self) -> dict[int, InputError]:
        """Return the errors of positions that cannot be resolved, by identity of the position."""
        return dict(self._unresolved())

    def _unresolved(self) -> Iterator[tuple[int, InputError]]:
        for element in self.elements:
            if isinstance(element, Position):
                try:
                    self.place(element)
                except InputError as error:
                    yield id(element), error

    def outside(self, x: list[float], y: list[float]) -> list[float]:
        """Return the distances of points from the edge of the nearest road [m]; 0 on a road."""
        assert self.roads is not None
        distances: list[float] = self.roads.locate(x, y, reach=np.inf).outside.tolist()
        return distances


def _empty_view() -> WorldView:
    none, points = np.empty(0), np.empty((0, 3))
    return WorldView(0.0, -1, (), (), points, none, none, none, points, points, none, none, points, points)


class HasRoads(Protocol):
    """Lint context with a road network."""

    @property
    def roads(self) -> RoadNetwork | None:
        """Return the road network; None if the scenario has none."""


@dataclass(frozen=True)
class RoadFileContext:
    """Lint context of a road file without a scenario."""

    roads: RoadNetwork


def map_warning_rule(name: str) -> Callable[[HasRoads], Iterator[Diagnostic]]:
    """Return the check of a rule whose violations the road network reports itself."""

    def check(context: HasRoads) -> Iterator[Diagnostic]:
        if context.roads is not None:
            yield from (diagnostic for diagnostic in context.roads.map_warnings if diagnostic.rule == name)

    return check


def _invalid_geo_reference(context: HasRoads) -> Iterator[Diagnostic]:
    if context.roads is None or not context.roads.header.geo_reference:
        return
    try:
        _ = context.roads.geo_reference
    except PositionError as error:
        for diagnostic in error.diagnostics:
            yield replace(diagnostic, message=f"{diagnostic.message}; no GeoPosition can be resolved")


ROAD_FILE_RULES: tuple[Rule[HasRoads], ...] = (
    *(Rule(rule.name, Level.WARNING, rule.summary, map_warning_rule(rule.name)) for rule in MAP_RULES),
    Rule("geo-reference", Level.WARNING, "a geoReference that cannot be used", _invalid_geo_reference),
)
"""Rules that need only the road file."""
