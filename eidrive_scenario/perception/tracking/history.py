"""Detections of one track so far: when, how surely and as what it was detected."""

from __future__ import annotations

import math

from eidrive_scenario.detections import Detections
from eidrive_scenario.perception.tracking.settings import TrackerSettings


class TrackHistory:
    """When a track was seen, how surely and as what."""

    __slots__ = ("_names", "_recent", "_seen", "hits", "number", "often_seen", "score")

    def __init__(self) -> None:
        self.often_seen = False
        """Whether it was detected in n of m successive scans."""
        self.number: int | None = None
        """Its number once it is confirmed."""
        self.hits = 0
        self.score = 0.0
        """Of its last detection."""
        self._recent: list[bool] = []
        self._names: dict[str, float] = {}
        self._seen = -math.inf

    @property
    def name(self) -> str:
        """The class for which the detections' scores add up to the most."""
        return max(self._names, key=lambda name: self._names[name])

    def note(self, hit: bool, settings: TrackerSettings) -> None:
        """Whether the detections just processed show the object."""
        self.hits += hit
        if not self.often_seen:
            self._recent = [*self._recent, hit][-settings.confirm[1] :]
            self.often_seen = sum(self._recent) >= settings.confirm[0]

    def see(self, detections: Detections, column: int) -> None:
        """The object is this detection."""
        self._seen = detections.time
        self.score = float(detections.scores[column])
        name = detections.classes[column]
        self._names[name] = self._names.get(name, 0.0) + self.score

    def goes_on(self, now: float, settings: TrackerSettings) -> bool:
        """Whether the track is worth keeping."""
        if self.often_seen:
            return now - self._seen <= settings.coast + 1e-9
        return self._recent.count(False) <= settings.confirm[1] - settings.confirm[0]
