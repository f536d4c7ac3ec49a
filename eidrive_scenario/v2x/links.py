"""The links between stations: what is on its way, what has arrived, and the books kept of it."""

from __future__ import annotations

import heapq
from dataclasses import dataclass, field

from eidrive_scenario.v2x.message import LinkEvent, Message, Received

TIME_TOLERANCE = 1e-9
"""Two instants nearer than this are one: sums of time steps do not meet exactly in floating point [s]."""


@dataclass(frozen=True)
class LinkStatistics:
    """The books of one link; sent = received + lost + in_flight at any time.

    mean_delay, max_delay  from sending to arrival, over what was received [s]; None before that
    age                    of the newest information at the receiver now, since it was said [s]
    mean_age, peak_age     time average, and mean over the maxima just before each update, since the first arrival [s]
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


@dataclass
class _Book:
    sent: int = 0
    received: int = 0
    lost: int = 0
    bytes_sent: int = 0
    delay_sum: float = 0.0
    delay_max: float = 0.0
    newest: float | None = None
    """When the newest information at the receiver was said [s]."""
    since: float = 0.0
    until: float = 0.0
    age_area: float = 0.0
    peaks: list[float] = field(default_factory=list)

    def arrive(self, said: float, sent: float, arrived: float) -> None:
        self.received += 1
        self.delay_sum += arrived - sent
        self.delay_max = max(self.delay_max, arrived - sent)
        if self.newest is None:
            self.newest, self.since, self.until = said, arrived, arrived
        elif said > self.newest:
            self._age_until(arrived)
            self.peaks.append(arrived - self.newest)
            self.newest = said

    def _age_until(self, time: float) -> None:
        if self.newest is not None and time > self.until:
            middle = (time + self.until) / 2.0
            self.age_area += (time - self.until) * (middle - self.newest)
            self.until = time

    def statistics(self, now: float) -> LinkStatistics:
        self._age_until(now)
        span = self.until - self.since
        return LinkStatistics(
            sent=self.sent,
            received=self.received,
            lost=self.lost,
            in_flight=self.sent - self.received - self.lost,
            bytes_sent=self.bytes_sent,
            mean_delay=self.delay_sum / self.received if self.received else None,
            max_delay=self.delay_max if self.received else None,
            age=None if self.newest is None else now - self.newest,
            mean_age=self.age_area / span if span > 0.0 else None,
            peak_age=sum(self.peaks) / len(self.peaks) if self.peaks else None,
        )


class Links:
    """Holds messages back until they have arrived. The rule of causality is here and nowhere else:

    a message is given out at the first call with now >= arrival and now > sending, never before, and once.
    """

    def __init__(self) -> None:
        self._queues: dict[str, list[tuple[float, str, int, float, Message]]] = {}
        self._books: dict[tuple[str, str], _Book] = {}

    def put(self, message: Message, receiver: str, now: float, delay: float) -> LinkEvent:
        """Send a message that arrives `delay` [s] after `now`."""
        if not delay >= 0.0:
            raise ValueError(f"a delay of {delay} s would let {receiver!r} hear a message before it was said")
        arrives = now + delay
        entry = (arrives, message.sender, message.number, now, message)
        heapq.heappush(self._queues.setdefault(receiver, []), entry)
        self._enter(message, receiver)
        return LinkEvent(message.sender, receiver, message.number, now, "delivered", arrives, "", message.size)

    def lose(self, message: Message, receiver: str, now: float, reason: str) -> LinkEvent:
        """Send a message that never arrives."""
        self._enter(message, receiver).lost += 1
        return LinkEvent(message.sender, receiver, message.number, now, "lost", None, reason, message.size)

    def _enter(self, message: Message, receiver: str) -> _Book:
        book = self._books.setdefault((message.sender, receiver), _Book())
        book.sent += 1
        book.bytes_sent += message.size
        return book

    def deliver(self, receiver: str, now: float) -> tuple[Received, ...]:
        """What has arrived by `now`, each message once, in order of arrival, then of sender and number."""
        queue = self._queues.get(receiver)
        if not queue or queue[0][0] > now + TIME_TOLERANCE:
            return ()
        arrived, just_said = [], []
        while queue and queue[0][0] <= now + TIME_TOLERANCE:
            entry = heapq.heappop(queue)
            arrives, sender, _, sent, message = entry
            if sent > now - TIME_TOLERANCE:
                just_said.append(entry)
                continue
            self._books[sender, receiver].arrive(message.generated, sent, arrives)
            arrived.append(Received(message, arrives))
        for entry in just_said:
            heapq.heappush(queue, entry)
        return tuple(arrived)

    def in_flight(self) -> int:
        """How many messages are on their way, over all links."""
        return sum(len(queue) for queue in self._queues.values())

    def statistics(self, now: float) -> dict[tuple[str, str], LinkStatistics]:
        """The books of every link, by (sender, receiver), at `now` [s], in alphabetical order."""
        return {link: self._books[link].statistics(now) for link in sorted(self._books)}
