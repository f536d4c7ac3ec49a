"""Links between stations: messages in flight, receptions and link statistics."""

from __future__ import annotations

import math
from collections.abc import Callable

from eidrive_scenario.tolerances import TIME_TOLERANCE
from eidrive_scenario.v2x.messages.message import LinkEvent, Message, ReceivedMessage
from eidrive_scenario.v2x.statistics.link_statistics import LinkCounters, LinkStatistics
from eidrive_scenario.v2x.statistics.reception_log import Entry, ReceptionLog, queue_entry

ABSENT = "absent"
"""Reason for the loss of a message whose sender or receiver has left the world."""


class Links:
    """Queues of messages in flight. This class alone enforces causality.

    A message is delivered once, at the first call with now >= arrival and now > sending.
    """

    def __init__(self) -> None:
        self._queues: dict[str, list[Entry]] = {}
        self._counters: dict[str, dict[str, LinkCounters]] = {}
        """By receiver and sender."""
        self._reception_log = ReceptionLog()
        self._now = -math.inf
        """Time of the last delivery [s]."""

    def counters(self, sender: str, receiver: str) -> LinkCounters:
        """Return the counters of a link; create them if the link is new."""
        by_sender = self._counters.get(receiver)
        if by_sender is None:
            by_sender = self._counters[receiver] = {}
        counters = by_sender.get(sender)
        if counters is None:
            counters = by_sender[sender] = LinkCounters()
        return counters

    def enqueue_delivery(
        self, message: Message, receiver: str, now: float, delay: float, distance: float | None = None
    ) -> LinkEvent:
        """Send a message that arrives `delay` [s] after `now`, over this distance between antennas [m].

        Raise ValueError unless the delay is a finite number of at least 0 s.
        """
        try:
            valid = 0.0 <= delay < math.inf
        except TypeError:
            valid = False
        if not valid:
            raise ValueError(
                f"delay of a message to {receiver!r} is invalid (got {delay}; expected at least 0 s, finite)"
            )
        arrives = now + delay
        self.enqueue(queue_entry(message, now, arrives), receiver)
        counters = self._count_sent(message, receiver)
        if distance is not None:
            counters.count_outcome(distance, True)
        return LinkEvent(message.sender, receiver, message.number, now, "delivered", arrives, "", message.size)

    def record_loss(
        self, message: Message, receiver: str, now: float, reason: str, distance: float | None = None
    ) -> LinkEvent:
        """Send a message that is lost for this reason."""
        counters = self._count_sent(message, receiver)
        counters.count_loss(reason)
        if distance is not None:
            counters.count_outcome(distance, False)
        return LinkEvent(message.sender, receiver, message.number, now, "lost", None, reason, message.size)

    def enqueue(self, entry: Entry, *receivers: str) -> None:
        """Add a message in flight that is already counted as sent."""
        queues = self._queues
        for receiver in receivers:
            if receiver in queues:
                queues[receiver].append(entry)
            else:
                queues[receiver] = [entry]

    def _count_sent(self, message: Message, receiver: str) -> LinkCounters:
        counters = self.counters(message.sender, receiver)
        counters.sent += 1
        counters.bytes_sent += message.size
        return counters

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

    def remove(self, receiver: str) -> None:
        """End the links to a station that has left: messages in flight to it are lost, and their age is not counted."""
        for _, sender, *_ in self._queues.pop(receiver, ()):
            self.counters(sender, receiver).count_loss(ABSENT)
        self._reception_log.end_links(receiver, self._now)

    def in_flight(self) -> int:
        """Return the number of messages in flight on all links."""
        return sum(len(queue) for queue in self._queues.values())

    def statistics(
        self, now: float, channel_busy_ratio: Callable[[str], float | None] = lambda station: None
    ) -> dict[tuple[str, str], LinkStatistics]:
        """Return the statistics of every link at `now` [s], by (sender, receiver) in alphabetical order.

        `channel_busy_ratio` returns the channel busy ratio that a station measures.
        """
        receptions = self._reception_log.statistics_by_link(now)
        links = sorted((sender, receiver) for receiver, senders in self._counters.items() for sender in senders)
        busy = {receiver: channel_busy_ratio(receiver) for receiver in self._counters}
        return {
            (sender, receiver): self._counters[receiver][sender].statistics(
                now, receptions.get((sender, receiver)), busy[receiver]
            )
            for sender, receiver in links
        }
