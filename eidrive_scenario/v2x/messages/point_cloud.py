"""Compressed lidar point cloud in a message: occupied grid cells, sorted and delta encoded."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.arrays import Array

Bytes = NDArray[np.uint8]

HEADER_BYTES = 32
"""Size of the header [bytes]: time (8), corner (3 x 4), cell (2), cells along each axis (3 x 2), points (4)."""
_SEVEN_BITS = 7
_MAX_BYTES = 9
"""Maximum length of one encoded step [bytes]: 63 bits."""


@dataclass(frozen=True)
class PointCloud:
    """Points measured at `time` [s], in the world frame by the pose estimate of the sender.

    corner  (3,) corner of the grid [m]
    cell    edge length of the cells [m]
    shape   number of cells along x, y and z
    steps   index differences between occupied cells in the order of x, y, z, in LEB128 as in protobuf: base 128, least
            significant digit first, highest bit set in all bytes of a number except the last
    """

    time: float
    corner: tuple[float, float, float]
    cell: float
    shape: tuple[int, int, int]
    steps: Bytes

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


def compress(points: Array, time: float, cell: float) -> PointCloud:
    """Return the points (N, 3) on a grid of this cell size [m], one point per cell, within half a cell."""
    if not len(points):
        return PointCloud(time, (0.0, 0.0, 0.0), cell, (0, 0, 0), np.empty(0, dtype=np.uint8))
    low = np.floor(points.min(axis=0) / cell).astype(np.int64)
    indices = np.floor(points / cell).astype(np.int64) - low
    wide, along, up = (indices.max(axis=0) + 1).tolist()
    occupied = np.unique((indices[:, 0] * along + indices[:, 1]) * up + indices[:, 2])
    x, y, z = (low * cell).tolist()
    return PointCloud(time, (x, y, z), cell, (wide, along, up), _encode_numbers(np.diff(occupied, prepend=0)))


def _encode_numbers(numbers: NDArray[np.int64]) -> Bytes:
    groups = numbers[:, None] >> (_SEVEN_BITS * np.arange(_MAX_BYTES)) & 127
    later = np.cumsum(groups[:, ::-1], axis=1)[:, ::-1] - groups
    needed = (later > 0) | (groups > 0)
    needed[:, 0] = True
    last = later == 0
    digits: Bytes = np.where(last, groups, groups + 128)[needed].astype(np.uint8)
    return digits


def _decode_numbers(data: Bytes) -> NDArray[np.int64]:
    if not len(data):
        return np.empty(0, dtype=np.int64)
    ends = np.flatnonzero(data < 128)
    starts = np.concatenate([[0], ends[:-1] + 1])
    place = np.arange(len(data)) - np.repeat(starts, ends - starts + 1)
    return np.asarray(np.add.reduceat((data.astype(np.int64) & 127) << (_SEVEN_BITS * place), starts), dtype=np.int64)
