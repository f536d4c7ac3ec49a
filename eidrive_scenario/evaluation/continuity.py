"""Motion of one actor from frame to frame, without absences and teleports."""

from __future__ import annotations

import math
from typing import NamedTuple

from eidrive_scenario.world.view import WorldView

JUMP = 1.0
"""Displacement beyond the one at twice the speed that is a teleport [m]."""


class Step(NamedTuple):
    """Motion since the previous frame: duration [s] and distance of the center of the body [m]."""

    duration: float
    distance: float


class Continuity:
    """Steps of one actor between successive frames."""

    def __init__(self) -> None:
        self._last: tuple[float, float, float, float] | None = None
        """Time, center and speed in the previous frame; None if the actor was absent."""

    def step(self, view: WorldView, row: int | None) -> Step | None:
        """Return the motion since the previous frame; None after an absence or a teleport.

        row  of the actor; None if it is absent
        """
        before = self._last
        if row is None:
            self._last = None
            return None
        x, y, *_ = view.plain_boxes[row]
        speed = abs(float(view.speed[row]))
        self._last = view.time, x, y, speed
        if before is None:
            return None
        duration, distance = view.time - before[0], math.hypot(x - before[1], y - before[2])
        reach = 2.0 * max(speed, before[3]) * duration + JUMP
        return Step(duration, distance) if distance <= reach else None
