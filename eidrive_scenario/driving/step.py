"""Trajectory of a planner; perception and step of an agent in one tick."""

from __future__ import annotations

from collections.abc import Sequence

import msgspec

from eidrive_scenario.arrays import Array
from eidrive_scenario.detections import Detections
from eidrive_scenario.requests import Goal
from eidrive_scenario.sensing.readings import EgoState, SignalReading
from eidrive_scenario.v2x.messages.message import Message, ReceivedMessage, StationState
from eidrive_scenario.world.actor import Control


class Plan(msgspec.Struct, frozen=True, gc=False):
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


class StationPerception(msgspec.Struct, frozen=True, gc=False):
    """Perception of one station in one tick, before it plans: the input of its step.

    time              of the tick [s]
    ego               estimated ego state
    state             ego state as its messages report it
    detections        newest detections by its sensors
    inbox             received messages
    fused             objects after fusion
    goal              request of the scenario; None if there is none
    signals           traffic lights and stop signs in sight, if the station obeys them
    message_interval  minimum time between two messages under congestion control [s]
    expired           rows of the received messages that are not used because they are too old
    """

    time: float
    ego: EgoState
    state: StationState
    detections: Detections
    inbox: tuple[ReceivedMessage, ...]
    fused: Detections
    goal: Goal | None = None
    signals: Sequence[SignalReading] = ()
    message_interval: float = 0.0
    expired: tuple[int, ...] = ()


class AgentStep(msgspec.Struct, frozen=True, gc=False):
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
    expired: tuple[int, ...] = ()
    """Rows of `inbox` with messages that are not used because they are too old."""
