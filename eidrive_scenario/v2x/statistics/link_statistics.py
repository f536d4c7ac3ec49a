"""Statistics of one link: sent, received and lost messages, delays, and age of information."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from eidrive_scenario.v2x.statistics.reception_log import ReceptionStatistics

DISTANCE_BIN = 25.0
"""Width of the distance classes in which outcomes are counted [m]."""


@dataclass(frozen=True)
class LinkStatistics:
    """Statistics of one link; sent = received + lost + in_flight at any time.

    lost_by     number of lost messages, by reason
    mean_delay, max_delay  from sending to arrival of received messages [s]; None before the first reception
    age         age of information at the receiver: time since generation of the newest received message [s]
    mean_age, p95_age, peak_age   mean and 95th percentile over time, and mean age immediately before an update,
                since the first reception [s]
    reception   by distance class: lower bound [m], messages whose outcome is known, delivered messages
    channel_busy_ratio  share of time in which the receiver measures a busy channel; None if the model has none
    expired     number of received messages that the receiver does not use because they are too old
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
    expired: int = 0

    def as_json(self) -> dict[str, Any]:
        """Return the fields for `--json`: times in seconds, sizes in bytes."""
        written = asdict(self)
        written["reception"] = [
            {"from_m": nearest, "messages": messages, "delivery_ratio": delivered / messages}
            for nearest, messages, delivered in self.reception
        ]
        return written


@dataclass(slots=True)
class LinkCounters:
    """Counters of one link. Receptions are counted in the `ReceptionLog` of all links."""

    sent: int = 0
    lost: int = 0
    bytes_sent: int = 0
    lost_by: dict[str, int] = field(default_factory=dict)
    outcomes_by_distance: dict[int, int] = field(default_factory=dict)
    deliveries_by_distance: dict[int, int] = field(default_factory=dict)
    """Number of known outcomes and of deliveries, by distance class."""

    def count_loss(self, reason: str, count: int = 1) -> None:
        """Count lost messages."""
        self.lost += count
        self.lost_by[reason] = self.lost_by.get(reason, 0) + count

    def count_outcome(self, distance: float, delivered: bool) -> None:
        """Count the outcome of a message over this distance [m]."""
        self.count_outcomes(int(distance // DISTANCE_BIN), 1, int(delivered))

    def count_outcomes(self, place: int, known: int, delivered: int) -> None:
        """Count known outcomes and deliveries in a distance class."""
        self.outcomes_by_distance[place] = self.outcomes_by_distance.get(place, 0) + known
        self.deliveries_by_distance[place] = self.deliveries_by_distance.get(place, 0) + delivered

    def statistics(
        self, now: float, receptions: ReceptionStatistics | None, channel_busy_ratio: float | None = None
    ) -> LinkStatistics:
        """Return the statistics at `now` [s]; `receptions` is None before the first reception."""
        received = 0 if receptions is None else receptions.received
        return LinkStatistics(
            sent=self.sent,
            received=received,
            lost=self.lost,
            in_flight=self.sent - received - self.lost,
            bytes_sent=self.bytes_sent,
            mean_delay=None if receptions is None else receptions.delay_sum / received,
            max_delay=None if receptions is None else receptions.delay_max,
            age=None if receptions is None else now - receptions.newest_generation_time,
            mean_age=None if receptions is None else receptions.mean_age,
            peak_age=None if receptions is None else receptions.peak_age,
            p95_age=None if receptions is None else receptions.p95_age,
            lost_by=dict(sorted(self.lost_by.items())),
            reception=tuple(
                (DISTANCE_BIN * place, known, self.deliveries_by_distance[place])
                for place, known in sorted(self.outcomes_by_distance.items())
            ),
            channel_busy_ratio=channel_busy_ratio,
        )


def with_expired(
    links: Mapping[tuple[str, str], LinkStatistics], expired: Mapping[tuple[str, str], int]
) -> Mapping[tuple[str, str], LinkStatistics]:
    """Return the statistics with the number of expired messages, both by sender and receiver."""
    if not expired:
        return links
    return {stations: replace(link, expired=expired.get(stations, 0)) for stations, link in links.items()}


def message_counts(links: Collection[LinkStatistics]) -> dict[str, float]:
    """Return the counts of messages over all links, as metrics of a run."""
    return {
        "messages.sent": sum(link.sent for link in links),
        "messages.received": sum(link.received for link in links),
        "messages.lost": sum(link.lost for link in links),
        "messages.expired": sum(link.expired for link in links),
        "messages.bytes": sum(link.bytes_sent for link in links),
    }
