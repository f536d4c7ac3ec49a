"""Assembly of the objects of one station from messages that each list a part of them."""

from __future__ import annotations

import math

import numpy as np

from eidrive_scenario.detections import Detections
from eidrive_scenario.v2x.messages.message import Message


class PartialReportAssembler:
    """Store of the last report of each object for at most `timeout` [s]."""

    def __init__(self, timeout: float) -> None:
        self._timeout = timeout
        self._rows: dict[int, tuple[float, Detections]] = {}

    def update(self, message: Message) -> Detections:
        """Add a message; return all known objects predicted to the time of the newest measurement.

        Objects are predicted at their last velocity; objects of unknown velocity keep their position.
        """
        detections = message.detections
        for row, number in enumerate(message.objects or ()):
            held = self._rows.get(number)
            if held is None or held[0] <= detections.time:
                self._rows[number] = (detections.time, detections.subset([row]))
        newest = max([detections.time, *(time for time, _ in self._rows.values())])
        self._rows = {number: held for number, held in self._rows.items() if newest - held[0] <= self._timeout}
        return self._predicted_objects(newest)

    def _predicted_objects(self, time: float) -> Detections:
        if not self._rows:
            return Detections(time)
        numbers = sorted(self._rows)
        known = [self._rows[number][1] for number in numbers]
        boxes = np.concatenate([one.boxes for one in known])
        velocity = np.concatenate([one.velocity for one in known])
        for row, (one, (vx, vy)) in enumerate(zip(known, velocity.tolist(), strict=True)):
            if not math.isnan(vx + vy):
                boxes[row, 0] += vx * (time - one.time)
                boxes[row, 1] += vy * (time - one.time)
        return Detections(
            time,
            boxes,
            np.concatenate([one.scores for one in known]),
            tuple(one.classes[0] for one in known),
            velocity,
            np.concatenate([one.covariance for one in known]),
            tuple(numbers),
            np.concatenate([one.confidence for one in known]),
        )
