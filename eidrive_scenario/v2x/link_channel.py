"""Base class of channels that model every link independently."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence

from eidrive_scenario.v2x.channel import OutgoingMessage
from eidrive_scenario.v2x.messages.message import LinkEvent, Message
from eidrive_scenario.v2x.queued_channel import QueuedChannel


class LinkChannel(QueuedChannel):
    """Base class of channels that model every link independently.

    It enforces causal delivery and maintains link statistics. A subclass implements `transmission_outcome`.
    """

    @abstractmethod
    def transmission_outcome(self, message: Message, receiver: str, now: float) -> float | str:
        """Return the delay of a message on one link [s], at least 0, or the reason for its loss."""

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
