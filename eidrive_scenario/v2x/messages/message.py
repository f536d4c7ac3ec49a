"""A message, and what becomes of it on each link."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.detections import Detections
from eidrive_scenario.records import fast_frozen
from eidrive_scenario.v2x.messages.point_cloud import PointCloud

LineOfSight = Literal["los", "nlosv", "nlos"]
"""Between two antennas: nothing, vehicles only, or a building or the ground (3GPP TR 37.885, 6.2.1)."""


@fast_frozen
@dataclass(frozen=True)
class StationState:
    """Where the sender says it is: reference point [m], yaw [rad], speed [m/s], at `time` [s] of its own clock.

    pose_covariance (3, 3) of x, y and yaw; it is not part of the covariances of the objects that the sender reports.
    None: the sender knows its place exactly
    """

    time: float
    x: float
    y: float
    z: float
    yaw: float
    speed: float
    pose_covariance: NDArray[np.float64] | None = None


@fast_frozen
@dataclass(frozen=True)
class Message:
    """What a station says of the objects that it knows at `detections.time` of its own clock, said at `generated` [s].

    kind     cpm  collective perception message (ETSI TS 103 324): what the sender perceives
             cam  cooperative awareness message (ETSI EN 302 637-2): the sender itself, as the only object
    objects  the sender's numbers of its objects, one per row of `detections`: the others are still what an earlier
             message said of them. None: the list is all that the sender knows now
    """

    sender: str
    number: int
    """Counts the sender's messages from 0."""
    generated: float
    state: StationState
    detections: Detections
    size: int
    """[bytes]"""
    kind: Literal["cpm", "cam"] = "cpm"
    objects: tuple[int, ...] | None = None
    points: PointCloud | None = None
    """What the sender's LiDARs measured, where it shares that; `size` contains it."""


@fast_frozen
@dataclass(frozen=True)
class ReceivedMessage:
    """A message at its receiver, and when it arrived [s]."""

    message: Message
    arrived: float


@fast_frozen
@dataclass(frozen=True)
class LinkEvent:
    """The fate of one message on one link, told when it is known: it arrives at `arrives` [s], or is lost for a reason.

    Channels that know a radio say too: the path loss with shadowing and blocking bodies [dB], the ratio of signal to
    noise without interference [dB], what stands between the antennas, and whose bodies those are.
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
