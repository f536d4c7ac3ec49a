"""Trajectory of a planner; perception, actions from outside and step of a station in one tick."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from numbers import Integral, Real
from typing import Any

import msgspec

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.detections import Detections
from eidrive_scenario.base.requests import Goal
from eidrive_scenario.errors import Diagnostic, SettingError, quoted
from eidrive_scenario.sensing.readings import EgoState, SignalReading
from eidrive_scenario.v2x.messages.message import Message, ReceivedMessage, StationState
from eidrive_scenario.world.actor import Control


class Plan(msgspec.Struct, frozen=True, gc=False):
    """Trajectory: points (M, 2) [m], the speed at each point (M,) [m/s], and the reason for them."""

    points: Array
    speeds: Array
    reason: str
    acceleration: float = 0.0
    """Rate of change of the first speed, which is that at the vehicle [m/s²]; negative: its deceleration now."""
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


MAX_TARGET_SPEED = 1e4
"""Maximum target speed of settings and actions [m/s], and of a planned speed [m/s] and acceleration [m/s²]."""


class StationAction(msgspec.Struct, frozen=True):
    """Decisions for one station in one tick. Whatever is None remains a decision of the stack.

    target_speed  replaces the speed that the scenario requests of the planner [m/s]
    control       replaces the control of the vehicle controller
    send          whether messages that are due are sent; False postpones them
    share         rows of the own detections that messages contain, in this order

    Raise SettingError for values that are not finite or outside their ranges.
    """

    target_speed: float | None = None
    control: Control | None = None
    send: bool = True
    share: tuple[int, ...] | None = None

    def __post_init__(self) -> None:
        speed, control = self.target_speed, self.control
        if speed is not None:
            _check_range("target_speed", speed, 0.0, MAX_TARGET_SPEED)
        if control is not None:
            if not isinstance(control, Control):
                raise SettingError(Diagnostic(f"control of an action is {quoted(control)}", "give a Control"))
            _check_range("control.throttle", control.throttle, 0.0, 1.0)
            _check_range("control.brake", control.brake, 0.0, 1.0)
            _check_range("control.steering", control.steering, -math.pi, math.pi)
        if self.share is not None and not isinstance(self.share, Iterable):
            raise SettingError(Diagnostic(f"share of an action is {quoted(self.share)}", "give a tuple of rows"))

    @property
    def drives(self) -> bool:
        """Whether the action concerns the motion of the vehicle."""
        return self.target_speed is not None or self.control is not None

    def requested_goal(self, goal: Goal | None) -> Goal | None:
        """Return the goal of the scenario with the target speed of this action."""
        speed = self.target_speed
        if speed is None:
            return goal
        return Goal(speed) if goal is None else msgspec.structs.replace(goal, speed=speed, acceleration=0.0)

    def shared(self, detections: Detections) -> Detections:
        """Return the detections that messages contain.

        Raise SettingError for a row that they do not have, or that is given twice.
        """
        if self.share is None:
            return detections
        rows: list[Any] = list(self.share)
        last = len(detections) - 1
        for index, row in enumerate(rows):
            if not (isinstance(row, Integral) and 0 <= int(row) <= last):
                message = f"share of an action contains the row {quoted(row)}"
                raise SettingError(Diagnostic(message, f"the station has {last + 1} own detections"))
            if row in rows[:index]:
                raise SettingError(Diagnostic(f"share of an action contains the row {row} twice", "give each row once"))
        return detections.subset(rows)


OWN_DECISIONS = StationAction()
"""Action that leaves all decisions to the stack."""


def _check_range(name: str, value: object, low: float, high: float) -> None:
    if not (isinstance(value, Real) and low <= float(value) <= high):
        message = f"{name} of an action is {quoted(value)}"
        raise SettingError(Diagnostic(message, f"give a number from {low:.6g} to {high:.6g}"))
