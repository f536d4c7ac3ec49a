"""Files of one frame of a station: poses, cameras and true objects as YAML, points as PCD, images as PNG."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.files.atomic import create

DECIMALS = 9
"""Decimals of written numbers: the last one of an angle in degrees moves a point at 140 m by less than 1e-8 m."""


def frame_text(content: Mapping[str, Any]) -> str:
    """Return the YAML of a frame: mappings by lines, lists of numbers in one line each, those of a matrix by rows.

    The text is composed here, as writing it by PyYAML would take longer than a scan.
    """
    return "\n".join(_lines(content)) + "\n"


def _lines(content: Mapping[Any, Any], indent: str = "") -> Iterator[str]:
    for key, value in content.items():
        if isinstance(value, Mapping) and value:
            yield f"{indent}{key}:"
            yield from _lines(value, f"{indent}  ")
        elif isinstance(value, list) and value and isinstance(value[0], list):
            yield f"{indent}{key}:"
            yield from (f"{indent}- {_flow(row)}" for row in value)
        else:
            yield f"{indent}{key}: {_flow(value)}"


def _flow(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{}"  # others have lines
    if isinstance(value, list):
        return f"[{', '.join(map(_number, value))}]"
    return value if isinstance(value, str) else _number(value)


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

    _, data = cv2.imencode(".png", rgb[..., ::-1])
    write_file(path, data.tobytes())


def write_file(path: Path, content: bytes) -> None:
    """Write a file and create its folders. Raise OutputError if it cannot be written."""
    with create(path) as stream:
        stream.write(content)
