"""Files of one frame of a station: poses, cameras and true objects as YAML, points as PCD, images as PNG."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.files.atomic import create

DECIMALS = 9
"""Decimals of written numbers: the last one of an angle in degrees moves a point at 140 m by less than 1e-8 m."""
Pose = Sequence[float]
"""x, y, z [m], roll, yaw, pitch [degrees]."""


@dataclass(frozen=True)
class ObjectEntry:
    """True object.

    location  point below the center of its box, at the height of the base of the box [m]
    angle     roll, yaw, pitch [degrees]
    extent    half length, width, height [m]
    speed     [km/h]
    category  class of this project
    """

    location: Sequence[float]
    angle: Sequence[float]
    extent: Sequence[float]
    speed: float
    category: str


@dataclass(frozen=True)
class CameraEntry:
    """Camera: pose, matrix (4, 4) from the lidar to the camera in left-handed axes, and (3, 3) of the lens [px]."""

    cords: Pose
    extrinsic: Sequence[Sequence[float]]
    intrinsic: Sequence[Sequence[float]]


@dataclass(frozen=True)
class StationFrame:
    """State of a station, and true objects around it.

    speed      of the station [km/h]
    extent     half length, width, height of its box [m]
    pose       of the point below the center of its box; `estimate` is the pose that it assumes
    vehicles   true vehicles that its lidar hits, by id;  pedestrians  the same of pedestrians
    """

    lidar_pose: Pose
    pose: Pose
    estimate: Pose
    speed: float
    extent: Sequence[float]
    cameras: Sequence[CameraEntry]
    vehicles: Mapping[int, ObjectEntry]
    pedestrians: Mapping[int, ObjectEntry]

    def text(self) -> str:
        """Return the YAML of the frame. `ego_extent`, `pedestrians` and `obj_type` are additions to OPV2V.

        The text is composed here, as writing it by PyYAML would take longer than a scan.
        """
        lines: list[str] = []
        for number, camera in enumerate(self.cameras):
            lines += [f"camera{number}:", f"  cords: {_list(camera.cords)}"]
            for name, matrix in (("extrinsic", camera.extrinsic), ("intrinsic", camera.intrinsic)):
                lines += [f"  {name}:", *(f"  - {_list(row)}" for row in matrix)]
        lines += [
            f"ego_extent: {_list(self.extent)}",
            f"ego_speed: {_number(self.speed)}",
            f"lidar_pose: {_list(self.lidar_pose)}",
            "plan_trajectory: []",
            f"predicted_ego_pos: {_list(self.estimate)}",
            f"true_ego_pos: {_list(self.pose)}",
        ]
        for name, objects in (("pedestrians", self.pedestrians), ("vehicles", self.vehicles)):
            lines += _objects(name, objects)
        return "\n".join(lines) + "\n"


def _objects(name: str, objects: Mapping[int, ObjectEntry]) -> list[str]:
    lines = [f"{name}:" if objects else f"{name}: {{}}"]
    for number, entry in sorted(objects.items()):
        lines += [
            f"  {number}:",
            f"    angle: {_list(entry.angle)}",
            f"    center: {_list([0.0, 0.0, entry.extent[2]])}",
            f"    extent: {_list(entry.extent)}",
            f"    location: {_list(entry.location)}",
            f"    obj_type: {entry.category}",
            f"    speed: {_number(entry.speed)}",
        ]
    return lines


def _list(values: Sequence[float]) -> str:
    return f"[{', '.join(map(_number, values))}]"


def _number(value: float) -> str:
    """Return a number in fixed notation with at least one decimal, as PyYAML reads 1e-05 and the like as text."""
    text = f"{round(value, DECIMALS) + 0.0:.{DECIMALS}f}".rstrip("0")
    return f"{text}0" if text.endswith(".") else text


_PCD_HEADER = """# .PCD v0.7 - Point Cloud Data file format
VERSION 0.7
FIELDS x y z rgb
SIZE 4 4 4 4
TYPE F F F U
COUNT 1 1 1 1
WIDTH {count}
HEIGHT 1
VIEWPOINT 0 0 0 1 0 0 0
POINTS {count}
DATA binary
"""
_PCD_RECORD = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("rgb", "<u4")])
_RED = 16
"""Lowest bit of the red byte of a packed color."""


def write_pcd(path: Path, points: Array, intensity: Array) -> None:
    """Write points (N, 3) as a binary file of the Point Cloud Library (version 0.7).

    intensity  (N,) in [0, 1], which becomes the red byte of a color, as in OPV2V

    Raise OutputError if the file cannot be written.
    """
    cloud = np.empty(len(points), dtype=_PCD_RECORD)
    cloud["x"], cloud["y"], cloud["z"] = points.T
    cloud["rgb"] = np.rint(255.0 * intensity).astype(np.uint32) << _RED
    write_file(path, _PCD_HEADER.format(count=len(cloud)).encode() + cloud.tobytes())


def write_png(path: Path, rgb: NDArray[np.uint8]) -> None:
    """Write an image (H, W, 3). Raise OutputError if the file cannot be written."""
    import cv2

    _, data = cv2.imencode(".png", cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR))
    encoded: Any = data
    write_file(path, encoded.tobytes())


def write_file(path: Path, content: bytes) -> None:
    """Write a file and create its folders. Raise OutputError if it cannot be written."""
    with create(path) as stream:
        stream.write(content)
