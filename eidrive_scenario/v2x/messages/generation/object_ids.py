"""Object ids that identify the objects of a station across messages."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from eidrive_scenario.assignment import associate
from eidrive_scenario.detections import Detections
from eidrive_scenario.v2x.messages.generation.cpm import RETENTION

GATE = 3.0
"""Maximum distance between an object and the predicted position of the same object [m].

A design choice, not taken from a standard: an object of unknown velocity keeps its id up to 30 m/s if it is detected
every 0.1 s, and the distance is less than that between the centers of two lanes of 3.5 m.
"""


class ObjectIdAssigner:
    """Assignment of object ids: those of the tracker, or else of the nearest predicted earlier object."""

    def __init__(self) -> None:
        self._next = 0
        self._known: dict[int, tuple[float, float, float, float, float]] = {}

    def assign_ids(self, detections: Detections) -> Sequence[int]:
        """Return one object id per row."""
        if detections.tracks or not len(detections):
            return detections.tracks
        now = detections.time
        self._known = {number: last for number, last in self._known.items() if now - last[0] <= RETENTION}
        places = detections.boxes[:, :2]
        assigned: list[int | None] = [None] * len(detections)
        known = list(self._known)
        if known:
            expected = np.array([self._predict(number, now) for number in known])
            for row, column in associate(places, expected, GATE):
                assigned[row] = known[column]
        numbers = []
        for row, number in enumerate(assigned):
            if number is None:
                number, self._next = self._next, self._next + 1
            x, y = places[row].tolist()
            vx, vy = (0.0 if math.isnan(v) else v for v in detections.velocity[row].tolist())
            self._known[number] = (now, x, y, vx, vy)
            numbers.append(number)
        return tuple(numbers)

    def _predict(self, number: int, now: float) -> tuple[float, float]:
        time, x, y, vx, vy = self._known[number]
        return x + vx * (now - time), y + vy * (now - time)
