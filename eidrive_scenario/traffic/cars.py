"""State of all cars of a fleet: one row per car, in the order of addition."""

from __future__ import annotations

from dataclasses import dataclass, field, fields

import numpy as np

from eidrive_scenario.base.arrays import Array, Bools, Integers
from eidrive_scenario.base.car_following import Drivers, IntelligentDriver
from eidrive_scenario.world.actor import ActorSpec

PLANNED = 12
"""Maximum number of planned lanes beyond the current one."""
VAN_FRONT = 4.7
"""Distance of the front of a van from its rear axle, which follows the lane [m]. Longer vehicles swing out farther."""


def _floats() -> Array:
    return np.empty(0)


def _integers() -> Integers:
    return np.empty(0, dtype=np.int64)


@dataclass
class Cars:
    """Columns (N,) and (N, PLANNED + 1) of one length.

    progress, speed, acceleration  along the lane [m], [m/s], [m/s²]
    front, rear   distances from the reference point to the bumpers [m]
    own_speed     desired speed, NaN for the limit [m/s]
    factor        share of the speed limit that is the desired speed
    top_speed     maximum speed of the vehicle [m/s]
    fallback      desired speed on lanes without a limit [m/s]
    offset        distance to the left of the lane center [m]
    slope         slope of the path against the lane, left positive
    shift         offset at the start of a lane change [m]
    shift_done, shift_length  covered and total length of the lane change [m]
    plan          lanes ahead, the current one first, -1 beyond the end
    granted       whether the car may enter each of these lanes in junctions
    asked         time since which it has requested a junction [s], NaN if it has not
    turns         number of branches selected so far
    number        running number, constant for the lifetime of the car
    walks         True for pedestrians, which use sidewalks
    ignores_lights  whether the driver ignores traffic lights
    """

    progress: Array = field(default_factory=_floats)
    speed: Array = field(default_factory=_floats)
    acceleration: Array = field(default_factory=_floats)
    front: Array = field(default_factory=_floats)
    rear: Array = field(default_factory=_floats)
    own_speed: Array = field(default_factory=_floats)
    factor: Array = field(default_factory=_floats)
    top_speed: Array = field(default_factory=_floats)
    fallback: Array = field(default_factory=_floats)
    offset: Array = field(default_factory=_floats)
    slope: Array = field(default_factory=_floats)
    shift: Array = field(default_factory=_floats)
    shift_done: Array = field(default_factory=_floats)
    shift_length: Array = field(default_factory=_floats)
    asked: Array = field(default_factory=_floats)
    turns: Integers = field(default_factory=_integers)
    number: Integers = field(default_factory=_integers)
    walks: Bools = field(default_factory=lambda: np.empty(0, dtype=bool))
    ignores_lights: Bools = field(default_factory=lambda: np.empty(0, dtype=bool))
    plan: Integers = field(default_factory=lambda: np.empty((0, PLANNED + 1), dtype=np.int64))
    granted: Bools = field(default_factory=lambda: np.empty((0, PLANNED + 1), dtype=bool))
    drivers: Drivers = field(default_factory=lambda: Drivers.of([]))
    specs: list[ActorSpec] = field(default_factory=list)

    def append(self, spec: ActorSpec, driver: IntelligentDriver, **values: float | bool) -> int:
        """Append a row and return its index. Values that are not given are 0, False or no lane."""
        for entry in fields(self):
            column = getattr(self, entry.name)
            if isinstance(column, np.ndarray):
                empty = -1 if entry.name == "plan" else 0
                fresh = np.full((1, *column.shape[1:]), values.get(entry.name, empty), dtype=column.dtype)
                setattr(self, entry.name, np.concatenate([column, fresh]))
        self.drivers = Drivers(np.concatenate([self.drivers.table, Drivers.of([driver]).table]))
        self.specs.append(spec)
        return len(self.specs) - 1

    def delete(self, index: int) -> None:
        """Delete a row."""
        for entry in fields(self):
            column = getattr(self, entry.name)
            if isinstance(column, np.ndarray):
                setattr(self, entry.name, np.delete(column, index, axis=0))
        self.drivers = Drivers(np.delete(self.drivers.table, index, axis=0))
        del self.specs[index]

    def __len__(self) -> int:
        return len(self.specs)

    @property
    def lane(self) -> Integers:
        """Lanes of the cars (N,)."""
        return self.plan[:, 0]

    @property
    def changing(self) -> Bools:
        """Whether each car is changing lanes (N,)."""
        return np.asarray(self.shift != 0.0)
