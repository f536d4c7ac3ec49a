"""Lint context of the rules that need the road network."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from pathlib import Path

import numpy as np

from eidrive_scenario.checks.scenario_rules.context import LintContext
from eidrive_scenario.errors import InputError
from eidrive_scenario.openscenario import Scenario
from eidrive_scenario.openscenario.model import Position
from eidrive_scenario.roads import RoadNetwork
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
