"""What a station's agent is asked to do, and what it did in one tick."""

from __future__ import annotations

from dataclasses import dataclass

from eidrive_scenario.arrays import Array
from eidrive_scenario.detections import Detections
from eidrive_scenario.records import fast_frozen
from eidrive_scenario.sensing.readings import EgoState
from eidrive_scenario.v2x.messages.message import Message, ReceivedMessage
from eidrive_scenario.world.actor import Control


@fast_frozen
@dataclass(frozen=True)
class Plan:
    """A trajectory: points (M, 2) [m] and the speed at each (M,) [m/s], and why it looks as it does."""

    points: Array
    speeds: Array
    reason: str
    acceleration: float = 0.0
    """With which the first speed is changing [m/s²]."""
    braking: float | None = None
    """A deceleration to apply whatever the speeds say [m/s²]."""
    objects: tuple[int, ...] = ()
    """The objects that make it look so, as rows of those that the planner was given."""


@fast_frozen
@dataclass(frozen=True)
class AgentStep:
    """One tick of one station: what it saw, heard, concluded, planned and did."""

    detections: Detections
    inbox: tuple[ReceivedMessage, ...]
    fused: Detections
    plan: Plan | None
    control: Control | None
    """None for a station that does not drive (a roadside unit)."""
    outbox: tuple[Message, ...]
    estimate: EgoState | None = None
    """Its own motion as it takes it to be, where that is not the truth."""
