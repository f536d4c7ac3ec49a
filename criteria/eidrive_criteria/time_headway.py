"""Criterion: minimum time headway to the leader."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from eidrive_criteria.pairs import LeaderCriterion, LeaderSettings
from eidrive_scenario.api.common import EPSILON
from eidrive_scenario.api.criteria import Relation


class TimeHeadwaySettings(LeaderSettings):
    """Settings: `{of: Ego, to: Lead, at_least: 1.0}` [s]. Without `at_least` it only measures and passes."""

    at_least: Annotated[float, Field(ge=0)] | None = None


class TimeHeadway(LeaderCriterion):
    """Criterion that fails if the time headway falls below `at_least`: gap between the bodies over the own speed.

    A standing or reversing actor has no time headway.
    """

    settings_type = TimeHeadwaySettings
    name = "time_headway"
    unit = "s"
    quantity = "time headway"

    def __init__(self, settings: TimeHeadwaySettings) -> None:
        super().__init__(settings, settings.at_least)

    def measure(self, leader: Relation) -> float | None:
        return leader.gap / leader.speed if leader.speed > EPSILON else None
