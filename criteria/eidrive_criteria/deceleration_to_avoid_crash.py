"""Criterion: maximum deceleration to avoid a crash with the leader (DRAC)."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field

from eidrive_criteria.pairs import LeaderCriterion, LeaderSettings
from eidrive_scenario.api.criteria import Relation


class DecelerationToAvoidCrashSettings(LeaderSettings):
    """Settings: `{of: Ego, to: Lead, at_most: 3.35}` [m/s²]. Without `at_most` it only measures and passes."""

    at_most: Annotated[float, Field(ge=0)] | None = None


class DecelerationToAvoidCrash(LeaderCriterion):
    """Criterion that fails if the deceleration that avoids a crash with the leader exceeds `at_most`.

    It is the square of the closing speed over twice the gap: 0 if the gap does not shrink, infinite in a crash.
    """

    settings_type = DecelerationToAvoidCrashSettings
    name = "deceleration_to_avoid_crash"
    unit = "m/s²"
    quantity = "deceleration to avoid a crash"
    largest = True
    in_contact = math.inf

    def __init__(self, settings: DecelerationToAvoidCrashSettings) -> None:
        super().__init__(settings, settings.at_most)

    def measure(self, leader: Relation) -> float | None:
        closing = max(leader.closing_speed, 0.0)
        if closing == 0.0:
            return 0.0
        return closing * closing / (2.0 * leader.gap) if leader.gap > 0.0 else math.inf
