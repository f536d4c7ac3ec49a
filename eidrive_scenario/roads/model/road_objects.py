"""Plain data of the objects of an OpenDRIVE file: positions, outlines and repetitions.

Names follow ASAM OpenDRIVE 1.6 to 1.8; lengths in meters, angles in radians.
"""

from __future__ import annotations

import msgspec


class Corner(msgspec.Struct, frozen=True):
    """Corner of the outline of an object: (s, t, dz) on the road, or (u, v, z) in the frame of the object."""

    on_road: bool
    x: float
    y: float
    z: float
    height: float


class Repeat(msgspec.Struct, frozen=True):
    """Repetition of an object along the road; distance 0 means without gaps.

    length  extent of the repetition along the road [m]
    size, radius, …  values of the first and of the last object [m]; `size` is their length
    """

    s: float
    length: float
    distance: float
    t: tuple[float, float]
    width: tuple[float, float]
    height: tuple[float, float]
    z_offset: tuple[float, float]
    size: tuple[float, float]
    radius: tuple[float, float]


class RoadObject(msgspec.Struct, frozen=True):
    """Object at a road, such as a barrier, pole, tree, building, crosswalk or parking space."""

    id: str
    name: str
    type: str
    subtype: str
    road: str
    s: float
    t: float
    z_offset: float
    heading: float
    pitch: float
    roll: float
    orientation: str
    length: float
    width: float
    height: float
    radius: float
    outlines: tuple[tuple[Corner, ...], ...] = ()
    repeats: tuple[Repeat, ...] = ()
