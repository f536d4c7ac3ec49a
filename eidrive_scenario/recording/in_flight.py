"""Messages in flight to a station when it leaves, which are lost after their outcome was `delivered`."""

from __future__ import annotations

import math

from eidrive_scenario.base.tolerances import TIME_TOLERANCE
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.v2x.messages.message import LinkEvent


class MessagesInFlight:
    """Messages that have not arrived."""

    def __init__(self) -> None:
        self._events: list[LinkEvent] = []
        self._time = -math.inf

    def observe(self, frame: Frame) -> list[LinkEvent]:
        """Add a frame; return the events of the messages to stations that have left since the last one."""
        before = self._time
        # As in Links.deliver: a message is delivered after its arrival and after the instant of its sending
        undelivered = [
            event
            for event in (*self._events, *frame.links)
            if event.arrives is not None
            and (event.arrives > before + TIME_TOLERANCE or event.sent > before - TIME_TOLERANCE)
        ]
        self._time = frame.view.time
        self._events = [event for event in undelivered if event.receiver in frame.view]
        return [event for event in undelivered if event.receiver not in frame.view]
