"""Messages between stations, with lidar points or features, and the clocks that stamp them."""

from __future__ import annotations

import dataclasses
import struct
from dataclasses import dataclass
from typing import Literal, TypeVar

import msgspec
import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.coverage import ViewSector
from eidrive_scenario.base.detections import Detections
from eidrive_scenario.v2x.messages.feature_frames import Bytes, FeatureFrame

_HEADER = struct.Struct("<d3iH3s3sI")
HEADER_BYTES = _HEADER.size
"""Size of the header [bytes]: time (8), corner in cells (3 x 4), cell in mm (2), cells along y and z (2 x 3),
points (4)."""
_MILLIMETERS = 1000.0
_SEVEN_BITS = 7
_MAX_BYTES = 9
"""Maximum length of one encoded step [bytes]: 63 bits."""


@dataclass(frozen=True)
class PointCloud:
    """Points measured at `time` [s], in the world frame by the pose estimate of the sender.

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
        header = _HEADER.pack(self.time, *low, round(self.cell * _MILLIMETERS), along, up, points)
        return header + self.steps.tobytes()

    @classmethod
    def decode(cls, data: bytes) -> PointCloud:
        """Return the point cloud of these bytes. Raise ValueError if they are none."""
        if len(data) < HEADER_BYTES:
            raise ValueError(f"a point cloud has at least {HEADER_BYTES} bytes (got {len(data)})")
        time, *low, edge, along, up, points = _HEADER.unpack_from(data)
        along, up = int.from_bytes(along, "little"), int.from_bytes(up, "little")
        steps = np.frombuffer(data, np.uint8, offset=HEADER_BYTES)
        if int((steps < 128).sum()) != points or (points and not (along and up and edge and steps[-1] < 128)):
            raise ValueError(f"the bytes of a point cloud do not contain {points} points")
        wide = int(_decode_numbers(steps).sum()) // (along * up) + 1 if points else 0
        cell = edge / _MILLIMETERS
        x, y, z = (place * cell for place in low)
        return cls(time, (x, y, z), cell, (wide, along, up), steps)


def compress(points: Array, time: float, cell: float) -> PointCloud:
    """Return the points (N, 3) on a grid of this cell size, one point per cell, within half a cell.

    cell  edge length of the cells [m], which is rounded to mm
    """
    cell = max(1, round(cell * _MILLIMETERS)) / _MILLIMETERS
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


Payload = PointCloud | FeatureFrame
"""Sensor data of the sender in a message."""
_Payload = TypeVar("_Payload", PointCloud, FeatureFrame)

LineOfSight = Literal["los", "nlosv", "nlos"]
"""State of a line of sight: free, blocked by vehicles only, or by a building or the ground (3GPP TR 37.885, 6.2.1)."""


class StationState(msgspec.Struct, frozen=True, gc=False):
    """State of the sender as it reports it: reference point [m], yaw [rad], speed [m/s], at station `time` [s].

    pose_covariance (3, 3) covariance of x, y and yaw, not included in the covariances of the reported objects; None:
                    the pose is exact
    """

    time: float
    x: float
    y: float
    z: float
    yaw: float
    speed: float
    pose_covariance: NDArray[np.float64] | None = None


class Message(msgspec.Struct, frozen=True, gc=False):
    """Message with the objects of a station at station time `detections.time`, generated at true time `generated` [s].

    kind     cpm  collective perception message (ETSI TS 103 324): objects that the sender perceives
             cam  cooperative awareness message (ETSI EN 302 637-2): the sender as the only object
             features  one frame of a feature map, without objects
    objects  object ids of the sender, one per row of `detections`; objects that are not listed keep the state of
             their last report. None: the list is complete
    """

    sender: str
    number: int
    """Sequence number of the sender's messages, from 0."""
    generated: float
    state: StationState
    detections: Detections
    size: int
    """Size of the message [bytes]."""
    kind: Literal["cpm", "cam", "features"] = "cpm"
    objects: tuple[int, ...] | None = None
    points: PointCloud | None = None
    """Shared lidar point cloud of the sender, included in `size`; None if it is not shared."""
    sensors: tuple[ViewSector, ...] | None = None
    """Sensor information of a CPM: sectors that the sender perceives, in its own frame; None: not in this message."""
    offset: float = 0.0
    """Time from the time step of the message until the sender passes it to the radio [s]; radio models include it."""
    features: FeatureFrame | None = None
    """Content of a message of the kind `features`, included in `size`."""

    @property
    def payload(self) -> Payload | None:
        """Sensor data in the message; None without."""
        return self.points if self.features is None else self.features


def station_id(name: str) -> int:
    """Return the number of a station in encoded messages: the last four bytes of its name."""
    return sum(byte << (8 * place) for place, byte in enumerate(name.encode()[-4:]))


class ReceivedMessage(msgspec.Struct, frozen=True, gc=False):
    """Message at its receiver, with the time of arrival [s]."""

    message: Message
    arrived: float


class LinkEvent(msgspec.Struct, frozen=True, gc=False):
    """Outcome of one message on one link: it arrives at `arrives` [s] or is lost for `reason`.

    Radio models also report the path loss with shadowing and blockage [dB], the signal-to-noise ratio without
    interference [dB], the state of the line of sight, and the names of the blocking bodies.
    """

    sender: str
    receiver: str
    number: int
    sent: float
    outcome: Literal["delivered", "lost"]
    arrives: float | None
    reason: str
    size: int
    path_loss_db: float | None = None
    snr_db: float | None = None
    los: LineOfSight | None = None
    blockers: tuple[str, ...] = ()


@dataclass(frozen=True)
class StationClock:
    """Clock that shows true time + offset + drift · true time [s]; `drift` is a ratio, 20e-6 for 20 ppm."""

    offset: float = 0.0
    drift: float = 0.0

    def error(self, now: float) -> float:
        """Return the difference between station time and true time [s]."""
        return self.offset + self.drift * now

    def with_station_timestamps(self, message: Message, now: float) -> Message:
        """Return a message of this station with timestamps of this clock; `generated` stays in true time."""
        return _shift_timestamps(message, self.error(now))

    def with_local_timestamps(self, message: Message, now: float) -> Message:
        """Return a received message with timestamps relative to this clock, which the station assumes to be true."""
        return _shift_timestamps(message, -self.error(now))


def _shift_timestamps(message: Message, error: float) -> Message:
    if error == 0.0:
        return message
    return replace(
        message,
        detections=replace(message.detections, time=message.detections.time + error),
        state=replace(message.state, time=message.state.time + error),
        points=_shift_payload(message.points, error),
        features=_shift_payload(message.features, error),
    )


def _shift_payload(payload: _Payload | None, error: float) -> _Payload | None:
    return None if payload is None else dataclasses.replace(payload, time=payload.time + error)
