"""Rules about stations: conflict areas outside of the road."""

from __future__ import annotations

from collections.abc import Iterator

from eidrive_scenario.checks.road_rules.context import RoadLintContext
from eidrive_scenario.driving.station_declarations import declared_settings
from eidrive_scenario.driving.station_warnings import areas_off_road
from eidrive_scenario.errors import Diagnostic, InputError


def conflict_areas_off_road(context: RoadLintContext) -> Iterator[Diagnostic]:
    """Yield conflict areas without a part on a road; invalid settings are reported by the run setup."""
    try:
        settings = declared_settings(context.scenario, None, None)
    except InputError:
        return
    yield from areas_off_road(context.scenario, settings, context.roads)
