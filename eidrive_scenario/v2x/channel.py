"""Interface between stations and the radio: a `Channel` accepts messages and delivers them on arrival."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence

from eidrive_scenario.errors import Diagnostic, SettingError
from eidrive_scenario.v2x.messages.message import LinkEvent, Message, ReceivedMessage
from eidrive_scenario.v2x.radio_environment import EMPTY_RADIO_ENVIRONMENT, RadioEnvironment
from eidrive_scenario.v2x.statistics.link_statistics import Links, LinkStatistics

OutgoingMessage = tuple[Message, Sequence[str]]
"""A message and its receivers."""


class Channel(ABC):
    """Abstract base class for channels, which carry messages between stations.

    A message is never delivered before it arrives or in the tick in which it is sent. Loss and delay are drawn once
    per message and link, from a generator keyed by (seed, purpose, sender, receiver, message number).

    A channel model is a class with a `settings_type`, its subclass of ChannelProfile. It is constructed as
    `Model(profile, seed)`. Each tick calls `update_environment`, then `deliver` for every station, then `transmit`.
    """

    own_perception: bool = False
    """True if the channel also carries the own detections of a station, on a link from the station to itself."""

    def update_environment(self, surroundings: RadioEnvironment) -> None:  # noqa: B027 - optional
        """Set the current antenna positions and the query for lines of sight."""

    @abstractmethod
    def send(self, message: Message, receivers: Sequence[str], now: float) -> Sequence[LinkEvent]:
        """Send a message on its links. Return events of all messages whose outcome is known.

        If `own_perception` is True, the sender is also listed among the receivers. Its link is an ordinary one.
        """

    def transmit(self, outbox: Sequence[OutgoingMessage], now: float) -> Sequence[LinkEvent]:
        """Send all messages of one tick, possibly none. Return events of all messages whose outcome is known.

        Channels with many messages may store the outcomes in arrays and return LinkEvents.
        """
        return [event for message, receivers in outbox for event in self.send(message, receivers, now)]

    def drain_events(self) -> Sequence[LinkEvent]:
        """Return events of all messages whose outcome has become known since the last call or transmission.

        It is called after the last tick of a run, in which nothing is transmitted.
        """
        return ()

    @abstractmethod
    def deliver(self, receiver: str, now: float) -> tuple[ReceivedMessage, ...]:
        """Return messages that have arrived at `receiver` by `now` [s], each once, in order of arrival."""

    def min_message_interval(self, station: str) -> float:
        """Return the minimum interval between messages that congestion control requires [s]; 0 without it.

        This is T_GenCam_DCC of ETSI EN 302 637-2.
        """
        return 0.0

    @abstractmethod
    def statistics(self, now: float) -> Mapping[tuple[str, str], LinkStatistics]:
        """Return the statistics of every link, by (sender, receiver)."""

    @abstractmethod
    def continue_from(self, previous: Channel) -> None:
        """Take the state of a channel that is replaced during a run; its messages in flight keep their outcome."""


class QueuedChannel(Channel):
    """Base class of channels that deliver messages from queues, with link statistics.

    Messages in flight are passed on to a channel that replaces this one.
    """

    def __init__(self) -> None:
        self._links = Links()
        self.surroundings = EMPTY_RADIO_ENVIRONMENT
        """Current antenna positions."""
        self._last_arrival: dict[tuple[str, str], float] = {}
        """Arrival of the last message on each link [s], for models that keep the order of messages."""

        self._remaining: list[LinkEvent] = []

    def update_environment(self, surroundings: RadioEnvironment) -> None:
        if surroundings.names != self.surroundings.names:
            for name in set(self.surroundings.names).difference(surroundings.names):
                self._links.remove(name)
        self.surroundings = surroundings

    def deliver(self, receiver: str, now: float) -> tuple[ReceivedMessage, ...]:
        return self._links.deliver(receiver, now)

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
        self._last_arrival = self._links.last_arrivals()
        self.surroundings = previous.surroundings
        self._remaining = list(previous.drain_events())

    def finalize(self) -> None:
        """Determine all pending outcomes before another channel replaces this one."""

    def drain_events(self) -> Sequence[LinkEvent]:
        events, self._remaining = self._remaining, []
        return events


class LinkChannel(QueuedChannel):
    """Base class of channels that model every link independently.

    It enforces causal delivery and maintains link statistics. A subclass implements `transmission_outcome`.
    """

    @abstractmethod
    def transmission_outcome(self, message: Message, receiver: str, now: float) -> float | str:
        """Return the delay of a message on one link [s], at least 0, or the reason for its loss."""

    def send(self, message: Message, receivers: Sequence[str], now: float) -> Sequence[LinkEvent]:
        return tuple(
            [
                self._links.send(
                    message,
                    receiver,
                    now,
                    self.transmission_outcome(message, receiver, now),
                    self.surroundings.distance(message.sender, receiver),
                )
                for receiver in receivers
            ]
        )

    def transmit(self, outbox: Sequence[OutgoingMessage], now: float) -> Sequence[LinkEvent]:
        return [*self.drain_events(), *super().transmit(outbox, now)]
