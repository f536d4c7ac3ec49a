"""Rules on stations: conflict areas that lie off the road."""

from __future__ import annotations

from collections.abc import Iterator

from eidrive_scenario.checks.road_rules.context import RoadLintContext
from eidrive_scenario.driving.planning.area_checks import areas_off_road
from eidrive_scenario.driving.station_declarations import declared_settings
from eidrive_scenario.errors import Diagnostic, InputError


def conflict_areas_off_road(context: RoadLintContext) -> Iterator[Diagnostic]:
    """A conflict area of which no part lies on a road; wrong settings are reported elsewhere."""
    try:
        settings = declared_settings(context.scenario, None, None)
    except InputError:
        return
    yield from areas_off_road(context.scenario, settings, context.roads)
