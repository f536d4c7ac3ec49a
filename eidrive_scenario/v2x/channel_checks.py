"""Checks of the results of third-party channels; built-in channels are not checked."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from eidrive_scenario.errors import InvalidResult
from eidrive_scenario.v2x.channel import Channel
from eidrive_scenario.v2x.messages.message import LinkEvent, ReceivedMessage
from eidrive_scenario.v2x.statistics.link_events import LinkEvents

_NUMBER = int | float | np.integer | np.floating


def check_interval(channel: Channel, interval: Any) -> None:
    """Raise InvalidResult unless the interval between messages is a finite number of at least 0 s."""
    if not isinstance(interval, _NUMBER) or not 0.0 <= interval < math.inf:
        diagnostic = f"returned {interval!r} (expected a finite number of at least 0 s)"
        raise InvalidResult(channel, "min_message_interval", diagnostic)


def check_delivered(channel: Channel, delivered: Any, now: float) -> None:
    """Raise InvalidResult unless `deliver` returns messages that have arrived by `now` [s]."""
    if not isinstance(delivered, tuple | list):
        raise InvalidResult(channel, "deliver", f"returned {delivered!r} (expected a tuple of ReceivedMessage)")
    for received in delivered:
        if not isinstance(received, ReceivedMessage):
            raise InvalidResult(channel, "deliver", f"returned {received!r} (expected a ReceivedMessage)")
        arrived: Any = received.arrived
        if not isinstance(arrived, _NUMBER) or not -math.inf < arrived <= now + 1e-6:
            text = f"returned a message that arrived at {arrived!r} (expected a time up to {now:g} s)"
            raise InvalidResult(channel, "deliver", text)


def check_events(channel: Channel, events: Any) -> None:
    """Raise InvalidResult unless `transmit` returns link events."""
    if isinstance(events, LinkEvents):
        return
    if not isinstance(events, Sequence) or not all(isinstance(event, LinkEvent) for event in events):
        raise InvalidResult(channel, "transmit", f"returned {events!r} (expected a sequence of LinkEvents)")


def check_statistics(channel: Channel, statistics: Any) -> None:
    """Raise InvalidResult unless the link statistics are a mapping."""
    if not isinstance(statistics, Mapping):
        raise InvalidResult(
            channel, "statistics", f"returned {statistics!r} (expected a mapping by sender and receiver)"
        )
