"""The truth at one instant, frozen, as a struct of arrays."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from eidrive_scenario.arrays import Array
from eidrive_scenario.records import fast_frozen

FEW = 16
"""Up to this many actors, plain numbers are faster than arrays."""


@dataclass(frozen=True)
class Contact:
    """Two boxes began to touch during the step that led to this view."""

    first: str
    second: str
    position: tuple[float, float, float]
    """Point of touch in the world frame [m]."""
    impact_speed: float
    """Speed of one relative to the other at the first touch [m/s]."""


class ActorState(NamedTuple):
    """One row of a view in plain numbers, named and measured as its arrays."""

    x: float
    y: float
    z: float
    yaw: float
    pitch: float
    roll: float
    velocity_x: float
    velocity_y: float
    velocity_z: float
    acceleration_x: float
    acceleration_y: float
    acceleration_z: float
    yaw_rate: float
    speed: float


@fast_frozen
@dataclass(frozen=True)
class WorldView:
    """All actors at time `time` [s]; one row per actor, in the order in which they entered the world.

    position      (N, 3) of the reference point (OpenSCENARIO: rear axle center on the ground for vehicles) [m]
    yaw pitch roll  (N,) [rad]; right-handed, x forward, y left, z up; pitch positive nose down (z-y'-x'' rotation)
    velocity      (N, 3) of the reference point, world frame [m/s]
    acceleration  (N, 3) world frame [m/s²]
    yaw_rate      (N,) [rad/s]
    speed         (N,) along the heading, negative backwards [m/s]
    size          (N, 3) length, width, height of the bounding box [m]
    offset        (N, 3) box center in the actor's frame [m]
    contacts      touches that began during the step that led here
    unseen        actors that sensors do not see, as the scenario says
    unseen_by     the same for the sensors of these names, of whom it says something else
    """

    time: float
    tick: int
    names: tuple[str, ...]
    categories: tuple[str, ...]
    position: Array
    yaw: Array
    pitch: Array
    roll: Array
    velocity: Array
    acceleration: Array
    yaw_rate: Array
    speed: Array
    size: Array
    offset: Array
    contacts: tuple[Contact, ...] = ()
    unseen: tuple[str, ...] = ()
    unseen_by: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    def hidden_from(self, sensor: str) -> tuple[str, ...]:
        """Return the actors that the sensor of this name does not see, as the scenario says."""
        return self.unseen_by.get(sensor, self.unseen)

    @cached_property
    def rows(self) -> Mapping[str, int]:
        """Name to row."""
        return {name: row for row, name in enumerate(self.names)}

    @cached_property
    def kinematics(self) -> Array:
        """(N, 9) position, yaw, pitch, roll and velocity."""
        angles = np.stack([self.yaw, self.pitch, self.roll], axis=1)
        return np.concatenate([self.position, angles, self.velocity], axis=1)

    @cached_property
    def states(self) -> Sequence[ActorState]:
        """Of each row how the actor stands and moves: for looks at single actors, at which arrays are slow."""
        motion = [self.kinematics, self.acceleration, self.yaw_rate[:, None], self.speed[:, None]]
        return [ActorState(*row) for row in np.concatenate(motion, axis=1).tolist()]

    def without(self, names: Collection[str]) -> WorldView:
        """Return the same instant without some actors."""
        kept = [row for row, name in enumerate(self.names) if name not in names]
        if len(kept) == len(self.names):
            return self
        arrays: dict[str, Any] = {
            entry.name: value[kept]
            for entry in fields(self)
            if isinstance(value := getattr(self, entry.name), np.ndarray)
        }
        return replace(
            self,
            names=tuple(self.names[row] for row in kept),
            categories=tuple(self.categories[row] for row in kept),
            **arrays,
        )

    def __contains__(self, name: object) -> bool:
        return name in self.rows

    def row(self, name: str) -> int:
        """Return the row of an actor. Raise KeyError, naming the actor, if it is not in the world."""
        try:
            return self.rows[name]
        except KeyError:
            raise KeyError(f"actor {name!r} is not in the world at {self.time:.2f} s") from None

    @property
    def centers(self) -> Array:
        """(N, 3) centers of the bounding boxes in the world frame [m]; pitch and roll neglected."""
        return self.boxes[:, :3]

    @cached_property
    def plain_boxes(self) -> Sequence[Sequence[float]]:
        """The rows of `boxes` in plain numbers: for looks at single actors, at which arrays are slow."""
        if len(self.names) <= FEW:
            bodies = zip(self.states, self.offset.tolist(), self.size.tolist(), strict=True)
            return [_box(*body) for body in bodies]
        rows: list[list[float]] = self.boxes.tolist()
        return rows

    @cached_property
    def boxes(self) -> Array:
        """(N, 7) x y z l w h yaw of the bounding boxes, center in the world frame [m, rad]."""
        if 0 < len(self.names) <= FEW:
            return np.array(self.plain_boxes)
        cos, sin = np.cos(self.yaw), np.sin(self.yaw)
        x, y, z = self.offset.T
        centers = self.position + np.stack([cos * x - sin * y, sin * x + cos * y, z], axis=1)
        return np.concatenate([centers, self.size, self.yaw[:, None]], axis=1)


def _box(state: ActorState, offset: list[float], size: list[float]) -> tuple[float, ...]:
    x, y, z, yaw, *_ = state
    cos, sin = math.cos(yaw), math.sin(yaw)
    ahead, aside, up = offset
    return (x + cos * ahead - sin * aside, y + sin * ahead + cos * aside, z + up, *size, yaw)
