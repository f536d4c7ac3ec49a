"""A message, and what becomes of it on each link."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from eidrive_scenario.detections import Detections


@dataclass(frozen=True)
class StationState:
    """Where the sender says it is: reference point [m], yaw [rad], speed [m/s], at `time` [s]."""

    time: float
    x: float
    y: float
    z: float
    yaw: float
    speed: float


@dataclass(frozen=True)
class Message:
    """A collective perception message: what the sender perceived at `detections.time`, said at `generated` [s]."""

    sender: str
    number: int
    """Counts the sender's messages from 0."""
    generated: float
    state: StationState
    detections: Detections
    size: int
    """[bytes]"""


@dataclass(frozen=True)
class Received:
    """A message at its receiver, and when it arrived [s]."""

    message: Message
    arrived: float


@dataclass(frozen=True)
class LinkEvent:
    """The fate of one message on one link, known at sending: it arrives at `arrives` [s], or is lost for a reason."""

    sender: str
    receiver: str
    number: int
    sent: float
    outcome: Literal["delivered", "lost"]
    arrives: float | None
    reason: str
    size: int
