"""Trajectory that a driving stack follows: its path becomes the goal of the vehicle."""

from __future__ import annotations

import math

import numpy as np
from msgspec.structs import replace

from eidrive_behaviors.actions.routing import POINTS_APART
from eidrive_scenario.api.actions import Goal, TrajectoryCurve
from eidrive_scenario.api.common import Array, Pose

ARRIVED = 2.0
"""Maximum distance to the end along the trajectory at which a driven vehicle has arrived [m]."""
MISSED = 10.0
"""Minimum distance of a driven vehicle from the end, once it is beside or beyond it, at which it has missed it [m]."""


class DrivenTrajectory:
    """Goal of a driven vehicle on a trajectory, from an arc length on [m].

    place  arc length of the vehicle [m], within the trajectory
    """

    def __init__(self, layout: TrajectoryCurve, place: float) -> None:
        self.place = place
        self._away = 0.0
        self._layout = layout
        self._path = _points(layout, place)
        self._lap = _points(layout, 0.0) if layout.closed else None

    def move(self, pose: Pose) -> float:
        """Update the place, and return the arc length [m] on the trajectory extended along its tangents."""
        layout = self._layout
        at = layout.track(pose.x, pose.y, self.place)
        self.place = at if layout.closed else min(max(at, 0.0), layout.length)
        end = layout.at(layout.length)
        self._away = math.hypot(pose.x - end.x, pose.y - end.y)
        return at

    @property
    def has_arrived(self) -> bool:
        """Whether the vehicle is at the end; False for a closed trajectory, which is driven in laps."""
        return self._has_passed and self._away < MISSED

    @property
    def has_missed(self) -> bool:
        """Whether the vehicle is beside or beyond the end, but not at it."""
        return self._has_passed and self._away >= MISSED

    @property
    def _has_passed(self) -> bool:
        return not self._layout.closed and self._layout.length - self.place <= ARRIVED

    def goal(self, before: Goal | None, speed: float | None) -> Goal:
        """Return the goal with this path; a target speed [m/s] replaces that of the goal before."""
        goal = replace(before or Goal(), path=self._path, lap=self._lap)
        return goal if speed is None else replace(goal, speed=speed, acceleration=0.0)


def _points(layout: TrajectoryCurve, start: float) -> Array:
    """Return points of a trajectory (M, 3) from an arc length [m] to its end."""
    count = max(2, math.ceil(layout.length / POINTS_APART) + 1)
    return np.array([layout.at(s)[:3] for s in np.linspace(start, layout.length, count).tolist()])
