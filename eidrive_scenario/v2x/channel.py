"""The seam between stations and the radio: a Channel takes messages and gives them out when they arrive."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence

from eidrive_scenario.v2x.messages.message import LinkEvent, Message, ReceivedMessage
from eidrive_scenario.v2x.radio_environment import RadioEnvironment
from eidrive_scenario.v2x.statistics.links import LinkStatistics

OutgoingMessage = tuple[Message, Sequence[str]]
"""A message and those who listen."""


class Channel(ABC):
    """Carries messages between stations. Nobody hears a message before it has arrived, nor in the tick it was said.

    Loss and delay are drawn once per message and link, from a generator keyed by
    (seed, purpose, sender, receiver, message number).

    A model is a class with `settings`, the ChannelProfile that it reads, and is built as `Model(profile, seed)`.
    In each tick `update_environment` comes first, then `deliver` for every station, then one `transmit`.
    """

    own_perception: bool = False
    """True: a station's own detections travel this channel too, as a link from the station to itself."""

    def update_environment(self, surroundings: RadioEnvironment) -> None:  # noqa: B027 - a channel need not care
        """Where the antennas are now, and whom to ask for lines of sight between them."""

    @abstractmethod
    def send(self, message: Message, receivers: Sequence[str], now: float) -> Sequence[LinkEvent]:
        """Put a message on its links; the answer says what is known by now of the fates of messages.

        A link from a station to itself is one like any other: list the sender among the receivers where
        `own_perception` asks for it.
        """

    def transmit(self, outbox: Sequence[OutgoingMessage], now: float) -> Sequence[LinkEvent]:
        """All that the stations say in one tick; it may be nothing.

        Any sequence of events will do as the answer. A channel that decides about very many messages may keep their
        fates in arrays instead, and answer with LinkEvents.
        """
        return [event for message, receivers in outbox for event in self.send(message, receivers, now)]

    @abstractmethod
    def deliver(self, receiver: str, now: float) -> tuple[ReceivedMessage, ...]:
        """What has arrived at `receiver` by `now` [s] and was not given out yet, in order of arrival."""

    def min_message_interval(self, station: str) -> float:
        """How long congestion control lets a station wait from one message to the next [s]: T_GenCam_DCC of ETSI
        EN 302 637-2. 0 where there is no such control."""
        return 0.0

    @abstractmethod
    def in_flight(self) -> int:
        """How many messages are on their way."""

    @abstractmethod
    def statistics(self, now: float) -> Mapping[tuple[str, str], LinkStatistics]:
        """The books of every link so far, by (sender, receiver)."""

    @abstractmethod
    def continue_from(self, previous: Channel) -> None:
        """Carry on for a channel replaced during a run: what it has on its way arrives by its old fate."""
