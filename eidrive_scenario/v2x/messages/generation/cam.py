"""When a station sends a cooperative awareness message: ETSI EN 302 637-2 V1.4.1, 6.1.3."""

from __future__ import annotations

import math

from eidrive_scenario.geometry import wrap_angle
from eidrive_scenario.v2x.messages.message import StationState

CHECK = 0.1
"""T_CheckCamGen: how often the triggers are looked at [s]."""
SHORTEST, LONGEST = 0.1, 1.0
"""T_GenCamMin and T_GenCamMax [s]."""
REPEATS = 3
"""N_GenCam: so many messages keep the interval of the last trigger."""
HEADING, DISTANCE, SPEED = math.radians(4.0), 4.0, 0.5
"""More than this change since the last message triggers one [rad, m, m/s]."""
LOW_FREQUENCY = 0.5
"""Least time between two low-frequency containers [s]."""

EQUAL = 1e-6
"""Differences smaller than this are none: 4.0 m are not more than 4 m, however they came about in floating point."""


class CamGenerationRules:
    """Says at each tick whether a message is due.

    A change of heading, place or speed beyond the limits triggers one, at the earliest `SHORTEST` after the last; its
    interval is then kept for `REPEATS` messages, and the longest interval after that.
    """

    def __init__(self) -> None:
        self._checked = -math.inf
        self._sent = -math.inf
        self._low_frequency = -math.inf
        self._last: StationState | None = None
        self._interval = LONGEST
        self._repeats = 0

    def is_due(self, state: StationState, now: float, shortest: float = SHORTEST) -> bool:
        """Whether to send now [s]; congestion control may ask for a longer `shortest` interval [s]."""
        if now - self._checked < CHECK - EQUAL:
            return False
        self._checked = now
        passed = now - self._sent
        if passed < shortest - EQUAL:
            return False
        if self._last is None or _changed(self._last, state):
            self._interval = min(max(passed, SHORTEST), LONGEST)
            self._repeats = 0
        elif passed >= self._interval - EQUAL:
            self._repeats += 1
            if self._repeats >= REPEATS:
                self._interval = LONGEST
        else:
            return False
        self._sent, self._last = now, state
        return True

    def low_frequency(self, now: float) -> bool:
        """Whether the message that is sent now carries the low-frequency container."""
        if now - self._low_frequency < LOW_FREQUENCY - EQUAL:
            return False
        self._low_frequency = now
        return True


def _changed(last: StationState, state: StationState) -> bool:
    return (
        abs(wrap_angle(state.yaw - last.yaw)) > HEADING + EQUAL
        or math.hypot(state.x - last.x, state.y - last.y) > DISTANCE + EQUAL
        or abs(state.speed - last.speed) > SPEED + EQUAL
    )
