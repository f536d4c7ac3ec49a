"""Attributes of roads, lanes and signals of a map, without their geometry."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from eidrive_scenario.roads.geometry import poses
from eidrive_scenario.roads.model.location import LaneLocation, Pose
from eidrive_scenario.roads.model.road_map import (
    Header,
    Junction,
    Road,
    RoadMap,
    RoadObject,
    Signal,
    SignalController,
    SignalPlace,
)
from eidrive_scenario.roads.routing.movement import driving_direction


class RoadAttributes:
    """Roads, junctions, signals and objects of a map, with their attributes at a position."""

    def __init__(self, road_map: RoadMap) -> None:
        self.source = road_map.source
        self.header: Header = road_map.header
        self.roads: Mapping[str, Road] = road_map.roads
        self.junctions: Mapping[str, Junction] = road_map.junctions
        self.signals: Mapping[str, Signal] = road_map.signals
        self.controllers: Mapping[str, SignalController] = road_map.controllers
        self.objects: tuple[RoadObject, ...] = road_map.objects

    def road(self, road_id: str) -> Road:
        """Return the road with this id. Raise PositionError if it does not exist."""
        road = self.roads.get(road_id)
        if road is None:
            raise poses.unknown_road(road_id, list(self.roads))
        return road

    def driving_direction(self, road_id: str, lane_id: int) -> int:
        """Return +1 if traffic of the lane drives in the direction of s, else -1."""
        return driving_direction(self.road(road_id), lane_id)

    def lane_ids(self, road_id: str, s: float, *, drivable: bool = False) -> tuple[int, ...]:
        """Return the lane ids at s from left to right, without lane 0. With `drivable`, return only lanes for cars."""
        lanes = self.road(road_id).section_at(s).lanes
        return tuple(number for number, lane in lanes.items() if number and (lane.drivable or not drivable))

    def lane_width(self, road_id: str, lane_id: int, s: float) -> float:
        """Return the width of a lane at s [m]. Raise PositionError."""
        section, lane = poses.lane_at(self.road(road_id), lane_id, s)
        return lane.width.value(s - section.s)

    def lane_type(self, road_id: str, lane_id: int, s: float) -> str:
        """Return the type of a lane at s, a name of the standard. Raise PositionError."""
        return poses.lane_at(self.road(road_id), lane_id, s)[1].type

    def curvature(self, road_id: str, s: float) -> float:
        """Return the curvature of the reference line at s [1/m]; left is positive."""
        return self.road(road_id).reference.at(s).curvature

    def speed_limit(self, road_id: str, s: float, lane_id: int | None = None) -> float | None:
        """Return the speed limit at s [m/s]: that of the lane, else that of the road.

        A road without a limit gives inf. The result is None if the map states none.
        """
        road = self.road(road_id)
        if lane_id is not None:
            section, lane = poses.lane_at(road, lane_id, s)
            own = [limit for start, limit in lane.speeds if start <= s - section.s + 1e-9]
            if own:
                return own[-1]
        kinds = [kind for kind in road.types if kind.s <= s + 1e-9]
        return kinds[-1].speed if kinds else None

    def on_road(self, location: LaneLocation) -> bool:
        """Return True if the location is within the width of its lane."""
        width = self.lane_width(location.road, location.lane, location.s)
        return abs(location.offset) <= 0.5 * width

    def signal_pose(self, signal: Signal, place: SignalPlace | None = None) -> Pose:
        """Return the pose of a signal. Its face is turned against the traffic for which it is valid."""
        position = place or signal.place
        pose = poses.road_pose_at(self.road(position.road), position.s, position.t)
        turn = 0.0 if position.orientation == "-" else np.pi
        return pose._replace(z=pose.z + signal.z_offset).turned(turn + signal.h_offset)
