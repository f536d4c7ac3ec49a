"""Ground truth at one time as an immutable struct of arrays, and first hits of rays."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import msgspec
import numpy as np

from eidrive_scenario.base.arrays import Array, Integers

FEW = 16
"""Maximum number of actors whose boxes are computed as scalars, which is faster. Sine and cosine of arrays differ from
those of scalars in the last bit, so that another number changes traces.
"""
GROUND, NOTHING = -1, -2
"""Rows of rays that ended at the ground or another object that is no actor, and of rays without a hit."""


@dataclass(frozen=True)
class Contact:
    """Start of a contact of two boxes during the step before this view."""

    first: str
    second: str
    position: tuple[float, float, float]
    """Point of contact in the world frame [m]."""
    impact_speed: float
    """Relative speed at the first contact [m/s]."""


class ActorState(NamedTuple):
    """Row of a view as scalars, with the names and units of the arrays."""

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


class ActorColumns(NamedTuple):
    """Names and categories of the actors of a view, sizes and offsets of their boxes (N, 3) [m], and row by name."""

    names: tuple[str, ...]
    categories: tuple[str, ...]
    size: Array
    offset: Array
    rows: Mapping[str, int]


class RayHits(msgspec.Struct, frozen=True):
    """First hits of rays.

    rows      (M,) row of the actor in the view; GROUND (-1) for the ground and buildings, NOTHING (-2)
    fraction  (M,) share of the distance from origin to target, 1 without a hit
    position  (M, 3) of the hit [m], the target without a hit
    normal    (M, 3) of the surface, zero without a hit
    """

    rows: Integers
    fraction: Array
    position: Array
    normal: Array


class WorldView(msgspec.Struct, frozen=True, dict=True):
    """All actors at time `time` [s]; one row per actor in the order of addition.

    position      (N, 3) of the reference point (OpenSCENARIO: rear axle center on the ground for vehicles) [m]
    yaw pitch roll  (N,) [rad]; right-handed, x forward, y left, z up; pitch positive nose down (z-y'-x'' rotation)
    velocity      (N, 3) of the reference point, world frame [m/s]
    acceleration  (N, 3) world frame [m/s²]
    yaw_rate      (N,) [rad/s]
    speed         (N,) along the heading, negative backwards [m/s]
    size          (N, 3) length, width, height of the bounding box [m]
    offset        (N, 3) box center in the frame of the actor [m]
    contacts      contacts that started during the step before
    unseen        actors that the scenario hides from sensors
    unseen_by     hidden actors for sensors, by name, with separate values
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
    unseen_by: Mapping[str, tuple[str, ...]] = msgspec.field(default_factory=dict)

    @classmethod
    def of_states(
        cls,
        time: float,
        tick: int,
        actors: ActorColumns,
        states: Sequence[ActorState],
        table: Array,
        contacts: tuple[Contact, ...],
        hidden: tuple[tuple[str, ...], Mapping[str, tuple[str, ...]]],
    ) -> WorldView:
        """Return the view of actors in these states. What the caller has already is not computed from the arrays.

        actors  what is constant while no actor enters or leaves
        table   (N, 14) the states
        hidden  `unseen` and `unseen_by`
        """
        names, categories, size, offset, rows = actors
        yaw, pitch, roll = table[:, 3:6].T
        position, velocity, acceleration, yaw_rate = table[:, 0:3], table[:, 6:9], table[:, 9:12], table[:, 12]
        motion = position, yaw, pitch, roll, velocity, acceleration, yaw_rate, table[:, 13]
        view = cls(time, tick, names, categories, *motion, size, offset, contacts, *hidden)
        view.__dict__.update(states=states, kinematics=table[:, :9], rows=rows)
        return view

    def hidden_from(self, sensor: str) -> tuple[str, ...]:
        """Return the actors that the scenario hides from the sensor of this name."""
        return self.unseen_by.get(sensor, self.unseen)

    def hidden_rows(self, sensor: str = "") -> list[int]:
        """Return the rows of the actors of `hidden_from` that are present."""
        return [self.rows[name] for name in self.hidden_from(sensor) if name in self.rows]

    @cached_property
    def rows(self) -> Mapping[str, int]:
        """Row by name."""
        return {name: row for row, name in enumerate(self.names)}

    @cached_property
    def kinematics(self) -> Array:
        """Position, yaw, pitch, roll and velocity (N, 9)."""
        angles = np.stack([self.yaw, self.pitch, self.roll], axis=1)
        return np.concatenate([self.position, angles, self.velocity], axis=1)

    @cached_property
    def states(self) -> Sequence[ActorState]:
        """State of each row as scalars, for access to single actors, where arrays are slow."""
        motion = [self.kinematics, self.acceleration, self.yaw_rate[:, None], self.speed[:, None]]
        return [ActorState(*row) for row in np.concatenate(motion, axis=1).tolist()]

    def without(self, names: Collection[str]) -> WorldView:
        """Return the same view without some actors."""
        kept = [row for row, name in enumerate(self.names) if name not in names]
        if len(kept) == len(self.names):
            return self
        arrays: dict[str, Any] = {
            name: value[kept] for name in self.__struct_fields__ if isinstance(value := getattr(self, name), np.ndarray)
        }
        return msgspec.structs.replace(
            self,
            names=tuple(self.names[row] for row in kept),
            categories=tuple(self.categories[row] for row in kept),
            **arrays,
        )

    def __contains__(self, name: object) -> bool:
        return name in self.rows

    def row(self, name: str) -> int:
        """Return the row of an actor. Raise KeyError with its name if it is not present."""
        try:
            return self.rows[name]
        except KeyError:
            raise KeyError(f"actor {name!r} is not in the world at {self.time:.2f} s") from None

    @property
    def centers(self) -> Array:
        """Centers of the bounding boxes in the world frame (N, 3) [m], ignoring pitch and roll."""
        return self.boxes[:, :3]

    @cached_property
    def is_upright(self) -> bool:
        """Whether pitch and roll of all actors are 0, so that their bodies are in their boxes."""
        return not any([state.pitch or state.roll for state in self.states])

    @cached_property
    def plain_boxes(self) -> Sequence[Sequence[float]]:
        """Rows of `boxes` as scalars, for access to single actors, where arrays are slow."""
        if len(self.names) <= FEW:
            bodies = zip(self.states, self.offset.tolist(), self.size.tolist(), strict=True)
            return [_box(*body) for body in bodies]
        rows: list[list[float]] = self.boxes.tolist()
        return rows

    @cached_property
    def boxes(self) -> Array:
        """Bounding boxes x y z l w h yaw (N, 7), center in the world frame [m, rad]."""
        if 0 < len(self.names) <= FEW:
            boxes = np.array(self.plain_boxes)
            boxes.setflags(write=False)
            return boxes
        cos, sin = np.cos(self.yaw), np.sin(self.yaw)
        x, y, z = self.offset.T
        centers = self.position + np.stack([cos * x - sin * y, sin * x + cos * y, z], axis=1)
        boxes = np.concatenate([centers, self.size, self.yaw[:, None]], axis=1)
        boxes.setflags(write=False)
        return boxes


def _box(state: ActorState, offset: list[float], size: list[float]) -> tuple[float, ...]:
    x, y, z, yaw, *_ = state
    cos, sin = math.cos(yaw), math.sin(yaw)
    ahead, aside, up = offset
    return (x + cos * ahead - sin * aside, y + sin * ahead + cos * aside, z + up, *size, yaw)
