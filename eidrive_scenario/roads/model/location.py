"""Positions: poses, road coordinates and lane coordinates, as single values or arrays."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Array, Integers
from eidrive_scenario.errors import InputError


class PositionError(InputError):
    """Position on a road or lane that does not exist in the road network."""


class Pose(NamedTuple):
    """Pose in the world frame: x, y, z [m]; heading, pitch (nose down positive), roll [rad]; z-y'-x'' rotation."""

    x: float
    y: float
    z: float
    h: float
    p: float
    r: float

    def turned(self, angle: float) -> Pose:
        """Return the pose rotated to the left by `angle` [rad] on the same inclined surface.

        Pitch and roll are adapted: a slope upwards in one direction is downwards in the other.
        """
        if angle == 0.0:
            return self
        if self.p == 0.0 and self.r == 0.0:
            return Pose(self.x, self.y, self.z, self.h + angle, self.p, self.r)
        if abs(angle) == math.pi:
            return Pose(self.x, self.y, self.z, self.h + angle, -self.p, -self.r)
        ca, sa = math.cos(angle), math.sin(angle)
        cp, sp, cr, sr = math.cos(self.p), math.sin(self.p), math.cos(self.r), math.sin(self.r)
        # Columns of Ry(p)·Rx(r)·Rz(angle): forward and the vertical parts of left and up.
        forward = (cp * ca + sp * sr * sa, cr * sa, -sp * ca + cp * sr * sa)
        left_z, up_z = sp * sa + cp * sr * ca, cp * cr
        heading = math.atan2(forward[1], forward[0])
        pitch = math.atan2(-forward[2], math.hypot(forward[0], forward[1]))
        return Pose(self.x, self.y, self.z, self.h + heading, pitch, math.atan2(left_z, up_z))


class Poses(NamedTuple):
    """Poses as arrays of one shape."""

    x: Array
    y: Array
    z: Array
    h: Array
    p: Array
    r: Array


class LaneLocation(NamedTuple):
    """Position in lane coordinates.

    s, t    road coordinates [m]
    offset  distance from the center line of the lane, positive in the direction of t [m]
    """

    road: str
    lane: int
    s: float
    offset: float
    t: float


class LaneKey(NamedTuple):
    """Lane of a lane section: node of the lane graph."""

    road: str
    section: int
    lane: int


@dataclass(frozen=True)
class LaneLocations:
    """Positions in lane coordinates as arrays of one shape (N,). Without a road within reach only road and lane are
    valid.

    road      index into `roads`, -1 if no road is within reach
    lane      lane id; 0 if no road is within reach
    s, t      road coordinates [m]
    offset    distance from the center line of the lane, positive in the direction of t [m]
    heading   heading of the reference line at s [rad]
    outside   distance from the edge of the road, 0 on the road [m]; at least `reach` if none is within it
    """

    roads: Sequence[str]
    road: Integers
    lane: Integers
    s: Array
    t: Array
    offset: Array
    heading: Array
    outside: Array

    @property
    def found(self) -> NDArray[np.bool_]:
        """True if a road is within reach."""
        return self.road >= 0

    def insert(self, locations: LaneLocations, rows: Integers) -> None:
        """Set these rows to the given locations (K,)."""
        for field in fields(self)[1:]:
            getattr(self, field.name)[rows] = getattr(locations, field.name)

    def location(self, index: int) -> LaneLocation | None:
        """Return one location, or None if no road is within reach."""
        road = int(self.road[index])
        if road < 0:
            return None
        s, offset, t = self.s.item(index), self.offset.item(index), self.t.item(index)
        return LaneLocation(self.roads[road], self.lane.item(index), s, offset, t)
