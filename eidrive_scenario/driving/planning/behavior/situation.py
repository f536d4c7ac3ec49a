"""Situation in which the planner decides."""

from __future__ import annotations

import math
from collections.abc import Callable

import msgspec
import numpy as np

from eidrive_scenario.arrays import Array
from eidrive_scenario.driving.planning.behavior.memory import KnownObject
from eidrive_scenario.driving.planning.behavior.prediction import Prediction
from eidrive_scenario.driving.planning.behavior.proposals import ONCOMING_SPEED, Wall
from eidrive_scenario.driving.planning.behavior.reference import ReferenceLine
from eidrive_scenario.driving.planning.behavior.right_of_way import Passage


class Situation(msgspec.Struct, frozen=True):
    """Position and speed of the vehicle on its line, wanted speed, and the known objects.

    limits  speed limits (M,) at the points of the line [m/s];  s, d  of the reference point [m]
    steered  s and d of the front axle, which the controller keeps on the trajectory [m], and the slope of its motion
    window  range of the points that matter
    stop    place at which a signal requires a stop, or None
    gives_way  returns whether the vehicle gives way to traffic on a passage of a junction; None: there are no junctions
    """

    line: ReferenceLine
    limits: Array
    s: float
    d: float
    steered: tuple[float, float, float]
    speed: float
    wanted: float
    objects: list[KnownObject]
    prediction: Prediction
    window: tuple[int, int]
    stop: Wall | None
    now: float
    gives_way: Callable[[Passage], bool] | None = None
    hidden: str = ""
    """Kind of the nearest way ahead that no sensor shows and that limits the speed; empty without one."""
    road_limits: Array | None = None
    """Speed limits (M,) by curves and the end of the route only [m/s]; None if `limits` has no others."""

    def kind_of(self, owner: int) -> str:
        """Return the class of an object."""
        return self.objects[owner].kind

    def describe(self, owner: int) -> str:
        """Return class, distance and speed of an object as text."""
        known = self.objects[owner]
        x, y = self.line.points[self.line.index_at(self.s)].tolist()
        distance = math.hypot(known.x - x, known.y - y)
        motion = "that approaches at" if self.approaches(owner) else "at"
        return f"{known.kind} {distance:.0f} m ahead {motion} {known.speed:.1f} m/s"

    def approaches(self, owner: int) -> bool:
        """Return whether an object moves against the direction of the line."""
        known = self.objects[owner]
        _, _, heading = self.line.project(np.array([known.x]), np.array([known.y]), *self.window)
        along = known.vx * math.cos(heading[0]) + known.vy * math.sin(heading[0])
        return bool(along < -ONCOMING_SPEED)

    def hidden_at(self, s: float) -> str:
        """Return the kind of the hidden way if such ways limit the speed at a distance along the line more than curves
        and the end of the route; else an empty text."""
        if self.road_limits is None:
            return ""
        limit, by_road = (float(np.interp(s, self.line.along, limits)) for limits in (self.limits, self.road_limits))
        return self.hidden if limit < by_road else ""

    def rows_of(self, owner: int | None) -> tuple[int, ...]:
        """Return the row of an object among the fused objects; none if it is lost."""
        row = None if owner is None else self.objects[owner].row
        return () if row is None else (row,)

    def free_progress(self, horizon: float, acceleration: float) -> float:
        """Return the distance that the vehicle covers without objects [m], by limits, walls and acceleration."""
        speed, s, step = self.speed, self.s, 0.5
        limits, last, spacing, wanted = self.limits, len(self.limits) - 1, self.line.spacing, self.wanted
        end = math.inf if self.stop is None else self.stop.s
        for _ in range(round(horizon / step)):
            limit = float(limits[min(max(int(s / spacing), 0), last)])
            speed = min(speed + acceleration * step, wanted, limit)
            s = min(s + speed * step, end)
        return s - self.s

    def lanes_at(self, s: float) -> int:
        """Return the index of the point of the line at a distance along it."""
        return self.line.index_at(s)
