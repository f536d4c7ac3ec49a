"""Criterion: error of the positions of the objects that a station knows."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

from pydantic import Field, model_validator

from eidrive_criteria.folds import PHRASES, Measure, Sample, require_two_actors
from eidrive_criteria.perceived import PerceivedCriterion, PerceivedSettings
from eidrive_scenario.api.criteria import Frame, Verdict


class PositionErrorSettings(PerceivedSettings):
    """Settings: `{of: Ego, source: fused, measure: p95, at_most: 1.0}` [m]. Without `at_most` it only measures.

    to  evaluated actor; None: all actors
    """

    within: Annotated[float, Field(gt=0, le=1000)] = 4.0
    to: str | None = None
    measure: Measure = "mean"
    at_most: Annotated[float, Field(ge=0)] | None = None

    _two_actors = model_validator(mode="after")(require_two_actors)


class PositionError(PerceivedCriterion):
    """Criterion that fails if the horizontal distance between the objects of a station and their actors is too large.

    The objects are compared with the truth at the time of the frame, so that the age of an object is part of its error.
    """

    settings_type = PositionErrorSettings
    name = "position_error"
    unit = "m"

    def __init__(self, settings: PositionErrorSettings) -> None:
        super().__init__(settings, settings.to)
        self._settings = settings
        self._errors = Sample(settings.measure, settings.at_most)

    def evaluate(self, frame: Frame) -> None:
        settings = self._settings
        distances = self.known_actors(frame, settings.source)
        errors = [error for name, error in distances.items() if settings.to is None or name == settings.to]
        self._errors.add(errors, frame.view.time)

    def verdict(self) -> Verdict:
        settings, value = self._settings, self._errors.value
        what = settings.to or "any actor"
        if not self.perceives:
            reason = self.no_perception()
        elif value is None:
            reason = f"{self.of} never knew {what}, so there is no position error"
        else:
            where = f"{self.of}'s {settings.source} objects were {value:.2f} m from {settings.to or 'their actors'}"
            reason = f"{where} {PHRASES[settings.measure]}"
        return self._errors.conclude(self, reason, measured=self.perceives)

    def metrics(self) -> Mapping[str, float]:
        """Return all measures [m]; empty without a known actor."""
        return {f"{self.name}.{self.of}.{measure}": value for measure, value in self._errors.values().items()}
