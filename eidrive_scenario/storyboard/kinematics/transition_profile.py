"""How a value goes from its start to its target: the four shapes of TransitionDynamics."""

from __future__ import annotations

import math

from eidrive_scenario.openscenario.model import DynamicsShape
from eidrive_scenario.tolerances import EPSILON

PEAK = {
    DynamicsShape.STEP: 0.0,
    DynamicsShape.LINEAR: 1.0,
    DynamicsShape.CUBIC: 1.5,
    DynamicsShape.SINUSOIDAL: math.pi / 2.0,
}
"""Steepest slope of each shape on the unit square: of u, 3u² - 2u³ and (1 - cos πu)/2."""

BEND = {
    DynamicsShape.STEP: 0.0,
    DynamicsShape.LINEAR: 6.0,
    DynamicsShape.CUBIC: 6.0,
    DynamicsShape.SINUSOIDAL: math.pi**2 / 2.0,
}
"""Largest second derivative on the unit square; a straight line has none, so it is given the cubic's."""


class TransitionProfile:
    """A value on its way from `start` to `target` while a parameter (time [s] or distance [m]) runs up to `extent`."""

    def __init__(self, shape: DynamicsShape, start: float, target: float, extent: float) -> None:
        self.shape = shape
        self.start = start
        self.target = target
        self.extent = 0.0 if shape is DynamicsShape.STEP else max(0.0, extent)
        self.progress = 0.0

    @classmethod
    def from_rate(cls, shape: DynamicsShape, start: float, target: float, rate: float) -> TransitionProfile:
        """The transition whose steepest slope is `rate` (its sign does not matter)."""
        return cls(shape, start, target, PEAK[shape] * abs(target - start) / max(abs(rate), EPSILON))

    @classmethod
    def from_second_derivative(
        cls, shape: DynamicsShape, start: float, target: float, limit: float
    ) -> TransitionProfile:
        """The transition whose second derivative stays within `limit`."""
        return cls(shape, start, target, math.sqrt(BEND[shape] * abs(target - start) / max(limit, EPSILON)))

    def limit_rate(self, limit: float) -> None:
        """Stretch the transition so that its steepest slope stays within `limit`; a step stays a step."""
        if self.shape is not DynamicsShape.STEP and self.extent > 0.0:
            self.extent = max(self.extent, PEAK[self.shape] * abs(self.target - self.start) / max(limit, EPSILON))

    def advance(self, step: float) -> float:
        """Let the parameter run by `step`; the value there."""
        self.progress = min(self.extent, self.progress + step)
        return self.value

    @property
    def done(self) -> bool:
        """True where the parameter has come to its end."""
        return self.progress >= self.extent - EPSILON

    @property
    def value(self) -> float:
        """The value where the parameter stands."""
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
        """How fast the value changes with the parameter where that stands; 0 before the first step and at the end."""
        if self.done or self.progress <= 0.0:
            return 0.0
        u = self.progress / self.extent
        steep = 1.0
        if self.shape is DynamicsShape.CUBIC:
            steep = 6.0 * u * (1.0 - u)
        elif self.shape is DynamicsShape.SINUSOIDAL:
            steep = 0.5 * math.pi * math.sin(math.pi * u)
        return (self.target - self.start) * steep / self.extent
