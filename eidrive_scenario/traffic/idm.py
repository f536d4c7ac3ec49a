"""The Intelligent Driver Model: Treiber, Hennecke and Helbing, Phys. Rev. E 62 (2000) 1805, equations 2 and 3."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class IntelligentDriver:
    """Parameters of the model; the values are those of the city traffic of Treiber and Kesting (2013), table 11.2.

    time_gap          T, to the leader in equilibrium [s]
    standstill_gap    s0, bumper to bumper [m]
    acceleration      a, the largest in normal driving [m/s²]
    deceleration      b, comfortable braking [m/s²]
    exponent          δ of the approach to the desired speed
    emergency         the brakes' limit, which the model alone does not have [m/s²]
    lateral_acceleration  in curves; slows the car down ahead of them [m/s²]
    """

    time_gap: float = 1.0
    standstill_gap: float = 2.0
    acceleration: float = 1.0
    deceleration: float = 1.5
    exponent: float = 4.0
    emergency: float = 8.0
    lateral_acceleration: float = 2.0

    def response(self, speed: Array, desired_speed: Array, gap: Array, approach: Array) -> Array:
        """Accelerations (N,) [m/s²].

        speed, desired_speed  (N,) [m/s];  gap  bumper to bumper, inf without a leader (N,) [m]
        approach  own speed less the leader's (N,) [m/s]
        """
        braking = speed * approach / (2.0 * np.sqrt(self.acceleration * self.deceleration))
        wanted = self.standstill_gap + np.maximum(0.0, speed * self.time_gap + braking)
        free = (speed / np.maximum(desired_speed, 1e-3)) ** self.exponent
        found = self.acceleration * (1.0 - free - (wanted / np.maximum(gap, 1e-3)) ** 2)
        return np.asarray(np.maximum(found, -self.emergency))

    def equilibrium_gap(self, speed: float, desired_speed: float) -> float:
        """The gap at which a string of cars keeps one speed (equation 5 of the paper) [m]."""
        free: float = 1.0 - (speed / desired_speed) ** self.exponent
        return (self.standstill_gap + speed * self.time_gap) / float(np.sqrt(free))


def ballistic(speed: Array, acceleration: Array, dt: float) -> tuple[Array, Array]:
    """Distance covered in dt and the speed after it; a car that brakes stands still and does not back up.

    The second-order step of Treiber and Kanagaraj, Physica A 419 (2015) 183.
    """
    after = speed + acceleration * dt
    stops = after < 0.0
    braking = np.where(stops, acceleration, -1.0)
    covered = np.where(stops, -speed * speed / (2.0 * braking), speed * dt + 0.5 * acceleration * dt * dt)
    return covered, np.maximum(after, 0.0)
