"""Lidar points in messages: occupied cells of a grid, each as the step from the one before."""

from __future__ import annotations

import struct
from dataclasses import dataclass

import numpy as np

from eidrive_scenario.base.arrays import Array, Bytes, Integers

_HEADER = struct.Struct("<dH3iH3s3sI")
HEADER_BYTES = _HEADER.size
"""Size of the header [bytes]: time (8), duration in ms (2), corner in cells (3 x 4), cell in mm (2), cells along y and
z (2 x 3), points (4)."""
_MILLIMETERS = _MILLISECONDS = 1000.0
_MAX_DURATION = 65_535
"""Maximum duration [ms]."""
_SEVEN_BITS = 7
_MAX_BYTES = 9
"""Maximum length of one encoded step [bytes]: 63 bits."""


@dataclass(frozen=True)
class PointCloud:
    """Points measured in the last `duration` seconds up to `time` [s], in the world frame by the pose estimate of the
    sender.

    corner  (3,) corner of the grid [m]
    cell    edge length of the cells [m], a multiple of 1 mm
    shape   number of cells along x, y and z
    steps   index differences between occupied cells in the order of x, y, z, in LEB128 as in protobuf: base 128, least
            significant digit first, highest bit set in all bytes of a number except the last
    """

    time: float
    corner: tuple[float, float, float]
    cell: float
    shape: tuple[int, int, int]
    steps: Bytes
    duration: float = 0.0

    @property
    def size(self) -> int:
        """Size of the encoded point cloud [bytes]."""
        return HEADER_BYTES + len(self.steps)

    def points(self) -> Array:
        """Return the centers of the occupied cells (N, 3) [m]."""
        _, along, up = self.shape
        cells = np.cumsum(_decode_numbers(self.steps))
        indices = np.stack([cells // (along * up), cells // up % along, cells % up], axis=1)
        return np.asarray(np.asarray(self.corner) + (indices + 0.5) * self.cell, dtype=np.float64)

    def encode(self) -> bytes:
        """Return the bytes of the point cloud."""
        low = [round(edge / self.cell) for edge in self.corner]
        along, up = (cells.to_bytes(3, "little") for cells in self.shape[1:])
        points = int((self.steps < 128).sum())
        duration, cell = round(self.duration * _MILLISECONDS), round(self.cell * _MILLIMETERS)
        header = _HEADER.pack(self.time, duration, *low, cell, along, up, points)
        return header + self.steps.tobytes()

    @classmethod
    def decode(cls, data: bytes) -> PointCloud:
        """Return the point cloud of these bytes. Raise ValueError if they are none."""
        if len(data) < HEADER_BYTES:
            raise ValueError(f"a point cloud has at least {HEADER_BYTES} bytes (got {len(data)})")
        time, milliseconds, *low, millimeters, along, up, points = _HEADER.unpack_from(data)
        along, up = int.from_bytes(along, "little"), int.from_bytes(up, "little")
        steps = np.frombuffer(data, np.uint8, offset=HEADER_BYTES)
        if int((steps < 128).sum()) != points or (
            len(steps) and not (along and up and millimeters and steps[-1] < 128)
        ):
            raise ValueError(f"the bytes of a point cloud do not contain {points} points")
        cells = np.cumsum(_decode_numbers(steps))
        if cells.min(initial=0) < 0:
            raise ValueError("a point of a point cloud has an index of more than 63 bits")
        wide = int(cells[-1]) // (along * up) + 1 if points else 0
        cell = millimeters / _MILLIMETERS
        x, y, z = (edge * cell for edge in low)
        return cls(time, (x, y, z), cell, (wide, along, up), steps, milliseconds / _MILLISECONDS)


def compress(points: Array, time: float, cell: float, duration: float = 0.0) -> PointCloud:
    """Return the points (N, 3) on a grid of this cell size, one point per cell, within half a cell.

    cell      edge length of the cells [m], which is rounded to mm
    duration  from the measurement of the first point to that of the last one [s], which is rounded to ms
    """
    duration = min(round(duration * _MILLISECONDS), _MAX_DURATION) / _MILLISECONDS
    cell = max(1, round(cell * _MILLIMETERS)) / _MILLIMETERS
    if not len(points):
        return PointCloud(time, (0.0, 0.0, 0.0), cell, (0, 0, 0), np.empty(0, dtype=np.uint8), duration)
    low = np.floor(points.min(axis=0) / cell).astype(np.int64)
    indices = np.floor(points / cell).astype(np.int64) - low
    wide, along, up = (indices.max(axis=0) + 1).tolist()
    occupied = np.unique((indices[:, 0] * along + indices[:, 1]) * up + indices[:, 2])
    x, y, z = (low * cell).tolist()
    steps = _encode_numbers(np.diff(occupied, prepend=0))
    return PointCloud(time, (x, y, z), cell, (wide, along, up), steps, duration)


def _encode_numbers(numbers: Integers) -> Bytes:
    groups = numbers[:, None] >> (_SEVEN_BITS * np.arange(_MAX_BYTES)) & 127
    later = np.cumsum(groups[:, ::-1], axis=1)[:, ::-1] - groups
    needed = (later > 0) | (groups > 0)
    needed[:, 0] = True
    last = later == 0
    digits: Bytes = np.where(last, groups, groups + 128)[needed].astype(np.uint8)
    return digits


def _decode_numbers(data: Bytes) -> Integers:
    """Return the numbers of complete encodings. Raise ValueError for a number of more than 63 bits."""
    if not len(data):
        return np.empty(0, dtype=np.int64)
    ends = np.flatnonzero(data < 128)
    starts = np.concatenate([[0], ends[:-1] + 1])
    digit = np.arange(len(data)) - np.repeat(starts, ends - starts + 1)
    if digit.max() >= _MAX_BYTES:
        raise ValueError(f"a step between points has more than {_MAX_BYTES} bytes")
    return np.asarray(np.add.reduceat((data.astype(np.int64) & 127) << (_SEVEN_BITS * digit), starts), dtype=np.int64)
