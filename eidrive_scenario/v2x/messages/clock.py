"""Station clock with offset and drift."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

from msgspec.structs import replace

from eidrive_scenario.v2x.messages.message import Message


@dataclass(frozen=True)
class StationClock:
    """Clock that shows true time + offset + drift · true time [s]; `drift` is a ratio, 20e-6 for 20 ppm."""

    offset: float = 0.0
    drift: float = 0.0

    def error(self, now: float) -> float:
        """Return the difference between station time and true time [s]."""
        return self.offset + self.drift * now

    def with_station_timestamps(self, message: Message, now: float) -> Message:
        """Return a message of this station with timestamps of this clock; `generated` stays in true time."""
        return _shift_timestamps(message, self.error(now))

    def with_local_timestamps(self, message: Message, now: float) -> Message:
        """Return a received message with timestamps relative to this clock, which the station assumes to be true."""
        return _shift_timestamps(message, -self.error(now))


def _shift_timestamps(message: Message, error: float) -> Message:
    if error == 0.0:
        return message
    return replace(
        message,
        detections=replace(message.detections, time=message.detections.time + error),
        state=replace(message.state, time=message.state.time + error),
        points=None
        if message.points is None
        else dataclasses.replace(message.points, time=message.points.time + error),
    )
