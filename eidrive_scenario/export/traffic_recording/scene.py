"""Recorded scene: tracks of road users, and the stations that recorded them, in the world of this project."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.export.geometry import angles

STATION_SIZE = (4.9, 2.06, 1.5)
"""Length, width and height of a vehicle with a lidar whose box no file states: a Lincoln MKZ, as in OPV2V [m]."""
LIDAR_HEIGHT = 1.9
"""Height of a lidar above the ground below a vehicle whose pose no file states [m]."""
MAX_NUMBER = 1e9
"""Maximum absolute value of a number in a file."""
OUT_OF_RANGE = f"has a number that is out of range (expected -{MAX_NUMBER:g} to {MAX_NUMBER:g})"


MAX_ROLL = 0.5
"""Roll of the lidar of a vehicle relative to its box that counts as none [degrees]."""


def folder_name(folder: Path) -> str:
    """Return the name of a folder, that of `.` and `..` too."""
    return os.path.basename(os.path.abspath(folder))


def assumed_size(station: str) -> str:
    """Return the warning about a station that has `STATION_SIZE`."""
    return f"{station} has the size {' x '.join(f'{edge:g}' for edge in STATION_SIZE)} m: no file states it"


@dataclass(frozen=True)
class Track:
    """Road user.

    category  class of this project; "" if the recording states none
    size      length, width, height of the box [m]
    times     (N,) rising [s]
    poses     (N, 4, 4) of the center of the box
    """

    name: str
    category: str
    size: tuple[float, float, float]
    times: Array
    poses: Array

    @property
    def base_heights(self) -> Array:
        """Heights of the base of the box (N,) [m]."""
        heights: Array = self.poses[:, 2, 3] - self.size[2] / 2.0
        return heights


@dataclass(frozen=True)
class LidarStation:
    """Station with a lidar: its name, for a vehicle that of its track, and the pose (4, 4) of the lidar."""

    name: str
    lidar: Array


@dataclass
class TrafficScene:
    """Scene of a recording; `end` is the time of the last frame [s], the first one has the time 0.

    mobile    vehicles with a lidar, whose pose is relative to the center of their box
    roadside  roadside units with the poses of their lidars in the world
    """

    name: str
    end: float
    tracks: list[Track]
    mobile: list[LidarStation]
    roadside: list[LidarStation]
    warnings: list[str] = field(default_factory=list)


def roll_warnings(scene: TrafficScene) -> Iterator[str]:
    """Yield a warning for each vehicle whose lidar has a roll, which the mount of a sensor has not."""
    for station in scene.mobile:
        roll = math.degrees(angles(station.lidar[:3, :3])[2])
        if abs(roll) > MAX_ROLL:
            yield f"the lidar of {station.name} has no roll: mounts have none (recorded: {roll:.1f} degrees)"


GROUND_TOLERANCE = 0.5
"""Distance of the ground from the height 0 up to which heights are kept [m]."""


def at_ground(scene: TrafficScene) -> TrafficScene:
    """Return a scene whose lowest road user stands at the height 0, that of the ground of a scenario without roads.

    A slope remains: road users on it are above the ground, and a warning states it.
    """
    bases = np.concatenate([track.base_heights for track in scene.tracks]) if scene.tracks else np.zeros(1)
    ground, top = float(bases.min()), float(bases.max())
    warnings = list(scene.warnings)
    tracks, roadside = scene.tracks, scene.roadside
    if abs(ground) > GROUND_TOLERANCE:
        warnings.append(f"all heights are reduced by {ground:.3f} m: the ground without roads is at the height 0")
        tracks = [replace(track, poses=_lowered(track.poses, ground)) for track in tracks]
        roadside = [replace(station, lidar=_lowered(station.lidar, ground)) for station in roadside]
        top -= ground
    if top > GROUND_TOLERANCE:
        warnings.append(f"the ground is a plane without roads: road users are up to {top:.2f} m above it")
    return replace(scene, tracks=tracks, roadside=roadside, warnings=warnings)


def _lowered(poses: Array, height: float) -> Array:
    lowered: Array = poses.copy()
    lowered[..., 2, 3] -= height
    return lowered
