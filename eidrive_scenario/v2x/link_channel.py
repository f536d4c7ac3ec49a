"""Base class of channels that model every link independently, with causal delivery and link statistics."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence

from eidrive_scenario.errors import Diagnostic, SettingError
from eidrive_scenario.v2x.channel import Channel, OutgoingMessage
from eidrive_scenario.v2x.messages.message import LinkEvent, Message, ReceivedMessage
from eidrive_scenario.v2x.radio_environment import EMPTY_RADIO_ENVIRONMENT, RadioEnvironment
from eidrive_scenario.v2x.statistics.links import Links, LinkStatistics


class LinkChannel(Channel):
    """Base class of channels that model every link independently.

    It enforces causal delivery and maintains link statistics. A subclass implements `transmission_outcome`.
    """

    def __init__(self) -> None:
        self._links = Links()
        self.surroundings = EMPTY_RADIO_ENVIRONMENT
        """Current antenna positions."""

        self._remaining: list[LinkEvent] = []

    @abstractmethod
    def transmission_outcome(self, message: Message, receiver: str, now: float) -> float | str:
        """Return the delay of a message on one link [s], at least 0, or the reason for its loss."""

    def update_environment(self, surroundings: RadioEnvironment) -> None:
        self.surroundings = surroundings

    def send(self, message: Message, receivers: Sequence[str], now: float) -> Sequence[LinkEvent]:
        events = []
        for receiver in receivers:
            outcome = self.transmission_outcome(message, receiver, now)
            distance = self.surroundings.distance(message.sender, receiver)
            if isinstance(outcome, str):
                events.append(self._links.record_loss(message, receiver, now, outcome, distance))
            else:
                events.append(self._links.enqueue_delivery(message, receiver, now, outcome, distance))
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
        """Return the channel busy ratio that this station measures; None if the model has none."""
        return None

    def continue_from(self, previous: Channel) -> None:
        """Take the links of the previous channel. Raise SettingError if it is not a LinkChannel."""
        if not isinstance(previous, LinkChannel):
            message = f"{type(self).__name__} cannot take over the messages of {type(previous).__name__}"
            raise SettingError(Diagnostic(message, "select only channels that are derived from LinkChannel"))
        previous.finalize()
        self._links = previous._links
        self._remaining = list(previous.drain_events())

    def finalize(self) -> None:
        """Determine all pending outcomes before another channel replaces this one."""

    def drain_events(self) -> Sequence[LinkEvent]:
        """Return events of all messages whose outcome has become known since the last call."""
        events, self._remaining = self._remaining, []
        return events
