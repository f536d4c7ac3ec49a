"""The base of channels that decide about each link by itself; causality and books are done here once."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence

from eidrive_scenario.v2x.channel import Channel, OutgoingMessage
from eidrive_scenario.v2x.messages.message import LinkEvent, Message, ReceivedMessage
from eidrive_scenario.v2x.radio_environment import EMPTY_RADIO_ENVIRONMENT, RadioEnvironment
from eidrive_scenario.v2x.statistics.links import Links, LinkStatistics


class LinkChannel(Channel):
    """A subclass returns in `transmission_outcome` how long a message takes on one link, or why it is lost."""

    def __init__(self) -> None:
        self._links = Links()
        self.surroundings = EMPTY_RADIO_ENVIRONMENT
        """Where the antennas are."""

        self._remaining: list[LinkEvent] = []

    @abstractmethod
    def transmission_outcome(self, message: Message, receiver: str, now: float) -> float | str:
        """The delay on this link, at least 0 [s]; or the reason for which the message is lost."""

    def update_environment(self, surroundings: RadioEnvironment) -> None:
        self.surroundings = surroundings

    def send(self, message: Message, receivers: Sequence[str], now: float) -> Sequence[LinkEvent]:
        events = []
        for receiver in receivers:
            fate = self.transmission_outcome(message, receiver, now)
            distance = self.surroundings.distance(message.sender, receiver)
            if isinstance(fate, str):
                events.append(self._links.record_loss(message, receiver, now, fate, distance))
            else:
                events.append(self._links.enqueue_delivery(message, receiver, now, fate, distance))
        return tuple(events)

    def transmit(self, outbox: Sequence[OutgoingMessage], now: float) -> Sequence[LinkEvent]:
        return [*self.drain_events(), *super().transmit(outbox, now)]

    def deliver(self, receiver: str, now: float) -> tuple[ReceivedMessage, ...]:
        return self._links.deliver(receiver, now)

    def in_flight(self) -> int:
        return self._links.in_flight()

    def statistics(self, now: float) -> Mapping[tuple[str, str], LinkStatistics]:
        return self._links.statistics(now, self.channel_busy_ratio)

    def channel_busy_ratio(self, station: str) -> float | None:
        """Share of the time in which this station found the channel busy; None where there is no such thing."""
        return None

    def continue_from(self, previous: Channel) -> None:
        """Share the links of the previous channel. Raises TypeError if that is no LinkChannel."""
        if not isinstance(previous, LinkChannel):
            raise TypeError(f"{type(self).__name__} cannot carry on for a {type(previous).__name__}")
        previous.finalize()
        self._links = previous._links
        self._remaining = list(previous.drain_events())

    def finalize(self) -> None:
        """Decide at once whatever is undecided: another channel takes over."""

    def drain_events(self) -> Sequence[LinkEvent]:
        """Return events of all messages whose outcome has become known since the last call."""
        events, self._remaining = self._remaining, []
        return events
