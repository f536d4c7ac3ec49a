"""Action: decisions for one station that come from outside of the driving stack, such as from a learned policy."""

from __future__ import annotations

import math
from numbers import Integral, Real
from typing import Any

import msgspec

from eidrive_scenario.detections import Detections
from eidrive_scenario.errors import Diagnostic, SettingError, quoted
from eidrive_scenario.requests import Goal
from eidrive_scenario.world.actor import Control

MAX_TARGET_SPEED = 1e4
"""Maximum target speed of an action [m/s], as of the property `target_speed`."""


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
            _check("target_speed", speed, 0.0, MAX_TARGET_SPEED)
        if control is not None:
            _check("control.throttle", control.throttle, 0.0, 1.0)
            _check("control.brake", control.brake, 0.0, 1.0)
            _check("control.steering", control.steering, -math.pi, math.pi)

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


def _check(name: str, value: object, low: float, high: float) -> None:
    if not (isinstance(value, Real) and low <= float(value) <= high):
        message = f"{name} of an action is {quoted(value)}"
        raise SettingError(Diagnostic(message, f"give a number from {low:.6g} to {high:.6g}"))
