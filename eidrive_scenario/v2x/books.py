"""The books of one link: what was sent, heard and lost, how late, and how old the newest information is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from eidrive_scenario.v2x.hearings import Heard

DISTANCE_BIN = 25.0
"""Width of the classes of distance between antennas in which receptions are counted [m]."""


@dataclass(frozen=True)
class LinkStatistics:
    """The books of one link; sent = received + lost + in_flight at any time.

    lost_by     how many were lost, by reason
    mean_delay, max_delay  from sending to arrival, over what was received [s]; None before that
    age         of the newest information at the receiver now, since it was said [s]
    mean_age, p95_age, peak_age   average and 95th percentile over time, and mean over the maxima just before each
                update, since the first arrival [s]
    reception   (nearest distance of the class [m], messages whose fate is known, messages that got through)
    busy_ratio  share of the time in which the receiver found the channel busy; None where the channel has no such
    """

    sent: int
    received: int
    lost: int
    in_flight: int
    bytes_sent: int
    mean_delay: float | None
    max_delay: float | None
    age: float | None
    mean_age: float | None
    peak_age: float | None
    p95_age: float | None = None
    lost_by: Mapping[str, int] = field(default_factory=dict)
    reception: tuple[tuple[float, int, int], ...] = ()
    busy_ratio: float | None = None

    def as_json(self) -> dict[str, Any]:
        """For `--json`: times in s, sizes in bytes."""
        written = asdict(self)
        written["reception"] = [
            {"from_m": nearest, "fates": fates, "ratio": through / fates} for nearest, fates, through in self.reception
        ]
        return written


@dataclass(slots=True)
class Book:
    """What is written down of one link as it is used; what was heard stands in the Hearings of all links."""

    sent: int = 0
    lost: int = 0
    bytes_sent: int = 0
    lost_by: dict[str, int] = field(default_factory=dict)
    fates: dict[int, int] = field(default_factory=dict)
    deliveries: dict[int, int] = field(default_factory=dict)
    """By class of distance: how many fates are known, and how many of them are deliveries."""

    def lose(self, reason: str, count: int = 1) -> None:
        """Messages were lost."""
        self.lost += count
        self.lost_by[reason] = self.lost_by.get(reason, 0) + count

    def fate(self, distance: float, delivered: bool) -> None:
        """The fate of a message over this distance [m] is known."""
        self.decide(int(distance // DISTANCE_BIN), 1, int(delivered))

    def decide(self, place: int, known: int, delivered: int) -> None:
        """So many fates are known in this class of distance, and so many of them are deliveries."""
        self.fates[place] = self.fates.get(place, 0) + known
        self.deliveries[place] = self.deliveries.get(place, 0) + delivered

    def statistics(self, now: float, heard: Heard | None, busy_ratio: float | None = None) -> LinkStatistics:
        """The books as they stand; `heard` is None where nothing was yet."""
        received = 0 if heard is None else heard.received
        return LinkStatistics(
            sent=self.sent,
            received=received,
            lost=self.lost,
            in_flight=self.sent - received - self.lost,
            bytes_sent=self.bytes_sent,
            mean_delay=None if heard is None else heard.delay_sum / received,
            max_delay=None if heard is None else heard.delay_max,
            age=None if heard is None else now - heard.newest,
            mean_age=None if heard is None else heard.mean_age,
            peak_age=None if heard is None else heard.peak_age,
            p95_age=None if heard is None else heard.p95_age,
            lost_by=dict(sorted(self.lost_by.items())),
            reception=tuple(
                (DISTANCE_BIN * place, known, self.deliveries[place]) for place, known in sorted(self.fates.items())
            ),
            busy_ratio=busy_ratio,
        )
