"""Messages of a run between their transmission and their outcome."""

from __future__ import annotations

import math
from collections.abc import Iterable

from eidrive_scenario.v2x.messages.message import LinkEvent

MOST = 40_000
"""Maximum number of messages in a page."""
Row = list[float | str | None]


class MessageList:
    """Messages in the order of their outcomes: [sent, sender, receiver, arrives or None if it is lost, reason].

    Times are in s. The reason is that of a loss. Messages of a station to itself are omitted. `omitted` is the number
    of messages after the first MOST, `count` that of the others.
    """

    def __init__(self) -> None:
        self._rows: list[Row] = []
        self.count = 0
        self.omitted = 0

    def observe(self, events: Iterable[LinkEvent]) -> None:
        """Add the outcomes of one frame."""
        for event in events:
            if event.sender == event.receiver or not math.isfinite(event.sent):
                continue
            if self.count >= MOST:
                self.omitted += 1
                continue
            delivered = event.outcome == "delivered" and event.arrives is not None and math.isfinite(event.arrives)
            arrives = round(event.arrives, 3) if delivered and event.arrives is not None else None
            self._rows.append(
                [round(event.sent, 3), event.sender, event.receiver, arrives, "" if delivered else event.reason]
            )
            self.count += 1

    def take(self) -> list[Row]:
        """Return the messages since the last call."""
        rows, self._rows = self._rows, []
        return rows
