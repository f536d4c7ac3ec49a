"""Point clouds as PCD files (Point Cloud Library, version 0.7), binary, with colors as OPV2V has them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.files.atomic import create

_HEADER = """# .PCD v0.7 - Point Cloud Data file format
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
_RECORD = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("rgb", "<u4")])
_RED = 16
"""Lowest bit of the red byte of a packed color."""


def write_pcd(path: Path, points: Array, intensity: Array) -> None:
    """Write points (N, 3) with their intensity (N,) in [0, 1], which becomes the red byte of a color.

    Raise OutputError if the file cannot be written.
    """
    cloud = np.empty(len(points), dtype=_RECORD)
    cloud["x"], cloud["y"], cloud["z"] = points.T
    cloud["rgb"] = np.rint(255.0 * intensity).astype(np.uint32) << _RED
    with create(path) as stream:
        stream.write(_HEADER.format(count=len(cloud)).encode())
        stream.write(cloud.tobytes())
