"""The Intelligent Driver Model: Treiber, Hennecke and Helbing, Phys. Rev. E 62 (2000) 1805, equations 2 and 3."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Array

ABOVE_DESIRED = 2.0
"""Maximum braking above the desired speed in units of the comfortable deceleration.

The term of the model grows without a bound (Treiber and Kesting, 2013, chapter 11, on the improved acceleration
function).
"""


@dataclass(frozen=True)
class IntelligentDriver:
    """Parameters of the model; the defaults are for city traffic by Treiber and Kesting (2013), table 11.2.

    time_gap              T, time gap to the leader in equilibrium [s]
    standstill_gap        s0, gap between bumpers at standstill [m]
    acceleration          a, maximum acceleration in normal driving [m/s²]
    deceleration          b, comfortable deceleration [m/s²]
    exponent              δ, exponent of the approach to the desired speed
    emergency             maximum deceleration of the brakes, which the model does not limit [m/s²]
    lateral_acceleration  maximum lateral acceleration in curves, ahead of which the car slows down [m/s²]
    """

    time_gap: float = 1.0
    standstill_gap: float = 2.0
    acceleration: float = 1.0
    deceleration: float = 1.5
    exponent: float = 4.0
    emergency: float = 8.0
    lateral_acceleration: float = 2.0


COLUMNS = tuple(entry.name for entry in fields(IntelligentDriver))


@dataclass(frozen=True)
class Drivers:
    """Parameters of many drivers: one row per driver, one column per field of IntelligentDriver."""

    table: Array

    @classmethod
    def of(cls, drivers: list[IntelligentDriver]) -> Drivers:
        """Return drivers as a table."""
        rows = [[getattr(driver, name) for name in COLUMNS] for driver in drivers]
        return cls(np.array(rows, dtype=np.float64).reshape(-1, len(COLUMNS)))

    def of_rows(self, rows: NDArray[np.int64]) -> Drivers:
        """Return some of the drivers."""
        return Drivers(self.table[rows])

    def response(self, speed: Array, desired_speed: Array, gap: Array, approach: Array) -> Array:
        """Return the accelerations (N,) behind the leaders [m/s²], limited by the brakes."""
        acceleration = self.free(speed, desired_speed) - self.interaction(speed, gap, approach)
        return np.asarray(np.maximum(acceleration, -self.table[:, 5]))

    def free(self, speed: Array, desired_speed: Array) -> Array:
        """Return the accelerations (N,) on a free road [m/s²]."""
        _, _, acceleration, deceleration, exponent, _, _ = self.table.T
        free = acceleration * (1.0 - (speed / np.maximum(desired_speed, 1e-3)) ** exponent)
        return np.asarray(np.maximum(free, -ABOVE_DESIRED * deceleration))

    def interaction(self, speed: Array, gap: Array, approach: Array) -> Array:
        """Return the decelerations (N,) due to the leaders, without the limit of the brakes [m/s²]."""
        time_gap, standstill_gap, acceleration, deceleration, _, _, _ = self.table.T
        braking = speed * approach / (2.0 * np.sqrt(acceleration * deceleration))
        desired_gap = standstill_gap + np.maximum(0.0, speed * time_gap + braking)
        return np.asarray(acceleration * (desired_gap / np.maximum(gap, 1e-3)) ** 2)

    @property
    def standstill_gap(self) -> Array:
        """s0 of each driver [m]."""
        return self.table[:, 1]

    @property
    def deceleration(self) -> Array:
        """b of each driver [m/s²]."""
        return self.table[:, 3]

    @property
    def lateral_acceleration(self) -> Array:
        """Maximum lateral acceleration of each driver in curves [m/s²]."""
        return self.table[:, 6]


def ballistic(speed: Array, acceleration: Array, dt: float) -> tuple[Array, Array]:
    """Return the distance covered in dt and the speed after it. A braking car stops and does not move backwards.

    Second-order step of Treiber and Kanagaraj, Physica A 419 (2015) 183.
    """
    after = speed + acceleration * dt
    stops = after < 0.0
    braking = np.where(stops, acceleration, -1.0)
    covered = np.where(stops, -speed * speed / (2.0 * braking), speed * dt + 0.5 * acceleration * dt * dt)
    return covered, np.maximum(after, 0.0)
