"""Interface between stations and the radio: a `Channel` accepts messages and delivers them on arrival."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence

from eidrive_scenario.v2x.messages.message import LinkEvent, Message, ReceivedMessage
from eidrive_scenario.v2x.radio_environment import RadioEnvironment
from eidrive_scenario.v2x.statistics.link_statistics import LinkStatistics

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
    def in_flight(self) -> int:
        """Return the number of messages in flight."""

    @abstractmethod
    def statistics(self, now: float) -> Mapping[tuple[str, str], LinkStatistics]:
        """Return the statistics of every link, by (sender, receiver)."""

    @abstractmethod
    def continue_from(self, previous: Channel) -> None:
        """Take the state of a channel that is replaced during a run; its messages in flight keep their outcome."""
