"""Attributes of roads, lanes and signals of a map, without their geometry."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from eidrive_scenario.roads.geometry import poses
from eidrive_scenario.roads.model.location import LaneKey, LaneLocation, Pose
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
from eidrive_scenario.roads.routing.graph import assumed_speed
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
        road = self.roads.get(road_id) or self.road(road_id)
        return road.directions.get(lane_id) or driving_direction(road, lane_id)

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

    def usual_speed(self, key: LaneKey) -> float:
        """Return the speed of traffic that is assumed in the middle of a lane by its speed limit [m/s]."""
        section = self.road(key.road).sections[key.section]
        return assumed_speed(self.speed_limit(key.road, 0.5 * (section.s + section.end), key.lane))

    def on_road(self, location: LaneLocation) -> bool:
        """Return True if the location is within the width of its lane."""
        width = self.lane_width(location.road, location.lane, location.s)
        return abs(location.offset) <= 0.5 * width

    def signal_lanes(self, place: SignalPlace) -> tuple[int, ...]:
        """Return the drivable lanes for which a signal at this place is valid, from left to right.

        They are those of its validity that drive in the direction of its orientation. If there is none, the orientation
        is ignored: CARLA's maps state validity for lanes of the opposite direction.
        """
        road = self.roads.get(place.road)
        if road is None:
            return ()
        numbers = [
            number
            for number in self.lane_ids(place.road, place.s, drivable=True)
            if not place.validity or any(min(pair) <= number <= max(pair) for pair in place.validity)
        ]
        facing = {"+": 1, "-": -1}.get(place.orientation, 0)
        met = [number for number in numbers if facing != -driving_direction(road, number)]
        return tuple(met or (numbers if place.validity else ()))

    def signal_pose(self, signal: Signal, place: SignalPlace | None = None) -> Pose:
        """Return the pose of a signal. Its face is turned against the traffic for which it is valid.

        Orientation and heading determine it, unless the signal is valid by references only and would face away from all
        their lanes, as in CARLA's maps.
        """
        position = place or signal.place
        pose = poses.road_pose_at(self.road(position.road), position.s, position.t)
        turn = 0.0 if position.orientation == "-" else np.pi
        pose = pose._replace(z=pose.z + signal.z_offset).turned(turn + signal.h_offset)
        return pose.turned(np.pi) if self._faces_away(signal, pose) else pose

    def _faces_away(self, signal: Signal, pose: Pose) -> bool:
        if not signal.references or self.signal_lanes(signal.place):
            return False
        ways = [
            poses.lane_pose_at(self.road(reference.road), number, reference.s).h
            + (0.0 if self.driving_direction(reference.road, number) > 0 else np.pi)
            for reference in signal.references
            for number in self.signal_lanes(reference)
        ]
        return bool(ways) and min(np.cos(pose.h - way) for way in ways) > np.cos(np.pi / 4.0)
