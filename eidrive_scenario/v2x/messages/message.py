"""Messages between stations, with lidar points or features, and the clocks that stamp them."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Literal

import msgspec
import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from eidrive_scenario.base.coverage import ViewSector
from eidrive_scenario.base.detections import Detections
from eidrive_scenario.v2x.messages.feature_frames import FeatureFrame
from eidrive_scenario.v2x.messages.point_cloud import PointCloud

Payload = PointCloud | FeatureFrame
"""Sensor data of the sender in a message."""

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
    measured: float | None = None
    """Station time of the last measurement of the sender, if its objects are predicted from it [s]."""
    offset: float = 0.0
    """Time from the time step of the message until the sender passes it to the radio [s]; radio models include it."""
    features: FeatureFrame | None = None
    """Content of a message of the kind `features`, included in `size`."""

    @property
    def payload(self) -> Payload | None:
        """Sensor data in the message; None without."""
        return self.points if self.features is None else self.features

    @property
    def identified(self) -> Detections:
        """Detections with the object ids of the message as track numbers."""
        given = self.detections
        return given if self.objects is None or given.tracks else replace(given, tracks=self.objects)


def station_id(name: str) -> int:
    """Return the number of a station in encoded messages: the last four bytes of its name."""
    return sum(byte << (8 * number) for number, byte in enumerate(name.encode()[-4:]))


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


def shift_timestamps(message: Message, error: float) -> Message:
    """Return a message with timestamps that are later by `error` [s]; `generated` stays in true time.

    A sender shifts by the error of its clock. A receiver, which assumes that its own clock is right, shifts back by the
    error of that.
    """
    if error == 0.0:
        return message
    points, features = (
        None if payload is None else dataclasses.replace(payload, time=payload.time + error)
        for payload in (message.points, message.features)
    )
    return replace(
        message,
        measured=None if message.measured is None else message.measured + error,
        detections=replace(message.detections, time=message.detections.time + error),
        state=replace(message.state, time=message.state.time + error),
        points=points,
        features=features,
    )
