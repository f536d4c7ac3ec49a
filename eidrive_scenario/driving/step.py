"""Trajectory of a planner, and the step of an agent in one tick."""

from __future__ import annotations

import msgspec

from eidrive_scenario.arrays import Array
from eidrive_scenario.detections import Detections
from eidrive_scenario.sensing.readings import EgoState
from eidrive_scenario.v2x.messages.message import Message, ReceivedMessage
from eidrive_scenario.world.actor import Control


class Plan(msgspec.Struct, frozen=True):
    """Trajectory: points (M, 2) [m], the speed at each point (M,) [m/s], and the reason for them."""

    points: Array
    speeds: Array
    reason: str
    acceleration: float = 0.0
    """Rate of change of the first speed [m/s²]."""
    braking: float | None = None
    """Deceleration that overrides the speeds [m/s²]."""
    objects: tuple[int, ...] = ()
    """Objects that are the reason for the plan, as rows of the objects passed to the planner."""


class AgentStep(msgspec.Struct, frozen=True):
    """Step of one station: detections, received messages, fused objects, plan, control and sent messages."""

    detections: Detections
    inbox: tuple[ReceivedMessage, ...]
    fused: Detections
    plan: Plan | None
    control: Control | None
    """None for a station that does not drive (a roadside unit)."""
    outbox: tuple[Message, ...]
    estimate: EgoState | None = None
    """Estimated ego state; None if the station uses its true state."""
