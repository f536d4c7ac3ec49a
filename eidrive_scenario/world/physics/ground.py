"""Road surface below a driven vehicle."""

from __future__ import annotations

from eidrive_scenario.roads import LaneLocation, RoadNetwork


class GroundUnder:
    """Height and slope of the ground below one vehicle, with the lane of its last position."""

    def __init__(self, roads: RoadNetwork | None, height: float = 0.0) -> None:
        self._roads = roads
        self._last: LaneLocation | None = None
        self._height = height

    def at(self, x: float, y: float, yaw: float) -> tuple[float, float, float]:
        """Return height z [m], pitch and roll [rad] of a body at x, y with that heading.

        Outside the road the ground is level at the height at which the vehicle left the road.
        """
        if self._roads is None:
            return self._height, 0.0, 0.0
        self._last = self._roads.locate_at(x, y, self._last)
        if self._last is None:
            return self._height, 0.0, 0.0
        pose = self._roads.road_pose_at(self._last.road, self._last.s, self._last.t)
        pose = pose.turned(yaw - pose.h)
        self._height = pose.z
        return pose.z, pose.p, pose.r


def is_level(roads: RoadNetwork | None) -> bool:
    """Return whether all roads are in the plane z = 0."""
    return roads is None or roads.is_level
