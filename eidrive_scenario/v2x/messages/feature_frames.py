"""Frames of feature maps: cells of one map, each frame within the MTU and decodable alone."""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Bytes, Integers

Encoding = Literal["int8", "codes"]

PROTOCOL = 1
"""Version of the format."""
CODE_BYTES = {"int8": 8, "codes": 1}
"""Size of the features of one cell by encoding [bytes]."""
INDEX_BYTES = 2
MAX_CELLS = 1 << 8 * INDEX_BYTES
"""Maximum number of cells of a grid, by the size of an index."""
_ENCODINGS: tuple[Encoding, ...] = ("int8", "codes")
_HEADER = struct.Struct("<BI3H3d4f2HBfH")
HEADER_BYTES = _HEADER.size
"""Size of the header [bytes]: version (1), station (4), map, number and count of frames (3 x 2), time, x and y (3 x 8),
yaw, interval, foot and edge of a cell (4 x 4), cells along x and y (2 x 2), encoding (1), scale (4), cells (2)."""
_SINGLE = ("yaw", "interval", "foot", "cell", "scale")
"""Fields with 32 bits."""
_FARTHEST = 1e9
"""Maximum absolute value of coordinates [m], as of positions in a scenario."""


@dataclass(frozen=True)
class FeatureFrame:
    """Cells of a feature map with the header of the map, in little-endian byte order.

    station     id of the sender
    sequence    number of the map, modulo 65536
    number, count  number of the frame, and of the frames of the map
    time        of the scan by the clock of the sender [s]
    x, y, yaw   pose of the grid in the world, as the sender assumes it [m, rad]
    interval    time between the two scans in the features [s]; 0: they are of one scan and show no motion
    foot        height of the ground below the lidar in the world [m]
    cell        edge of a cell [m]
    shape       number of cells along x and y
    encoding    `int8`: 8 channels as integers; `codes`: entry of the code book
    scale       value of the integer 1
    cells       (N, 2 + 8) or (N, 2 + 1): index i * shape[1] + j as 16 bits, and the code of each cell

    Numbers with 32 bits in the header are rounded to them.
    """

    station: int
    sequence: int
    number: int
    count: int
    time: float
    x: float
    y: float
    yaw: float
    interval: float
    foot: float
    cell: float
    shape: tuple[int, int]
    encoding: Encoding
    scale: float
    cells: Bytes

    def __post_init__(self) -> None:
        for name in _SINGLE:
            object.__setattr__(self, name, float(np.float32(getattr(self, name))))

    @property
    def size(self) -> int:
        """Size of the encoded frame [bytes]."""
        return HEADER_BYTES + self.cells.size

    @property
    def indices(self) -> Integers:
        """Index (N,) of each cell."""
        return self.cells[:, 0] + 256 * self.cells[:, 1].astype(np.int64)

    @property
    def integers(self) -> NDArray[np.int8]:
        """Features (8, N) of the encoding `int8`."""
        return self.cells[:, INDEX_BYTES:].view(np.int8).T

    @property
    def codes(self) -> Bytes:
        """Entry (N,) of the code book of each cell, of the encoding `codes`."""
        return self.cells[:, INDEX_BYTES]

    def encode(self) -> bytes:
        """Return the bytes of the frame."""
        header = _HEADER.pack(
            PROTOCOL, self.station, self.sequence, self.number, self.count, self.time, self.x, self.y, self.yaw,
            self.interval, self.foot, self.cell, *self.shape, _ENCODINGS.index(self.encoding), self.scale,
            len(self.cells),
        )  # fmt: skip
        return header + self.cells.tobytes()

    @classmethod
    def decode(cls, data: bytes) -> FeatureFrame:
        """Return the frame of these bytes. Raise ValueError if they are none."""
        if len(data) < HEADER_BYTES:
            raise ValueError(f"a feature frame has at least {HEADER_BYTES} bytes (got {len(data)})")
        version, *numbers, rows, columns, encoding, scale, count = _HEADER.unpack_from(data)
        if version != PROTOCOL or encoding >= len(_ENCODINGS):
            raise ValueError(f"a feature frame has version {PROTOCOL} (got {version}, encoding {encoding})")
        kind = _ENCODINGS[encoding]
        width = INDEX_BYTES + CODE_BYTES[kind]
        if len(data) != HEADER_BYTES + count * width:
            raise ValueError(f"a feature frame of {count} cells has other than {len(data)} bytes")
        cells = np.frombuffer(data, np.uint8, offset=HEADER_BYTES).reshape(count, width)
        station, sequence, number, of, time, x, y, yaw, interval, foot, cell = numbers
        frame = cls(
            station, sequence, number, of, time, x, y, yaw, interval, foot, cell, (rows, columns), kind, scale, cells
        )
        frame.check()
        return frame

    def check(self) -> None:
        """Raise ValueError if a number is out of range, or a cell is not in the grid."""
        rows, columns = self.shape
        numbers = (self.time, self.x, self.y, self.yaw, self.foot)
        if not all(math.isfinite(number) and abs(number) <= _FARTHEST for number in numbers):
            raise ValueError("time or pose of a feature frame is out of range")
        if not (0.0 < self.cell <= _FARTHEST and 0.0 < self.scale <= _FARTHEST and 0.0 <= self.interval <= _FARTHEST):
            raise ValueError(
                f"edge, scale and interval of the cells are {self.cell:g}, {self.scale:g} and {self.interval:g}"
            )
        if not (rows > 0 and columns > 0 and rows * columns <= MAX_CELLS):
            raise ValueError(f"a grid has 1 to {MAX_CELLS} cells (got {rows} x {columns})")
        if not self.number < self.count:
            raise ValueError(f"frame {self.number} of {self.count}")
        if self.cells.shape != (len(self.cells), INDEX_BYTES + CODE_BYTES[self.encoding]):
            raise ValueError(f"cells with encoding {self.encoding} have shape {self.cells.shape}")
        if len(self.cells) and int(self.indices.max()) >= rows * columns:
            raise ValueError("a cell is not in the grid")


def to_cells(indices: Integers, codes: NDArray[np.int8] | Bytes) -> Bytes:
    """Return cells (N, 2 + K) from indices (N,) and codes (K, N) or (N,), as frames contain them."""
    numbers = np.ascontiguousarray(indices, "<u2").view(np.uint8).reshape(-1, INDEX_BYTES)
    return np.concatenate([numbers, np.atleast_2d(codes).T.view(np.uint8)], axis=1)


def split(frame: FeatureFrame, limit: int) -> tuple[FeatureFrame, ...]:
    """Return frames of at most `limit` bytes with the cells of this one in their order, at least one in each.

    A frame without cells is returned as it is.
    """
    room = min(max(1, (limit - HEADER_BYTES) // frame.cells.shape[1]), MAX_CELLS - 1)
    count = max(1, math.ceil(len(frame.cells) / room))
    return tuple(
        replace(frame, number=number, count=count, cells=frame.cells[number * room : (number + 1) * room])
        for number in range(count)
    )
