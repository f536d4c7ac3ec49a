"""Criterion: time at which a station first knows an actor."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated

from pydantic import Field, model_validator

from eidrive_criteria.folds import Deadline, require_two_actors
from eidrive_criteria.perceived import PerceivedCriterion, PerceivedSettings
from eidrive_scenario.api.common import TIME_TOLERANCE
from eidrive_scenario.api.criteria import Frame, Verdict


class FirstDetectionSettings(PerceivedSettings):
    """Settings: `{of: Ego, to: Incoming, source: fused, by: 3.0}` with the time by [s].

    Without `by` it only measures and passes.
    """

    to: str
    by: Annotated[float, Field(ge=0)] | None = None

    _two_actors = model_validator(mode="after")(require_two_actors)


class FirstDetection(PerceivedCriterion):
    """Criterion that fails if the station does not know the other actor until `by`."""

    settings_type = FirstDetectionSettings
    name = "first_detection"
    unit = "s"

    def __init__(self, settings: FirstDetectionSettings) -> None:
        super().__init__(settings, settings.to)
        self._settings = settings
        self._first: float | None = None
        self._deadline = Deadline(settings.by)
        self._distance = math.nan
        """Distance between the centers of both actors at the first detection [m]."""

    def observe(self, frame: Frame) -> None:
        self._deadline.observe(frame.view.time)
        super().observe(frame)

    def evaluate(self, frame: Frame) -> None:
        view, settings = frame.view, self._settings
        if self._first is not None or settings.to not in self.known_actors(frame, settings.source):
            return
        self._first = view.time
        own, other = view.plain_boxes[view.rows[self.of]], view.plain_boxes[view.rows[settings.to]]
        self._distance = math.hypot(other[0] - own[0], other[1] - own[1])

    def verdict(self) -> Verdict:
        settings = self._settings
        in_time = settings.by is None or (self._first is not None and self._first <= settings.by + TIME_TOLERANCE)
        if not self.perceives:
            reason = self.no_perception()
        elif self._first is None:
            reason = f"{self.of} never knew {settings.to} ({settings.source} objects)"
        else:
            when = f"{self._first:.2f} s, at a distance of {self._distance:.1f} m"
            reason = f"{self.of} first knew {settings.to} at {when} ({settings.source} objects)"
        return self.conclude(
            self.perceives and in_time,
            reason,
            value=self._first,
            limit=settings.by,
            first_violation=None if in_time else self._deadline.expired,
        )

    def metrics(self) -> Mapping[str, float]:
        """Return time [s] and distance [m] of the first detection; empty without one."""
        if self._first is None:
            return {}
        pair = f"{self.name}.{self.of}.{self._settings.to}"
        return {f"{pair}.time": self._first, f"{pair}.distance": self._distance}
