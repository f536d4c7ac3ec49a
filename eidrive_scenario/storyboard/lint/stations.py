"""Rules on stations: conflict areas that lie off the road."""

from __future__ import annotations

from collections.abc import Iterator

from eidrive_scenario.driving.area_checks import areas_off_road
from eidrive_scenario.driving.declared import declared_settings
from eidrive_scenario.errors import InputError, Problem
from eidrive_scenario.storyboard.lint.survey import RoadSurvey


def conflict_areas_off_road(survey: RoadSurvey) -> Iterator[Problem]:
    """A conflict area of which no part lies on a road; wrong settings are reported elsewhere."""
    try:
        settings = declared_settings(survey.scenario, None, None)
    except InputError:
        return
    yield from areas_off_road(survey.scenario, settings, survey.roads)
