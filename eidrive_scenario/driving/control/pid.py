"""PID controller."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Gains:
    """Gains of the error, its integral [1/s] and its derivative [s]."""

    proportional: float
    integral: float = 0.0
    derivative: float = 0.0


class PID:
    """PID controller: output = kp·e + ki·∫e dt + kd·de/dt, within limits.

    Anti-windup by conditional integration: the integral is constant while the output is at a limit that the error
    exceeds further, and while the error is larger than `band`.
    """

    def __init__(self, gains: Gains, *, low: float, high: float, dt: float, band: float = math.inf) -> None:
        self.gains = gains
        self.low = low
        self.high = high
        self.dt = dt
        self.band = band
        self._integral = 0.0
        self._last: float | None = None

    def reset(self) -> None:
        """Reset integral and derivative."""
        self._integral = 0.0
        self._last = None

    def update(self, error: float, feed_forward: float = 0.0) -> float:
        """Return the output for the error of this tick plus a feed-forward part."""
        gains = self.gains
        slope = 0.0 if self._last is None else (error - self._last) / self.dt
        self._last = error
        fixed = feed_forward + gains.proportional * error + gains.derivative * slope
        integral = self._integral + error * self.dt
        output = fixed + gains.integral * integral
        free = self.low < output < self.high or (output >= self.high) == (error < 0.0)
        if free and abs(error) <= self.band:
            self._integral = integral
        return min(max(fixed + gains.integral * self._integral, self.low), self.high)
