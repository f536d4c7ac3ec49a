"""Transition of a value from its start to its target in the four shapes of TransitionDynamics."""

from __future__ import annotations

import math

from eidrive_scenario.base.tolerances import EPSILON
from eidrive_scenario.openscenario.model import DynamicsShape

PEAK_SLOPE = {
    DynamicsShape.STEP: 0.0,
    DynamicsShape.LINEAR: 1.0,
    DynamicsShape.CUBIC: 1.5,
    DynamicsShape.SINUSOIDAL: math.pi / 2.0,
}
"""Maximum slope of each shape on the unit square: of u, 3u² - 2u³ and (1 - cos πu)/2."""

PEAK_SECOND_DERIVATIVE = {
    DynamicsShape.STEP: 0.0,
    DynamicsShape.LINEAR: 6.0,
    DynamicsShape.CUBIC: 6.0,
    DynamicsShape.SINUSOIDAL: math.pi**2 / 2.0,
}
"""Maximum second derivative on the unit square; linear has none, and uses that of cubic."""

LEAST_RATE = 1e-12
"""Rate in place of 0, with which an actor that stands keeps standing."""


class TransitionProfile:
    """Value between `start` and `target` as a function of a parameter from 0 to `extent` (time [s] or distance [m])."""

    def __init__(self, shape: DynamicsShape, start: float, target: float, extent: float) -> None:
        self.shape = shape
        self.start = start
        self.target = target
        self.extent = 0.0 if shape is DynamicsShape.STEP else max(0.0, extent)
        self.progress = 0.0

    @classmethod
    def from_rate(cls, shape: DynamicsShape, start: float, target: float, rate: float) -> TransitionProfile:
        """Return the transition with maximum slope `rate`, whose sign is ignored; with rate 0 it never ends."""
        return cls(shape, start, target, PEAK_SLOPE[shape] * abs(target - start) / max(abs(rate), LEAST_RATE))

    @classmethod
    def from_second_derivative(
        cls, shape: DynamicsShape, start: float, target: float, limit: float
    ) -> TransitionProfile:
        """Return the transition with maximum second derivative `limit`."""
        return cls(
            shape, start, target, math.sqrt(PEAK_SECOND_DERIVATIVE[shape] * abs(target - start) / max(limit, EPSILON))
        )

    def limit_rate(self, limit: float) -> None:
        """Extend the transition so that its slope does not exceed `limit`; a step remains a step."""
        if self.shape is not DynamicsShape.STEP and self.extent > 0.0:
            self.extent = max(self.extent, PEAK_SLOPE[self.shape] * abs(self.target - self.start) / max(limit, EPSILON))

    def advance(self, step: float) -> float:
        """Increase the parameter by `step`; return the value."""
        self.progress = min(self.extent, self.progress + step)
        return self.value

    @property
    def done(self) -> bool:
        """Whether the parameter has reached `extent`."""
        return self.progress >= self.extent - EPSILON

    @property
    def value(self) -> float:
        """Value at the current parameter."""
        if self.done:
            return self.target
        u = self.progress / self.extent
        if self.shape is DynamicsShape.CUBIC:
            u = u * u * (3.0 - 2.0 * u)
        elif self.shape is DynamicsShape.SINUSOIDAL:
            u = 0.5 * (1.0 - math.cos(math.pi * u))
        return self.start + (self.target - self.start) * u

    @property
    def slope(self) -> float:
        """Derivative of the value by the parameter; 0 before the first step and at the end."""
        if self.done or self.progress <= 0.0:
            return 0.0
        u = self.progress / self.extent
        unit_slope = 1.0
        if self.shape is DynamicsShape.CUBIC:
            unit_slope = 6.0 * u * (1.0 - u)
        elif self.shape is DynamicsShape.SINUSOIDAL:
            unit_slope = 0.5 * math.pi * math.sin(math.pi * u)
        return (self.target - self.start) * unit_slope / self.extent
