"""Base class of channels with queues of messages in flight: causal delivery and link statistics."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from eidrive_scenario.errors import Diagnostic, SettingError
from eidrive_scenario.v2x.channel import Channel
from eidrive_scenario.v2x.messages.message import LinkEvent, ReceivedMessage
from eidrive_scenario.v2x.radio_environment import EMPTY_RADIO_ENVIRONMENT, RadioEnvironment
from eidrive_scenario.v2x.statistics.link_statistics import LinkStatistics
from eidrive_scenario.v2x.statistics.links import Links


class QueuedChannel(Channel):
    """Base class of channels that deliver messages from queues, with link statistics.

    Messages in flight are passed on to a channel that replaces this one.
    """

    def __init__(self) -> None:
        self._links = Links()
        self.surroundings = EMPTY_RADIO_ENVIRONMENT
        """Current antenna positions."""

        self._remaining: list[LinkEvent] = []

    def update_environment(self, surroundings: RadioEnvironment) -> None:
        if surroundings.names != self.surroundings.names:
            for name in set(self.surroundings.names).difference(surroundings.names):
                self._links.remove(name)
        self.surroundings = surroundings

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
        """Take the links of the previous channel. Raise SettingError if it is not a QueuedChannel."""
        if not isinstance(previous, QueuedChannel):
            message = f"{type(self).__name__} cannot continue the messages of {type(previous).__name__}"
            raise SettingError(Diagnostic(message, "derive both channels from LinkChannel"))
        previous.finalize()
        self._links = previous._links
        self.surroundings = previous.surroundings
        self._remaining = list(previous.drain_events())

    def finalize(self) -> None:
        """Determine all pending outcomes before another channel replaces this one."""

    def drain_events(self) -> Sequence[LinkEvent]:
        events, self._remaining = self._remaining, []
        return events
