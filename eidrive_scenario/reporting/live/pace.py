"""Pace of a run in relation to the wall clock."""

from __future__ import annotations

import math
import time
from numbers import Real

from eidrive_scenario.errors import Diagnostic, SettingError, quoted

_MAX_LAG = 0.25
"""Time that a slow run catches up at most [s]."""
_SLEEP = 0.5
"""Longest sleep without a return to the interpreter, which can then raise an interruption [s]."""


class Pace:
    """Delay of a run, so that `speed` simulated seconds take a second; `math.inf` is as fast as possible.

    A run that is slower than that is not delayed. Raise SettingError if the speed is not a number above 0.
    """

    def __init__(self, speed: float) -> None:
        if not _is_speed(speed):
            message = f"the speed of the live view is {quoted(speed)}"
            raise SettingError(Diagnostic(message, "give a factor above 0; infinity is as fast as possible"))
        self._speed = float(speed)
        self._start: float | None = None
        """Instant of the clock at which the simulated time was 0 [s]."""

    def delay(self, simulated: float) -> float:
        """Return the time until a simulated time is due [s], at least 0."""
        if math.isinf(self._speed):
            return 0.0
        now, due = time.monotonic(), simulated / self._speed
        if self._start is None or now - self._start - due > _MAX_LAG:
            self._start = now - due
        return max(0.0, self._start + due - now)

    def wait(self, simulated: float) -> None:
        """Sleep until a simulated time is due [s]."""
        while (left := self.delay(simulated)) > 0.0:
            time.sleep(min(left, _SLEEP))


def _is_speed(value: object) -> bool:
    # bool is a subclass of int, but True is not a factor
    return not isinstance(value, bool) and isinstance(value, Real) and float(value) > 0.0
