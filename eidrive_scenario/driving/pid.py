"""A PID regulator."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Gains:
    """Of the error, its integral [1/s] and its derivative [s]."""

    proportional: float
    integral: float = 0.0
    derivative: float = 0.0


class PID:
    """output = kp·e + ki·∫e dt + kd·de/dt, within limits; the integral stands still while the output is at one of them
    and the error would drive it further (conditional integration)."""

    def __init__(self, gains: Gains, *, low: float, high: float, dt: float) -> None:
        self.gains = gains
        self.low = low
        self.high = high
        self.dt = dt
        self._integral = 0.0
        self._last: float | None = None

    def reset(self) -> None:
        """Forget the past."""
        self._integral = 0.0
        self._last = None

    def update(self, error: float, feed_forward: float = 0.0) -> float:
        """The output for the error of this tick, on top of a known part."""
        gains = self.gains
        slope = 0.0 if self._last is None else (error - self._last) / self.dt
        self._last = error
        integral = self._integral + error * self.dt
        output = feed_forward + gains.proportional * error + gains.integral * integral + gains.derivative * slope
        if self.low < output < self.high or (output >= self.high) == (error < 0.0):
            self._integral = integral
        return min(max(output, self.low), self.high)
