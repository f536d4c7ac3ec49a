"""Detections of one track so far: times, scores and classes."""

from __future__ import annotations

import math

from eidrive_scenario.detections import Detections
from eidrive_scenario.perception.tracking.settings import TrackerSettings
from eidrive_scenario.tolerances import TIME_TOLERANCE


class TrackHistory:
    """Detection history of one track."""

    __slots__ = ("_last_detection", "_names", "_recent", "hits", "is_often_detected", "number", "score")

    def __init__(self) -> None:
        self.is_often_detected = False
        """Whether the object was detected in n of m successive scans."""
        self.number: int | None = None
        """Track number once the track is confirmed."""
        self.hits = 0
        self.score = 0.0
        """Score of the last detection."""
        self._recent: list[bool] = []
        self._names: dict[str, float] = {}
        self._last_detection = -math.inf

    @property
    def name(self) -> str:
        """Class with the largest sum of detection scores."""
        return max(self._names, key=lambda name: self._names[name])

    def record_scan(self, hit: bool, settings: TrackerSettings) -> None:
        """Record whether the scan contained a detection of the object."""
        self.hits += hit
        if not self.is_often_detected:
            self._recent = [*self._recent, hit][-settings.confirm[1] :]
            self.is_often_detected = sum(self._recent) >= settings.confirm[0]

    def record_detection(self, detections: Detections, column: int) -> None:
        """Record the detection that is assigned to the object."""
        self._last_detection = detections.time
        self.score = float(detections.scores[column])
        name = detections.classes[column]
        self._names[name] = self._names.get(name, 0.0) + self.score

    def is_alive(self, now: float, settings: TrackerSettings) -> bool:
        """Return whether the track is kept."""
        if self.is_often_detected:
            return now - self._last_detection <= settings.coast + TIME_TOLERANCE
        return self._recent.count(False) <= settings.confirm[1] - settings.confirm[0]
