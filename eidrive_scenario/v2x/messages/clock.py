"""The clock of a station, which is never quite right."""

from __future__ import annotations

from dataclasses import dataclass, replace

from eidrive_scenario.v2x.messages.message import Message


@dataclass(frozen=True)
class StationClock:
    """Shows true time + offset + drift · true time [s]; `drift` is a share, 20e-6 for 20 parts per million."""

    offset: float = 0.0
    drift: float = 0.0

    def error(self, now: float) -> float:
        """How much it is ahead [s]."""
        return self.offset + self.drift * now

    def with_station_timestamps(self, message: Message, now: float) -> Message:
        """A message of this station, its time stamps as this clock shows them; `generated` stays the true instant."""
        return _moved(message, self.error(now))

    def with_local_timestamps(self, message: Message, now: float) -> Message:
        """A received message, its time stamps as this station takes them: it believes its own clock."""
        return _moved(message, -self.error(now))


def _moved(message: Message, error: float) -> Message:
    if error == 0.0:
        return message
    return replace(
        message,
        detections=replace(message.detections, time=message.detections.time + error),
        state=replace(message.state, time=message.state.time + error),
    )
