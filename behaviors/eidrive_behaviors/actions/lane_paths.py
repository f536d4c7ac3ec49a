"""Paths of lane changes that are handed to a driven vehicle."""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.api.actions import TransitionProfile
from eidrive_scenario.api.common import LaneLocation, Pose, RoadNetwork, Route

SPACING = 2.0
"""Spacing of the points of a path [m]."""


@dataclass(frozen=True)
class LanePath:
    """Line in which the offset from a lane changes by a transition and then keeps its target.

    points  (M, 3) [m]
    end     index of the first point with the target
    """

    points: NDArray[np.float64]
    end: int

    def errors(self, pose: Pose) -> tuple[float, bool]:
        """Return the distance of a pose from the line [m], and whether it is beyond the end of the transition."""
        apart = self.points[:, :2] - (pose.x, pose.y)
        nearest = int(np.argmin(np.einsum("ij,ij->i", apart, apart)))
        first = max(min(nearest, len(self.points) - 2), 0)
        along = self.points[first + 1, :2] - self.points[first, :2]
        length = math.hypot(*along.tolist())
        across = abs(float(along[0] * apart[first, 1] - along[1] * apart[first, 0])) / length
        return across, nearest >= self.end


def lane_path(
    roads: RoadNetwork,
    start: LaneLocation,
    transition: TransitionProfile,
    *,
    per_meter: float,
    heading: float,
    length: float,
    route: Route | None,
) -> LanePath | None:
    """Return the path from a location on the center of the target lane; None if the lane ends at once.

    transition  of the offset, positive to the left in driving direction [m]
    per_meter   progress of the transition per distance along the lane
    heading     of the vehicle [rad]; against it the path leads along the lane backwards
    length      of the path [m]
    """
    transition = copy.copy(transition)
    step = SPACING if math.cos(roads.pose(start).h - heading) >= 0.0 else -SPACING
    place: LaneLocation | None = start
    points: list[tuple[float, float, float]] = []
    end: int | None = None
    while place is not None and SPACING * len(points) <= length:
        end = len(points) if end is None and transition.done else end
        side = roads.driving_direction(place.road, place.lane)
        points.append(roads.pose(place._replace(offset=transition.value * side))[:3])
        transition.advance(SPACING * per_meter)
        place = roads.advance(place, step, route=route)
    if len(points) < 2:
        return None
    return LanePath(np.array(points), len(points) - 1 if end is None else end)
