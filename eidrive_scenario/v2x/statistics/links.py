"""The links between stations: what is on its way, what has arrived, and the books kept of it."""

from __future__ import annotations

import math
from collections.abc import Callable

from eidrive_scenario.tolerances import TIME_TOLERANCE
from eidrive_scenario.v2x.messages.message import LinkEvent, Message, ReceivedMessage
from eidrive_scenario.v2x.statistics.link_statistics import LinkCounters, LinkStatistics
from eidrive_scenario.v2x.statistics.reception_log import Entry, ReceptionLog

__all__ = ["TIME_TOLERANCE", "LinkStatistics", "Links"]


class Links:
    """Holds messages back until they have arrived. The rule of causality is here and nowhere else:

    a message is given out at the first call with now >= arrival and now > sending, never before, and once.
    """

    def __init__(self) -> None:
        self._queues: dict[str, list[Entry]] = {}
        self._books: dict[str, dict[str, LinkCounters]] = {}
        """By receiver and sender."""
        self._hearings = ReceptionLog()

    def counters(self, sender: str, receiver: str) -> LinkCounters:
        """The book of a link, opened if there is none."""
        books = self._books.get(receiver)
        if books is None:
            books = self._books[receiver] = {}
        book = books.get(sender)
        if book is None:
            book = books[sender] = LinkCounters()
        return book

    def enqueue_delivery(
        self, message: Message, receiver: str, now: float, delay: float, distance: float | None = None
    ) -> LinkEvent:
        """Send a message that arrives `delay` [s] after `now`, over this distance between antennas [m]."""
        try:
            valid = 0.0 <= delay < math.inf
        except TypeError:
            valid = False
        if not valid:
            raise ValueError(f"the delay of a message to {receiver!r} is {delay} (expected seconds from 0 on, finite)")
        arrives = now + delay
        self.enqueue((arrives, message.sender, message.number, now, ReceivedMessage(message, arrives)), receiver)
        book = self._enter(message, receiver)
        if distance is not None:
            book.count_outcome(distance, True)
        return LinkEvent(message.sender, receiver, message.number, now, "delivered", arrives, "", message.size)

    def record_loss(
        self, message: Message, receiver: str, now: float, reason: str, distance: float | None = None
    ) -> LinkEvent:
        """Send a message that never arrives."""
        book = self._enter(message, receiver)
        book.count_loss(reason)
        if distance is not None:
            book.count_outcome(distance, False)
        return LinkEvent(message.sender, receiver, message.number, now, "lost", None, reason, message.size)

    def enqueue(self, entry: Entry, *receivers: str) -> None:
        """Put a message on its way whose sending is in the books."""
        queues = self._queues
        for receiver in receivers:
            if receiver in queues:
                queues[receiver].append(entry)
            else:
                queues[receiver] = [entry]

    def _enter(self, message: Message, receiver: str) -> LinkCounters:
        book = self.counters(message.sender, receiver)
        book.sent += 1
        book.bytes_sent += message.size
        return book

    def deliver(self, receiver: str, now: float) -> tuple[ReceivedMessage, ...]:
        """What has arrived by `now`, each message once, in order of arrival, then of sender and number."""
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
        self._hearings.record(receiver, due)
        return tuple([entry[4] for entry in due])

    def in_flight(self) -> int:
        """How many messages are on their way, over all links."""
        return sum(len(queue) for queue in self._queues.values())

    def statistics(
        self, now: float, channel_busy_ratio: Callable[[str], float | None] = lambda station: None
    ) -> dict[tuple[str, str], LinkStatistics]:
        """The books of every link, by (sender, receiver), at `now` [s], in alphabetical order.

        `channel_busy_ratio` says how busy a station found the channel.
        """
        heard = self._hearings.statistics_by_link(now)
        links = sorted((sender, receiver) for receiver, books in self._books.items() for sender in books)
        busy = {receiver: channel_busy_ratio(receiver) for receiver in self._books}
        return {
            (sender, receiver): self._books[receiver][sender].statistics(
                now, heard.get((sender, receiver)), busy[receiver]
            )
            for sender, receiver in links
        }
