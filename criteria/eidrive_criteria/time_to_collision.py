"""Criterion: minimum time to collision of two actors."""

from __future__ import annotations

import math

from eidrive_criteria.accelerated_contact import accelerated_contact, course
from eidrive_criteria.pairs import PairCriterion, PairSettings, has_contact
from eidrive_scenario.api.common import WorldView
from eidrive_scenario.api.criteria import time_to_contact


class TimeToCollisionSettings(PairSettings):
    """Settings: `{of: Ego, to: Incoming, at_least: 1.5}` [s]. Without `at_least` it only measures and passes.

    accelerations  whether both keep their longitudinal accelerations, until they stand, instead of their velocities
    """

    accelerations: bool = False


class TimeToCollision(PairCriterion):
    """Criterion that fails if the time to collision falls below `at_least`; no collision course is no violation."""

    settings_type = TimeToCollisionSettings
    name = "time_to_collision"
    unit = "s"

    def __init__(self, settings: TimeToCollisionSettings) -> None:
        super().__init__(settings)
        self._accelerations = settings.accelerations

    def measure(self, view: WorldView, of: int, to: int) -> float:
        if has_contact(view, self.of, self.to):
            return 0.0  # The bodies may be apart at the end of the step.
        own, other = view.boxes[of].tolist(), view.boxes[to].tolist()
        if self._accelerations:
            return accelerated_contact(own, other, course(view, of), course(view, to))
        return time_to_contact(own, other, (view.velocity[to] - view.velocity[of]).tolist())

    def describe_smallest(self) -> str:
        if not math.isfinite(self.smallest):
            return f"{self.of} and {self.to} were never on a collision course"
        return f"{self.of} and {self.to} were {self.smallest:.2f} s from a collision at {self.when:.2f} s"
