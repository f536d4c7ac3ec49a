"""Rules about the road file itself, for scenarios and for road files without a scenario."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Protocol

from eidrive_scenario.checks.rule import Level, Rule
from eidrive_scenario.errors import Diagnostic
from eidrive_scenario.roads import PositionError, RoadNetwork
from eidrive_scenario.roads.model.map_warnings import MAP_RULES


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
