"""State of a scripted actor: pose, speed, lane location and route."""

from __future__ import annotations

import math
from typing import NamedTuple

from eidrive_scenario.base.geometry import wrap_angle
from eidrive_scenario.base.tolerances import EPSILON
from eidrive_scenario.roads import BranchSelector, LaneLocation, Pose, RoadNetwork, Route

APART = 0.01
"""Maximum horizontal distance between a pose and its lane location [m]."""


class ResolvedPosition(NamedTuple):
    """Result of resolving a Position: the pose, and the lane location (None for free motion outside of lanes)."""

    pose: Pose
    location: LaneLocation | None = None


class MotionState:
    """State of one scripted actor. Attributes are read-only; `Motion` changes them."""

    def __init__(self, roads: RoadNetwork | None) -> None:
        self.roads = roads
        self._pose = Pose(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        self._location: LaneLocation | None = None
        self._heading = 0.0
        self._speed = 0.0
        self._backs = False
        self._sense = 1
        self._route: Route | None = None
        self._branch_selector: BranchSelector | None = None
        self._end_of_road = False
        self._teleported = False
        self._teleports = 0
        self._lift = 0.0
        self._rests = False

    @property
    def rests(self) -> bool:
        """Whether the last step had its pose and speed 0, and the next step keeps them, as nothing was requested."""
        return self._rests

    @property
    def pose(self) -> Pose:
        """Pose of the reference point."""
        return self._pose

    @property
    def location(self) -> LaneLocation | None:
        """Lane location that the actor follows; None outside of roads and during free motion."""
        return self._location

    @property
    def heading(self) -> float:
        """Angle to the driving direction of the lane [rad]; beyond ±90° the actor drives against it."""
        return self._heading

    @property
    def speed(self) -> float:
        """Speed that actions set [m/s]: along the heading, or along a trajectory with other headings."""
        return self._speed

    @property
    def speed_along_heading(self) -> float:
        """Speed along the heading [m/s], as views and frames have it."""
        return 0.0 - self._speed if self._backs else self._speed

    @property
    def sense(self) -> int:
        """Sense of the sign of the speed, 1 or -1: it is inverted at the end of a trajectory with other headings."""
        return self._sense

    @property
    def route(self) -> Route | None:
        """Route that selects the branches at junctions."""
        return self._route

    @property
    def end_of_road(self) -> bool:
        """Whether the actor has reached the end of its road."""
        return self._end_of_road

    @property
    def teleported(self) -> bool:
        """True from a teleport until the view that shows it."""
        return self._teleported

    @property
    def teleports(self) -> int:
        """Number of teleports so far."""
        return self._teleports

    @property
    def direction(self) -> int:
        """+1 if the actor points along the driving direction of its lane, otherwise -1."""
        return 1 if math.cos(self._heading) >= 0.0 else -1

    def _set_location(self, location: LaneLocation | None) -> None:
        """Set the lane location if it is at the pose of the actor, and not beyond the end of a road."""
        self._location, self._lift = None, 0.0
        if location is None or self.roads is None:
            return
        ground = self.roads.lane_pose_at(*location[:4])
        if math.hypot(ground.x - self._pose.x, ground.y - self._pose.y) > APART:
            return
        self._location, self._lift = location, self._pose.z - ground.z
        self._heading = self._heading_at(location, self._pose.h)

    def _heading_at(self, location: LaneLocation, yaw: float) -> float:
        assert self.roads is not None
        lane = self.roads.lane_pose_at(*location[:4]).h
        turn = wrap_angle(
            yaw - lane if self.roads.driving_direction(location.road, location.lane) > 0 else yaw - lane - math.pi
        )
        return 0.0 if abs(turn) < EPSILON else turn
