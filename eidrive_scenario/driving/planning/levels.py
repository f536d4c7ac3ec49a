"""Heights of paths on roads above each other."""

from __future__ import annotations

import numpy as np

from eidrive_scenario.arrays import Array
from eidrive_scenario.driving.planning.path import PlannedPath
from eidrive_scenario.perception.traffic_lights import OTHER_LEVEL
from eidrive_scenario.roads import RoadNetwork

NEAR_PATH = 30.0
"""Maximum distance from a path within which its height determines the level of an object [m]."""
SAME_PLACE = 5.0
"""Difference of distances below which several points of a path are at an object [m], where a path passes below itself.
"""


def path_heights(path: PlannedPath, roads: RoadNetwork | None, z: float) -> Array | None:
    """Return the heights of the road at the points (M,) of a path [m]; None if all roads are level.

    Each point is on the road of the one before or on one that continues it, where roads cross above each other.

    z  height of the vehicle at the start of the path [m]
    """
    if path.heights is None and roads is not None and not roads.is_level:
        place, found = None, []
        for x, y in path.points.tolist():
            place = roads.locate_at(x, y, place, z, reach=5.0)
            z = z if place is None else roads.road_pose_at(place.road, place.s, place.t).z
            found.append(z)
        path.heights = np.array(found)
    return path.heights


def is_on_level(place: Array, points: Array, heights: Array) -> bool:
    """Return whether an object is on the level of a path (M, 2) with these heights (M,); True far from the path.

    place  x, y, and height of the lower side of the object [m]
    """
    gap = np.hypot(*(points - place[:2]).T)
    nearest = float(gap.min())
    there = heights[gap <= nearest + SAME_PLACE]
    return nearest > NEAR_PATH or bool(np.any(np.abs(there - place[2]) <= OTHER_LEVEL))
