"""Statistics of links, and the links of a channel with their queues and counters."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Collection, Mapping
from dataclasses import asdict, dataclass, field, replace
from numbers import Real
from typing import Any

from eidrive_scenario.base.tolerances import TIME_TOLERANCE
from eidrive_scenario.v2x.messages.message import LinkEvent, Message, ReceivedMessage
from eidrive_scenario.v2x.statistics.reception_log import Entry, ReceptionLog, ReceptionStatistics, queue_entry

DISTANCE_BIN = 25.0
"""Width of the distance classes in which outcomes are counted [m]."""


@dataclass(frozen=True)
class LinkStatistics:
    """Statistics of one link; sent = received + lost + in_flight at any time.

    lost_by     number of lost messages, by reason
    mean_delay, max_delay  from sending to arrival of received messages [s]; None before the first reception
    age         age of information at the receiver: time since generation of the newest received message [s]
    mean_age, p95_age, peak_age   mean and 95th percentile over time, and mean age immediately before an update,
                since the first reception [s], while both stations are present
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

    def count_outcomes(self, distance_class: int, outcomes: int, deliveries: int) -> None:
        """Count known outcomes and deliveries in a distance class."""
        self.outcomes_by_distance[distance_class] = self.outcomes_by_distance.get(distance_class, 0) + outcomes
        self.deliveries_by_distance[distance_class] = self.deliveries_by_distance.get(distance_class, 0) + deliveries

    def statistics(self, receptions: ReceptionStatistics, channel_busy_ratio: float | None) -> LinkStatistics:
        """Return the statistics of the link with these receptions."""
        return LinkStatistics(
            **receptions._asdict(),
            sent=self.sent,
            lost=self.lost,
            in_flight=self.sent - receptions.received - self.lost,
            bytes_sent=self.bytes_sent,
            lost_by=dict(sorted(self.lost_by.items())),
            reception=tuple(
                (DISTANCE_BIN * distance_class, outcomes, self.deliveries_by_distance[distance_class])
                for distance_class, outcomes in sorted(self.outcomes_by_distance.items())
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


ABSENT = "absent"
"""Reason for the loss of a message whose sender or receiver has left the world."""


class Links:
    """Queues of messages in flight. This class alone enforces causality.

    A message is delivered once, at the first call with now >= arrival and now > sending.
    """

    def __init__(self) -> None:
        self._queues: defaultdict[str, list[Entry]] = defaultdict(list)
        self._counters: defaultdict[tuple[str, str], LinkCounters] = defaultdict(LinkCounters)
        """By sender and receiver."""
        self._reception_log = ReceptionLog()
        self._now = -math.inf
        """Time of the last delivery [s]."""

    def counters(self, sender: str, receiver: str) -> LinkCounters:
        """Return the counters of a link; create them if the link is new."""
        return self._counters[sender, receiver]

    def send(
        self, message: Message, receiver: str, now: float, outcome: float | str, distance: float | None = None
    ) -> LinkEvent:
        """Send a message at `now` [s] that arrives after a delay [s], or is lost for a reason, by `outcome`.

        distance  between the antennas [m]; None: the message is not counted in a distance class

        Raise ValueError unless a delay is a finite number of at least 0 s.
        """
        # A truth value, of a model that returns whether a message arrives, would be a delay of 0 or 1 s
        given: object = outcome
        if not isinstance(outcome, str) and (
            isinstance(given, bool) or not isinstance(given, Real) or not 0.0 <= float(given) < math.inf
        ):
            raise ValueError(
                f"delay of a message to {receiver!r} is invalid (got {outcome}; expected at least 0 s, finite)"
            )
        counters = self.counters(message.sender, receiver)
        counters.sent += 1
        counters.bytes_sent += message.size
        if isinstance(outcome, str):
            return self.lose(message, receiver, now, outcome, distance)
        if distance is not None:
            counters.count_outcome(distance, True)
        arrives = now + outcome
        self.enqueue(queue_entry(message, now, arrives), receiver)
        return LinkEvent(message.sender, receiver, message.number, now, "delivered", arrives, "", message.size)

    def lose(
        self, message: Message, receiver: str, sent: float, reason: str, distance: float | None = None
    ) -> LinkEvent:
        """Count the loss of a message that is counted as sent already."""
        counters = self.counters(message.sender, receiver)
        counters.count_loss(reason)
        if distance is not None:
            counters.count_outcome(distance, False)
        return LinkEvent(message.sender, receiver, message.number, sent, "lost", None, reason, message.size)

    def enqueue(self, entry: Entry, *receivers: str) -> None:
        """Add a message in flight that is already counted as sent."""
        for receiver in receivers:
            self._queues[receiver].append(entry)

    def deliver(self, receiver: str, now: float) -> tuple[ReceivedMessage, ...]:
        """Return messages that have arrived by `now`, each once, by time of arrival, sender and number."""
        self._now = now
        queue = self._queues.get(receiver)
        if not queue:
            return ()
        latest, oldest = now + TIME_TOLERANCE, now - TIME_TOLERANCE
        due = [entry for entry in queue if entry[0] <= latest and entry[3] <= oldest]
        if not due:
            return ()
        if len(due) == len(queue):
            queue.clear()
        else:
            queue[:] = [entry for entry in queue if entry[0] > latest or entry[3] > oldest]
        due.sort()
        self._reception_log.record(receiver, due)
        return tuple([entry[4] for entry in due])

    def last_arrivals(self) -> dict[tuple[str, str], float]:
        """Return the time of arrival of the last message in flight on each link [s], by (sender, receiver)."""
        arrivals: dict[tuple[str, str], float] = {}
        for receiver, queue in self._queues.items():
            for arrives, sender, *_ in queue:
                arrivals[sender, receiver] = max(arrives, arrivals.get((sender, receiver), arrives))
        return arrivals

    def remove(self, station: str) -> None:
        """End the links of a station that has left: messages in flight to it are lost, and no age is counted."""
        for _, sender, *_ in self._queues.pop(station, ()):
            self.counters(sender, station).count_loss(ABSENT)
        self._reception_log.end_links(station, self._now)

    def statistics(
        self, now: float, channel_busy_ratio: Callable[[str], float | None] = lambda station: None
    ) -> dict[tuple[str, str], LinkStatistics]:
        """Return the statistics of every link at `now` [s], by (sender, receiver) in alphabetical order.

        `channel_busy_ratio` returns the channel busy ratio that a station measures.
        """
        receptions = self._reception_log.statistics_by_link(now)
        receivers = dict.fromkeys(receiver for _, receiver in self._counters)
        busy = {receiver: channel_busy_ratio(receiver) for receiver in receivers}
        return {
            link: self._counters[link].statistics(receptions.get(link, ReceptionStatistics()), busy[link[1]])
            for link in sorted(self._counters)
        }
