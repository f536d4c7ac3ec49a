"""The state of all cars of a fleet: a row for each, in the order in which they came."""

from __future__ import annotations

from dataclasses import dataclass, field, fields

import numpy as np

from eidrive_scenario.arrays import Array, Bools, Integers
from eidrive_scenario.traffic.idm import Drivers, IntelligentDriver
from eidrive_scenario.world.actor import ActorSpec

PLANNED = 12
"""Most lanes that a car knows beyond its own."""


def _floats() -> Array:
    return np.empty(0)


def _integers() -> Integers:
    return np.empty(0, dtype=np.int64)


@dataclass
class Cars:
    """Columns (N,) and (N, PLANNED + 1), all of one length.

    progress, speed, acceleration  along the lane [m], [m/s], [m/s²]
    front, rear   from the reference point to the bumpers [m]
    own_speed     desired speed, NaN for the limit [m/s];  factor  of the limit that the car keeps to
    top_speed     what the vehicle can do [m/s]
    fallback      desired speed where the map gives no limit [m/s]
    offset        left of the lane's center [m];  slope  of the path against it, left positive
    shift         offset at the start of a lane change [m];  shift_done, shift_length  of its way [m]
    plan          rows of the lanes that the car takes, its own first, -1 beyond the end
    granted       which of them, in junctions, it may enter
    asked         since when it has been asking for a junction [s], NaN while it does not
    turns         forks that it has decided;  number  running number, the same for its whole life
    walks         True for who walks, on sidewalks
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
    plan: Integers = field(default_factory=lambda: np.empty((0, PLANNED + 1), dtype=np.int64))
    granted: Bools = field(default_factory=lambda: np.empty((0, PLANNED + 1), dtype=bool))
    drivers: Drivers = field(default_factory=lambda: Drivers.of([]))
    specs: list[ActorSpec] = field(default_factory=list)

    def append(self, spec: ActorSpec, driver: IntelligentDriver, **values: float | bool) -> int:
        """Return a new row; what is not given is 0, no, or no lane at all. Its index."""
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
        """Take a row out."""
        for entry in fields(self):
            column = getattr(self, entry.name)
            if isinstance(column, np.ndarray):
                setattr(self, entry.name, np.delete(column, index, axis=0))
        self.drivers = Drivers(np.delete(self.drivers.table, index, axis=0))
        del self.specs[index]

    def __len__(self) -> int:
        return len(self.specs)

    @property
    def row(self) -> Integers:
        """(N,) the lanes on which the cars are."""
        return self.plan[:, 0]

    @property
    def changing(self) -> Bools:
        """(N,) who is on the way from one lane to another."""
        return np.asarray(self.shift != 0.0)
