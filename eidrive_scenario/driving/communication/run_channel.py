"""Channel between the stations of a run, which the scenario can replace."""

from __future__ import annotations

import math
import os
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from eidrive_scenario.errors import InvalidResult, SettingError
from eidrive_scenario.openscenario.values.parameters import Scope
from eidrive_scenario.v2x.channel import Channel, OutgoingMessage, QueuedChannel
from eidrive_scenario.v2x.messages.message import LinkEvent, ReceivedMessage
from eidrive_scenario.v2x.profile import NO_COOPERATION, ChannelProfile, build_channel, load_profile
from eidrive_scenario.v2x.radio_environment import RadioEnvironment
from eidrive_scenario.v2x.statistics.link_events import LinkEvents
from eidrive_scenario.v2x.statistics.link_statistics import LinkStatistics, message_counts, with_expired


class RunChannel:
    """Channel of a run, whose results are checked.

    active   channel in use; None without cooperation
    name     of its profile
    profile  settings of it; None without cooperation
    """

    def __init__(self, seed: int) -> None:
        self.active: Channel | None = None
        self.name = NO_COOPERATION
        self.profile: ChannelProfile | None = None
        self._seed = seed
        self._last: Channel | None = None
        """The last channel. After cooperation is switched off it delivers the messages in flight, and its statistics
        remain part of the result."""
        self._statistics: tuple[float, Mapping[tuple[str, str], LinkStatistics]] | None = None
        """Time and value of the last statistics: those of many links are expensive."""
        self._expired: Counter[tuple[str, str]] = Counter()
        """Number of received messages that are too old for their receiver, by sender and receiver."""

    def select(
        self, source: str | os.PathLike[str] | Mapping[str, Any], *, origin: str, line: int | None, scope: Scope | None
    ) -> None:
        """Replace the channel by that of a profile, which continues the statistics.

        Raise SettingError, with origin and line, if the profile is invalid or cannot continue the channel.
        """
        profile = load_profile(source, origin=origin, line=line, scope=scope)
        try:
            self.active = build_channel(profile, self._seed, previous=self._last)
        except SettingError as error:
            raise error.at(origin, line) from error
        if self.active is None and isinstance(self._last, QueuedChannel):
            self._last.finalize()  # with the places of the stations at the end of cooperation
        self._last = self.active or self._last
        self._statistics = None
        self.profile = profile
        self.name = profile.name if profile is not None else NO_COOPERATION

    @property
    def has_links(self) -> bool:
        """Whether there was a channel, whose messages in flight are lost if their receiver leaves."""
        return self._last is not None

    @property
    def own_perception(self) -> bool:
        """Whether the channel carries the detections of a station back to itself."""
        return self.active is not None and self.active.own_perception

    def update_environment(self, environment: RadioEnvironment) -> None:
        """Set antenna positions and obstacles of this tick."""
        if self._last is not None:
            self._statistics = None
            self._last.update_environment(environment)

    def min_message_interval(self, sender: str) -> float:
        """Return the minimum time between two messages of a station under congestion control [s]."""
        if self.active is None:
            return 0.0
        interval: object = self.active.min_message_interval(sender)
        if not isinstance(interval, _NUMBER) or not 0.0 <= interval < math.inf:
            raise _invalid(self.active, "min_message_interval", interval, "a finite number of at least 0 s")
        return float(interval)

    def deliver(self, receiver: str, now: float) -> Sequence[ReceivedMessage]:
        """Return the messages that a station has received since the last call."""
        if self._last is None:
            return ()
        delivered: Any = self._last.deliver(receiver, now)
        if not isinstance(delivered, tuple | list):
            raise _invalid(self._last, "deliver", delivered, "a tuple of ReceivedMessage")
        for received in delivered:
            if not isinstance(received, ReceivedMessage):
                raise _invalid(self._last, "deliver", received, "a ReceivedMessage")
            arrived: Any = received.arrived
            if not isinstance(arrived, _NUMBER) or not -math.inf < arrived <= now + 1e-6:
                text = f"returned a message that arrived at {arrived!r} (expected a time up to {now:g} s)"
                raise InvalidResult(self._last, "deliver", text)
        return delivered

    def count_expired(self, sender: str, receiver: str) -> None:
        """Count a received message that its receiver does not use because it is too old."""
        self._expired[sender, receiver] += 1

    def transmit(self, outbox: Sequence[OutgoingMessage], now: float) -> Sequence[LinkEvent]:
        """Transmit messages to their receivers; return the outcomes that are known."""
        if self.active is None:
            return self.final_links()
        self._statistics = None
        return _checked_events(self.active, self.active.transmit(outbox, now))

    def final_links(self) -> Sequence[LinkEvent]:
        """Return the outcomes that no `transmit` has returned."""
        return () if self._last is None else _checked_events(self._last, self._last.drain_events())

    def metrics(self, now: float) -> dict[str, float]:
        """Return the counts of messages over all links; nothing if there was never a channel."""
        return {} if self._last is None else message_counts(self.link_statistics(now).values())

    def link_statistics(self, now: float) -> Mapping[tuple[str, str], LinkStatistics]:
        """Return the statistics by sender and receiver."""
        if self._last is None:
            return {}
        if self._statistics is None or self._statistics[0] != now:
            statistics: object = self._last.statistics(now)
            if not isinstance(statistics, Mapping):
                raise _invalid(self._last, "statistics", statistics, "a mapping by sender and receiver")
            self._statistics = now, with_expired(statistics, self._expired)
        return self._statistics[1]


_NUMBER = int | float | np.integer | np.floating


def _invalid(channel: Channel, method: str, result: object, expected: str) -> InvalidResult:
    return InvalidResult(channel, method, f"returned {result!r} (expected {expected})")


def _checked_events(channel: Channel, events: Any) -> Sequence[LinkEvent]:
    if isinstance(events, LinkEvents):
        return events
    if not isinstance(events, Sequence) or not all(isinstance(event, LinkEvent) for event in events):
        raise _invalid(channel, "transmit", events, "a sequence of LinkEvents")
    return tuple(events)
