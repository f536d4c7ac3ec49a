"""Criterion: number of vehicles that a station knows."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import Field

from eidrive_criteria.folds import BoundedSettings
from eidrive_criteria.perceived import VEHICLES, ActorClass, PerceivedCriterion, PerceivedSettings
from eidrive_scenario.api.common import TIME_TOLERANCE
from eidrive_scenario.api.criteria import Frame, Verdict

Measure = Literal["mean", "min", "max", "total"]

PHRASES: Mapping[Measure, str] = {
    "mean": "on average",
    "min": "at least at any time",
    "max": "at most at any time",
    "total": "in total over the run",
}


class DetectionCountSettings(PerceivedSettings, BoundedSettings):
    """Settings: `{of: Ego, at_least: 12}`, or `{of: Ego, source: own, classes: [pedestrian], measure: max}`.

    classes  true classes of the counted actors; None: all classes of vehicles
    measure  mean, min or max over time of the number at one time; `total`: number of actors known at any time
    after    start of the count [s]
    """

    classes: Annotated[tuple[ActorClass, ...], Field(min_length=1)] | None = None
    measure: Measure = "mean"
    after: Annotated[float, Field(ge=0)] = 0.0


class DetectionCount(PerceivedCriterion):
    """Criterion that fails if the number of different actors of the classes that a station knows is outside the limits.

    An object without an actor does not count, and several objects of one actor count once.
    """

    settings_type = DetectionCountSettings
    name = "detection_count"

    def __init__(self, settings: DetectionCountSettings) -> None:
        super().__init__(settings)
        self._settings = settings
        self._classes = settings.classes or VEHICLES
        self._frames = self._sum = 0
        self._least: int | None = None
        self._most = 0
        self._all: set[str] = set()
        self._violated: float | None = None

    def evaluate(self, frame: Frame) -> None:
        view, settings = frame.view, self._settings
        if view.time < settings.after - TIME_TOLERANCE:
            return
        distances = self.known_actors(frame, settings.source)
        counted = [name for name in distances if view.categories[view.rows[name]] in self._classes]
        self._frames += 1
        self._sum += len(counted)
        self._least = len(counted) if self._least is None else min(self._least, len(counted))
        self._most = max(self._most, len(counted))
        self._all.update(counted)
        if self._violated is None and self._is_exceeded():
            self._violated = view.time

    def _is_exceeded(self) -> bool:
        """Return whether a violation is final: a minimum only decreases, a maximum and a total only increase."""
        value, settings = self._values()[self._settings.measure], self._settings
        if settings.measure == "mean":
            return False
        return settings.is_below(value) if settings.measure == "min" else settings.is_above(value)

    def _values(self) -> dict[Measure, float]:
        """Return the value of each measure; empty without a frame."""
        if self._least is None:
            return {}
        return {
            "mean": self._sum / self._frames,
            "min": float(self._least),
            "max": float(self._most),
            "total": float(len(self._all)),
        }

    def verdict(self) -> Verdict:
        settings, value = self._settings, self._values().get(self._settings.measure)
        what = "vehicles" if settings.classes is None else " or ".join(settings.classes)
        if not self.perceives:
            reason = self.no_perception()
        elif value is None:
            reason = f"{self.of} was not present from {settings.after:.2f} s on"
        else:
            reason = f"{self.of} knew {value:.4g} {what} {PHRASES[settings.measure]} ({settings.source} objects)"
        return self.conclude(
            value is not None and settings.allows(value),
            reason,
            value=value,
            limit=settings.limit_of(value),
            first_violation=self._violated,
        )

    def metrics(self) -> Mapping[str, float]:
        """Return all four measures."""
        return {f"{self.name}.{self.of}.{measure}": value for measure, value in self._values().items()}
