"""The base of channels that decide about each link by itself; causality and books are done here once."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence

from eidrive_scenario.v2x.channel import Channel
from eidrive_scenario.v2x.links import Links, LinkStatistics
from eidrive_scenario.v2x.message import LinkEvent, Message, Received


class LinkChannel(Channel):
    """A subclass says in `fate` how long a message takes on one link, or why it is lost."""

    def __init__(self) -> None:
        self._links = Links()

    @abstractmethod
    def fate(self, message: Message, receiver: str, now: float) -> float | str:
        """The delay on this link, at least 0 [s]; or the reason for which the message is lost."""

    def send(self, message: Message, receivers: Sequence[str], now: float) -> tuple[LinkEvent, ...]:
        events = []
        for receiver in receivers:
            fate = self.fate(message, receiver, now)
            if isinstance(fate, str):
                events.append(self._links.lose(message, receiver, now, fate))
            else:
                events.append(self._links.put(message, receiver, now, fate))
        return tuple(events)

    def deliver(self, receiver: str, now: float) -> tuple[Received, ...]:
        return self._links.deliver(receiver, now)

    def in_flight(self) -> int:
        return self._links.in_flight()

    def statistics(self, now: float) -> Mapping[tuple[str, str], LinkStatistics]:
        return self._links.statistics(now)

    def take_over(self, previous: Channel) -> None:
        """Share the links of the previous channel. Raises TypeError if that is no LinkChannel."""
        if not isinstance(previous, LinkChannel):
            raise TypeError(f"{type(self).__name__} cannot carry on for a {type(previous).__name__}")
        self._links = previous._links
