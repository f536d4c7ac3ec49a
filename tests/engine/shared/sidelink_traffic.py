"""Stations that transmit by a sidelink, and a record of all transmissions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from radio_traffic import QUIET, Place, message

from eidrive_scenario.v2x.messages.message import LinkEvent
from eidrive_scenario.v2x.radio.access import Transmission
from eidrive_scenario.v2x.radio.channel import RadioChannel
from eidrive_scenario.v2x.radio_environment import RadioEnvironment

MODE_4: dict[str, Any] = {**QUIET, "technology": "cv2x_mode4", "jitter": 0.0}
MODE_2: dict[str, Any] = {**QUIET, "technology": "nr_v2x_mode2", "jitter": 0.0}
TWO: dict[str, Place] = {"A": (0.0, 0.0, 1.5), "B": (50.0, 0.0, 1.5)}


class Air:
    """Stations on one channel with messages of given sizes and rates, and all their transmissions."""

    def __init__(
        self,
        carrier: RadioChannel,
        places: Mapping[str, Place],
        dt: float = 0.05,
        listeners: int | None = None,
        numbers: int = 1,
    ) -> None:
        """Limit the receivers to the first `listeners` stations; None: all stations receive.

        numbers  distance of the message numbers of two ticks
        """
        self.carrier, self.places, self.dt, self.tick, self.numbers = carrier, dict(places), dt, 0, numbers
        self.listeners = list(places)[:listeners]
        self.events: list[LinkEvent] = []
        self.transmissions: list[Transmission] = []
        begin = carrier._access._begin

        def record(row: int, transmission: Transmission, start: float) -> None:
            begin(row, transmission, start)
            self.transmissions.append(transmission)

        setattr(carrier._access, "_begin", record)  # noqa: B010

    def run(self, seconds: float, every: Mapping[str, int], sizes: Sequence[int] = (190,)) -> Air:
        """Simulate `seconds` [s]; station S has a message in each `every[S]`-th tick."""
        for _ in range(round(seconds / self.dt)):
            now = self.tick * self.dt
            self.carrier.update_environment(RadioEnvironment(self.places))
            outbox = [
                (
                    message(name, self.tick * self.numbers, now, sizes[self.tick % len(sizes)]),
                    [n for n in self.listeners if n != name],
                )
                for name, period in every.items()
                if name in self.places and self.tick % period == 0
            ]
            self.events += self.carrier.transmit(outbox, now)
            self.tick += 1
        return self

    def of(self, name: str) -> list[Transmission]:
        return [entry for entry in self.transmissions if entry.message.sender == name]

    def occupancy(self, since: float, until: float, subchannels: int = 4) -> float:
        """Return the share of used subchannels of all subframes, counted from the transmissions."""
        used = {
            (round(1000 * entry.start) + part, band)
            for entry in self.transmissions
            for part in range(round(1000 * entry.duration))
            for band in range(entry.first_band, entry.first_band + entry.bands)
            if since <= entry.start < until
        }
        return len(used) / (1000.0 * (until - since) * subchannels)


def many(count: int, apart: float = 5.0) -> dict[str, Place]:
    return {f"S{n:03d}": (apart * n, 0.0, 1.5) for n in range(count)}
