"""The books of one link: what was sent, heard and lost, how late, and how old the newest information is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from eidrive_scenario.v2x.statistics.reception_log import ReceptionStatistics

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
    reception   (nearest distance of the class [m], messages whose outcome is known, delivered messages)
    channel_busy_ratio  share of time in which the receiver measures a busy channel; None if the channel has none
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
    channel_busy_ratio: float | None = None

    def as_json(self) -> dict[str, Any]:
        """For `--json`: times in s, sizes in bytes."""
        written = asdict(self)
        written["reception"] = [
            {"from_m": nearest, "messages": messages, "delivery_ratio": delivered / messages}
            for nearest, messages, delivered in self.reception
        ]
        return written


@dataclass(slots=True)
class LinkCounters:
    """What is written down of one link as it is used; what was heard stands in the ReceptionLog of all links."""

    sent: int = 0
    lost: int = 0
    bytes_sent: int = 0
    lost_by: dict[str, int] = field(default_factory=dict)
    outcomes_by_distance: dict[int, int] = field(default_factory=dict)
    deliveries_by_distance: dict[int, int] = field(default_factory=dict)
    """By class of distance: how many fates are known, and how many of them are deliveries."""

    def count_loss(self, reason: str, count: int = 1) -> None:
        """Messages were lost."""
        self.lost += count
        self.lost_by[reason] = self.lost_by.get(reason, 0) + count

    def count_outcome(self, distance: float, delivered: bool) -> None:
        """The fate of a message over this distance [m] is known."""
        self.count_outcomes(int(distance // DISTANCE_BIN), 1, int(delivered))

    def count_outcomes(self, place: int, known: int, delivered: int) -> None:
        """So many fates are known in this class of distance, and so many of them are deliveries."""
        self.outcomes_by_distance[place] = self.outcomes_by_distance.get(place, 0) + known
        self.deliveries_by_distance[place] = self.deliveries_by_distance.get(place, 0) + delivered

    def statistics(
        self, now: float, heard: ReceptionStatistics | None, channel_busy_ratio: float | None = None
    ) -> LinkStatistics:
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
            age=None if heard is None else now - heard.newest_generation_time,
            mean_age=None if heard is None else heard.mean_age,
            peak_age=None if heard is None else heard.peak_age,
            p95_age=None if heard is None else heard.p95_age,
            lost_by=dict(sorted(self.lost_by.items())),
            reception=tuple(
                (DISTANCE_BIN * place, known, self.deliveries_by_distance[place])
                for place, known in sorted(self.outcomes_by_distance.items())
            ),
            channel_busy_ratio=channel_busy_ratio,
        )
