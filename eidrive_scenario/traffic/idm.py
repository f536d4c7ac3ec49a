"""The Intelligent Driver Model: Treiber, Hennecke and Helbing, Phys. Rev. E 62 (2000) 1805, equations 2 and 3."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.arrays import Array

ABOVE_DESIRED = 2.0
"""A car that is only too fast brakes no harder than so many times its comfortable deceleration, whereas the model's own
term grows without a bound (Treiber and Kesting, 2013, chapter 11, on the improved acceleration function)."""


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
        return Drivers.of([self]).response(speed, desired_speed, gap, approach)

    def equilibrium_gap(self, speed: float, desired_speed: float) -> float:
        """Return the gap at which a string of cars keeps one speed (equation 5 of the paper) [m]."""
        free: float = 1.0 - (speed / desired_speed) ** self.exponent
        return (self.standstill_gap + speed * self.time_gap) / float(np.sqrt(free))


COLUMNS = tuple(entry.name for entry in fields(IntelligentDriver))


@dataclass(frozen=True)
class Drivers:
    """The parameters of many drivers: one row for each, one column for each field of IntelligentDriver."""

    table: Array

    @classmethod
    def of(cls, drivers: list[IntelligentDriver]) -> Drivers:
        """Drivers as a table."""
        rows = [[getattr(driver, name) for name in COLUMNS] for driver in drivers]
        return cls(np.array(rows, dtype=np.float64).reshape(-1, len(COLUMNS)))

    def of_rows(self, rows: NDArray[np.int64]) -> Drivers:
        """Some of them."""
        return Drivers(self.table[rows])

    def response(self, speed: Array, desired_speed: Array, gap: Array, approach: Array) -> Array:
        """As `IntelligentDriver.response`, each driver by its own parameters."""
        time_gap, standstill_gap, acceleration, deceleration, exponent, emergency, _ = self.table.T
        braking = speed * approach / (2.0 * np.sqrt(acceleration * deceleration))
        wanted = standstill_gap + np.maximum(0.0, speed * time_gap + braking)
        free = acceleration * (1.0 - (speed / np.maximum(desired_speed, 1e-3)) ** exponent)
        free = np.maximum(free, -ABOVE_DESIRED * deceleration)
        found = free - acceleration * (wanted / np.maximum(gap, 1e-3)) ** 2
        return np.asarray(np.maximum(found, -emergency))

    @property
    def standstill_gap(self) -> Array:
        """s0 of each [m]."""
        return self.table[:, 1]

    @property
    def deceleration(self) -> Array:
        """b of each [m/s²]."""
        return self.table[:, 3]

    @property
    def lateral_acceleration(self) -> Array:
        """In curves, of each [m/s²]."""
        return self.table[:, 6]


def ballistic(speed: Array, acceleration: Array, dt: float) -> tuple[Array, Array]:
    """Return distance covered in dt and the speed after it; a car that brakes stands still and does not back up.

    The second-order step of Treiber and Kanagaraj, Physica A 419 (2015) 183.
    """
    after = speed + acceleration * dt
    stops = after < 0.0
    braking = np.where(stops, acceleration, -1.0)
    covered = np.where(stops, -speed * speed / (2.0 * braking), speed * dt + 0.5 * acceleration * dt * dt)
    return covered, np.maximum(after, 0.0)
