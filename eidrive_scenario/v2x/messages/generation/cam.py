"""CAM generation rules: ETSI EN 302 637-2 V1.4.1, 6.1.3."""

from __future__ import annotations

import math

from msgspec.structs import replace

from eidrive_scenario.geometry import wrap_angle
from eidrive_scenario.v2x.messages.message import StationState

CHECK = 0.1
"""T_CheckCamGen: period of evaluation [s]."""
SHORTEST, LONGEST = 0.1, 1.0
"""T_GenCamMin and T_GenCamMax [s]."""
REPEATS = 3
"""N_GenCam: number of messages that keep the interval of the last trigger."""
HEADING, DISTANCE, SPEED = math.radians(4.0), 4.0, 0.5
"""Maximum change since the last message without a trigger [rad, m, m/s]."""
LOW_FREQUENCY = 0.5
"""Minimum time between two low-frequency containers [s]."""

EQUAL = 1e-6
"""Tolerance of comparisons: 4.0 m do not exceed 4 m after floating-point rounding."""


class CamGenerationRules:
    """CAM generation rules of one station, evaluated at each tick.

    A change of heading, position or speed beyond the limits triggers a message, at the earliest `SHORTEST` after the
    last one. The next `REPEATS` messages keep its interval; later ones use the longest interval.
    """

    def __init__(self, elapsed: float | None = None) -> None:
        """Start without an earlier message, or in the steady state of the speed at the first evaluation.

        elapsed  share of the interval between two messages that has passed then, in [0, 1); None: no earlier message
        """
        self._elapsed = elapsed
        self._checked = -math.inf
        self._sent = -math.inf
        self._low_frequency = -math.inf
        self._last: StationState | None = None
        self._interval = LONGEST
        self._repeats = 0

    def is_due(self, state: StationState, now: float, shortest: float = SHORTEST) -> bool:
        """Return True if a message is due now; congestion control may require a longer `shortest` interval [s]."""
        if now - self._checked < CHECK - EQUAL:
            return False
        if self._checked == -math.inf and self._elapsed is not None:
            self._start_in_steady_state(state, now, self._elapsed)
        self._checked = now
        passed = now - self._sent
        if passed < shortest - EQUAL:
            return False
        if self._last is None or _has_changed(self._last, state):
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

    def _start_in_steady_state(self, state: StationState, now: float, elapsed: float) -> None:
        interval = DISTANCE / state.speed if state.speed * LONGEST > DISTANCE else LONGEST
        age = elapsed * max(interval, SHORTEST)
        back = state.speed * age
        x, y = state.x - back * math.cos(state.yaw), state.y - back * math.sin(state.yaw)
        self._sent, self._last = now - age, replace(state, x=x, y=y)

    def low_frequency(self, now: float) -> bool:
        """Return True if the message that is sent now carries the low-frequency container."""
        if now - self._low_frequency < LOW_FREQUENCY - EQUAL:
            return False
        self._low_frequency = now
        return True


def _has_changed(last: StationState, state: StationState) -> bool:
    return (
        abs(wrap_angle(state.yaw - last.yaw)) > HEADING + EQUAL
        or math.hypot(state.x - last.x, state.y - last.y) > DISTANCE + EQUAL
        or abs(state.speed - last.speed) > SPEED + EQUAL
    )
