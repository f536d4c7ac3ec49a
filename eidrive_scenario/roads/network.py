"""Road network: interface to the roads of one OpenDRIVE file."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import cached_property, lru_cache, partial
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from eidrive_scenario.base.arrays import Array, Integers
from eidrive_scenario.base.geometry import wrap_angle
from eidrive_scenario.base.tolerances import EPSILON
from eidrive_scenario.errors import Diagnostic, suggestion
from eidrive_scenario.files.bounded import path_argument
from eidrive_scenario.roads.geometry import poses
from eidrive_scenario.roads.geometry.locator import REACH, Locator
from eidrive_scenario.roads.geometry.tables import RoadTables
from eidrive_scenario.roads.georeference import GeoReference, parse_geo_reference
from eidrive_scenario.roads.map_checks import check_road_map, missing_lane_link
from eidrive_scenario.roads.model.location import LaneKey, LaneLocation, LaneLocations, Pose, Poses, PositionError
from eidrive_scenario.roads.model.map_warnings import group_map_warnings
from eidrive_scenario.roads.model.road_map import Junction, Lane, Road, RoadMap, Signal, SignalController, SignalPlace
from eidrive_scenario.roads.reading import parse_road_map, read_road_text
from eidrive_scenario.roads.routing.distance import Chain, RoadDistances, locate_near
from eidrive_scenario.roads.routing.graph import (
    Cost,
    LaneWays,
    RouteError,
    build_ways,
    find_lanes,
    lane_key,
)
from eidrive_scenario.roads.routing.links import LaneLinks, lanes_between
from eidrive_scenario.roads.routing.movement import Movement, default_rank
from eidrive_scenario.roads.routing.route import BranchSelector, Route, concatenate_routes

if TYPE_CHECKING:
    from eidrive_scenario.roads.routing.graph import LaneGraph


FREE_SPEED = 130.0 / 3.6
"""Usual speed where the speed is not limited [m/s]: the recommended one on German motorways."""
USUAL_SPEED = 50.0 / 3.6
USUAL_SPEEDS = {"motorway": FREE_SPEED, "rural": 100.0 / 3.6, "lowSpeed": 30.0 / 3.6}
"""Usual speeds on roads of a type, and on others, without a stated limit [m/s]: the general limits in Germany."""
MOST_ITERATIONS = 10
"""Maximum number of iterations for a distance along a lane; one suffices where its curvature is constant."""
KEPT = 2
"""Maximum number of road networks that are kept for the next run."""
OTHER_LEVEL = 3.5
"""Difference of height from which on a road user is on another level than a road, such as a bridge [m]: less than the
clearance of bridges, 4.5 m, by an error of 1 m."""
ALIGNED = 0.6
"""Maximum angle between the headings of a vehicle and of the lane that it follows [rad]."""
FRONT = 4.0
"""Distance from the reference point of a car to its front, about [m]: an angle to a lane counts as its deviation."""
LEAST_GAIN = 0.5
"""Minimum difference of deviations from two lanes for which a road user is not on the lane where it was before [m]."""


class RoadNetwork:
    """Roads, lanes, junctions, signals and objects of one OpenDRIVE file, with their geometry.

    Coordinates follow the standard: s along the reference line, t to its left, lane ids positive to the left.
    """

    def __init__(self, road_map: RoadMap) -> None:
        self.source = road_map.source
        self.header = road_map.header
        self.roads: Mapping[str, Road] = road_map.roads
        self.junctions: Mapping[str, Junction] = road_map.junctions
        self.signals: Mapping[str, Signal] = road_map.signals
        self.controllers: Mapping[str, SignalController] = road_map.controllers
        self.objects = road_map.objects
        self._reading_warnings = road_map.map_warnings
        self.links = LaneLinks(road_map)
        self.movement = Movement(self.roads, self.links)
        self._distances = RoadDistances(self.roads, self.links, self._usual_speed_on)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> RoadNetwork:
        """Return the network of an OpenDRIVE file. Raise RoadError with all diagnostics.

        A network is immutable. Runs share it, including cached results, while the content of the file is unchanged.
        """
        location = path_argument(path, "path")
        return _loaded(read_road_text(location), str(location))

    @classmethod
    def parse(cls, text: str | bytes, source: str = "<memory>") -> RoadNetwork:
        """Return the network of an OpenDRIVE text. Raise RoadError."""
        return cls(parse_road_map(text.encode() if isinstance(text, str) else text, source))

    @cached_property
    def map_warnings(self) -> tuple[Diagnostic, ...]:
        """Warnings of the file, which is readable nevertheless: one diagnostic per kind, with its rule."""
        warnings = [*self._reading_warnings, *check_road_map(self.roads, self.junctions, self.links)]
        return group_map_warnings(warnings, self.source)

    @cached_property
    def tables(self) -> RoadTables:
        """Roads as flat arrays."""
        return RoadTables(list(self.roads.values()))

    @cached_property
    def graph(self) -> LaneGraph:
        """Lanes as a directed graph over LaneKey(road, section, lane), with the data of `LaneWays`."""
        return self._ways.as_graph()

    @cached_property
    def _ways(self) -> LaneWays:
        return build_ways(self.tables, self.links)

    @cached_property
    def geo_reference(self) -> GeoReference:
        """Geodetic reference of the map. Raise PositionError if the file omits it or if it is invalid."""
        text = self.header.geo_reference
        if not text:
            hint = "add <geoReference> to its <header>"
            raise PositionError(Diagnostic("the road network has no geoReference", hint, self.source))
        with self._geo_reference_errors():
            return parse_geo_reference(text)

    @cached_property
    def is_level(self) -> bool:
        """Whether all roads are in the plane z = 0."""
        return all(road.elevation.is_zero and road.superelevation.is_zero for road in self.roads.values())

    @cached_property
    def is_flat(self) -> bool:
        """Whether all roads are in the plane z = 0, with all their lanes, such as sidewalks."""
        sections = (section for road in self.roads.values() for section in road.sections)
        return self.is_level and not any(lane.heights for section in sections for lane in section.lanes.values())

    @cached_property
    def _locator(self) -> Locator:
        return Locator(self.tables)

    @contextmanager
    def _geo_reference_errors(self) -> Iterator[None]:
        """Report errors of the geodetic reference with its line."""
        try:
            yield
        except ValueError as error:
            hint = "write <geoReference> as a PROJ string, such as +proj=utm +zone=32 +datum=WGS84"
            raise PositionError(Diagnostic(str(error), hint, self.source, self.header.geo_reference_line)) from error

    # Attributes at a position

    def road(self, road_id: str) -> Road:
        """Return the road with this id. Raise PositionError if it does not exist."""
        road = self.roads.get(road_id)
        if road is None:
            raise PositionError(Diagnostic(f"road {road_id!r} does not exist", suggestion(road_id, self.roads)))
        return road

    def driving_direction(self, road_id: str, lane_id: int) -> int:
        """Return +1 if traffic of the lane drives in the direction of s, else -1."""
        return self.road(road_id).driving_direction(lane_id)

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
        kind = road.type_at(s)
        return None if kind is None else kind.speed

    def usual_speed(self, road_id: str, s: float, lane_id: int | None = None) -> float:
        """Return the usual speed of traffic at s [m/s]: the limit, else that on roads of this type."""
        limit = self.speed_limit(road_id, s, lane_id)
        if limit:
            return min(limit, FREE_SPEED)
        kind = self.road(road_id).type_at(s)
        return USUAL_SPEED if kind is None else USUAL_SPEEDS.get(kind.type, USUAL_SPEED)

    def usual_speed_in(self, key: LaneKey) -> float:
        """Return the usual speed of traffic in the middle of a lane [m/s]."""
        section = self.road(key.road).sections[key.section]
        return self.usual_speed(key.road, 0.5 * (section.s + section.end), key.lane)

    def on_road(self, location: LaneLocation) -> bool:
        """Return True if the location is within the width of its lane."""
        width = self.lane_width(location.road, location.lane, location.s)
        return abs(location.offset) <= 0.5 * width

    def entry_lane(self, lane: LaneKey) -> LaneKey | None:
        """Return the lane at the start of a road, in driving direction, that leads to a lane of it; if none does, the
        nearest drivable one in number, or None."""
        road = self.roads[lane.road]
        first = road.sections[0 if self.driving_direction(lane.road, lane.lane) > 0 else -1]
        number = self.links.continued(lane, lane.road, first.index)
        if number is None:
            drivable = [other.id for other in first.lanes.values() if other.id and other.drivable]
            number = min(drivable, key=lambda other: abs(other - lane.lane), default=None)
        return None if number is None else LaneKey(lane.road, first.index, number)

    def alternatives(self, lane: LaneKey) -> frozenset[LaneKey]:
        """Return the drivable lanes at the start of connecting roads that continue the same lane as one of them, which
        is among them; empty if the map links none."""
        against = -self.driving_direction(lane.road, lane.lane)
        return frozenset(
            alternative
            for incoming, backwards in self.links.beyond(lane, against)
            for alternative, onwards in self.links.beyond(incoming, -backwards)
            if onwards == self.driving_direction(alternative.road, alternative.lane)
            and self.roads[alternative.road].sections[alternative.section].lanes[alternative.lane].drivable
        )

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
        met = [number for number in numbers if facing != -road.driving_direction(number)]
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

    # Road and lane coordinates to world coordinates

    def geodetic(self, x: float, y: float) -> tuple[float, float]:
        """Return latitude and longitude in WGS 84 [rad] of a point of the map [m], the inverse of `geographic`.

        Raise PositionError if the map has no geographic reference, or if it is undefined there.
        """
        reference = self.geo_reference
        dx, dy, _, turn = self.header.offset
        cos, sin = math.cos(turn), math.sin(turn)
        with self._geo_reference_errors():
            return reference.geodetic(x * cos - y * sin + dx, x * sin + y * cos + dy)

    def geographic(self, latitude: float, longitude: float) -> tuple[float, float]:
        """Return x and y [m] of a point in WGS 84 [rad]. Raise PositionError if the map has no position for it."""
        reference = self.geo_reference
        with self._geo_reference_errors():
            x, y = reference.plane(latitude, longitude)
        dx, dy, _, turn = self.header.offset
        x, y, cos, sin = x - dx, y - dy, math.cos(turn), math.sin(turn)
        return x * cos + y * sin, y * cos - x * sin

    def road_pose_at(self, road_id: str, s: float, t: float = 0.0) -> Pose:
        """Return the pose at road coordinates with the heading of the reference line. Raise PositionError."""
        return poses.road_pose_at(self.road(road_id), s, t)

    def lane_pose_at(self, road_id: str, lane_id: int, s: float, offset: float = 0.0) -> Pose:
        """Return the pose at the center line of a lane plus `offset`, with the heading of the lane along s.

        Raise PositionError if the lane does not exist at s.
        """
        return poses.lane_pose_at(self.road(road_id), lane_id, s, offset)

    def centers(self, places: Sequence[LaneLocation]) -> Array:
        """Return points (N, 3) of the center lines of lanes at the s of `places` [m]. Offsets are ignored."""
        tables = self.tables
        road = np.array([tables.index[location.road] for location in places], dtype=np.int64)
        s = np.array([location.s for location in places])
        lane = tables.lane_row(road, s, np.array([location.lane for location in places], dtype=np.int64))
        return np.column_stack(tables.lane_poses(lane, s, np.zeros(len(s)))[:3])

    def pose(self, location: LaneLocation) -> Pose:
        """Return the pose at a lane location with the heading of the driving direction of the lane."""
        road = self.road(location.road)
        pose = poses.lane_pose_at(road, location.lane, location.s, location.offset)
        return pose if road.driving_direction(location.lane) > 0 else pose.turned(np.pi)

    def laid(self, pose: Pose, location: LaneLocation) -> Pose:
        """Return a pose with the height, pitch and roll of the surface at a location."""
        surface = self.pose(location)
        level = surface.turned(wrap_angle(pose.h - surface.h))
        return pose._replace(z=surface.z, p=level.p, r=level.r)

    def road_pose(self, road_id: str, s: ArrayLike, t: ArrayLike = 0.0) -> Poses:
        """Return `road_pose_at` for broadcast arrays. Raise PositionError."""
        self.road(road_id)
        s, t = np.broadcast_arrays(np.asarray(s, dtype=np.float64), np.asarray(t, dtype=np.float64))
        road = np.full(s.size, self.tables.index[road_id])
        self.tables.check(road, s.ravel())
        columns = self.tables.road_poses(road, s.ravel(), t.ravel())
        return Poses(*(part.reshape(s.shape) for part in columns))

    def lane_pose(self, road_id: str, lane_id: ArrayLike, s: ArrayLike, offset: ArrayLike = 0.0) -> Poses:
        """Return `lane_pose_at` for broadcast arrays. Raise PositionError."""
        self.road(road_id)
        lane, s, offset = np.broadcast_arrays(
            np.asarray(lane_id, dtype=np.int64),
            np.asarray(s, dtype=np.float64),
            np.asarray(offset, dtype=np.float64),
        )
        road, flat = np.full(s.size, self.tables.index[road_id]), s.ravel()
        self.tables.check(road, flat)
        columns = self.tables.lane_poses(self.tables.lane_row(road, flat, lane.ravel()), flat, offset.ravel())
        return Poses(*(part.reshape(s.shape) for part in columns))

    # World coordinates to road and lane coordinates

    def locate(self, x: ArrayLike, y: ArrayLike, z: ArrayLike | None = None, reach: float = REACH) -> LaneLocations:
        """Return lane locations of points (N,). With roads above each other, z selects the road."""
        px, py = np.atleast_1d(np.asarray(x, dtype=np.float64)), np.atleast_1d(np.asarray(y, dtype=np.float64))
        pz = None if z is None else np.atleast_1d(np.asarray(z, dtype=np.float64))
        return self._locator.locate(px, py, pz, reach)

    def overlapped_lanes(self, x: Array, y: Array, z: Array | None = None) -> tuple[Integers, Array, Integers]:
        """Return all lanes that overlap points (N,): lane rows of `tables`, s on their roads, and indices of the
        points.

        Outside junctions there is at most one lane per point. In a junction there is one for each connecting road.
        """
        return self._locator.overlapped_lanes(x, y, z)

    def lane_gap(self, x: float, y: float, z: float, lanes: Integers, within: float) -> float:
        """Return the distance in plan view of a point from the nearest of some lanes on its level [m]; 0 on it.

        lanes   rows of `tables`
        within  distance up to which lanes are searched [m]; without any the result is inf
        """
        gaps, heights = self._locator.lane_gaps(x, y, lanes, within)
        return float(gaps[np.abs(heights - z) <= OTHER_LEVEL].min(initial=np.inf))

    def locate_at(
        self, x: float, y: float, hint: LaneLocation | None = None, z: float | None = None, reach: float = REACH
    ) -> LaneLocation | None:
        """Return the lane location of a point, or None if no road is within `reach` [m].

        With a previous location as `hint`, that road and its successors and predecessors have priority if the point is
        on one of their lanes. A road user that crosses a junction thus remains on its connecting road. Of other roads
        that overlap in a junction, the location is on that of the nearest lane center, or of the default route if they
        coincide.
        """
        if hint is not None and hint.road in self.roads:
            near = locate_near(self.roads, self.links, self.movement, x, y, hint)
            if near is not None:
                return near
        heights = None if z is None else np.array([z])
        nearest = self._locator.locate(np.array([x]), np.array([y]), heights, reach).location(0)
        junction = None if nearest is None else self.roads[nearest.road].junction_id
        if junction is None:
            return nearest
        overlapping = (place for place in self.locations_at(x, y, z) if self.roads[place.road].junction_id == junction)
        return min(overlapping, key=lambda place: (*self._rank(place, abs(place.offset)), place[:2]), default=nearest)

    def locations_at(self, x: float, y: float, z: float | None = None) -> list[LaneLocation]:
        """Return the locations on all roads that overlap a point in plan view, on all levels or on that of `z` [m]."""
        columns = (column.tolist() for column in self._locator.roads_at(x, y))
        locations = [self.road_location(self.tables.ids[road], s, t) for road, s, t in zip(*columns, strict=True)]
        return locations if z is None else [location for location in locations if self.is_on_level(location, z)]

    def locate_pose(
        self,
        x: float,
        y: float,
        heading: float | None,
        z: float | None = None,
        hint: LaneLocation | None = None,
        *,
        drivable: bool = False,
    ) -> LaneLocation | None:
        """Return the lane location of a road user, or None if no road is within reach.

        Where lanes overlap, in a junction or on and below a bridge, it is on the lane at the height z [m], if given,
        that best fits the heading and has the nearest center, or on that of `hint` if it fits as well. If no lane leads
        in its direction, the location is that of `locate_at`.

        heading   its direction [rad], if given
        drivable  prefer lanes for vehicles where lanes overlap
        """
        nearest = self.locate_at(x, y, hint)
        if nearest is None:
            return None

        def angle(location: LaneLocation) -> float:
            return 0.0 if heading is None else self.angle_to_lane(location, heading)

        def deviation(location: LaneLocation) -> float:
            return abs(location.offset) + FRONT * angle(location)

        is_on_level = z is None or self.is_on_level(nearest, z)
        is_alone = self.road(nearest.road).junction_id is None and (self.is_level or z is not None)
        is_same = hint is not None and hint.road == nearest.road
        if is_on_level and (is_alone or (is_same and deviation(nearest) <= LEAST_GAIN)):
            return nearest
        below = self.locations_at(x, y, z)
        if not is_on_level:
            nearest = min(below, key=deviation) if below else self.locate_at(x, y, z=z) or nearest
        if len(below) < 2:
            return nearest
        if drivable:
            below = [location for location in below if self.lane(location).drivable] or below
        aligned = [location for location in below if angle(location) <= ALIGNED]
        best = min(aligned, key=lambda location: self._rank(location, deviation(location)), default=nearest)
        stays = is_same and deviation(nearest) <= deviation(best) + LEAST_GAIN
        return nearest if stays or best[:2] == nearest[:2] else best

    def _rank(self, location: LaneLocation, deviation: float) -> tuple[float, float]:
        """Return the rank among overlapping lanes by the deviation from them [m]. Lanes that part later coincide at
        first: then as on the default route."""
        road = self.road(location.road)
        turn = wrap_angle(road.reference.at(road.length).h - road.reference.at(0.0).h)
        return round(deviation, 3), default_rank(turn * road.driving_direction(location.lane), road)

    def lane(self, location: LaneLocation) -> Lane:
        """Return the lane of a location. Raise PositionError."""
        return poses.lane_at(self.road(location.road), location.lane, location.s)[1]

    def is_on_level(self, location: LaneLocation, z: float) -> bool:
        """Return whether a road user at height z [m] is on the level of a road, not above or below it."""
        return self.is_level or abs(self.road_pose_at(location.road, location.s, location.t).z - z) <= OTHER_LEVEL

    def angle_to_lane(self, location: LaneLocation, heading: float) -> float:
        """Return the angle between a heading and the driving direction of a lane [rad]."""
        along = self.lane_pose_at(location.road, location.lane, location.s).h
        against = self.driving_direction(location.road, location.lane) < 0
        return abs(wrap_angle(heading - along - (math.pi if against else 0.0)))

    def location(self, road_id: str, lane_id: int, s: float, offset: float = 0.0) -> LaneLocation:
        """Return the lane location with these coordinates, including its t. Raise PositionError."""
        road = self.road(road_id)
        section, lane = poses.lane_at(road, lane_id, s)
        return LaneLocation(road_id, lane_id, s, offset, poses.lane_t(road, section, lane, s)[0] + offset)

    def road_location(self, road_id: str, s: float, t: float) -> LaneLocation:
        """Return the lane location of road coordinates. Outside the road it refers to the outermost lane.

        Raise PositionError if s is outside the road.
        """
        road = self.road(road_id)
        if not -poses.BEYOND <= s <= road.length + poses.BEYOND:
            raise poses.off_road(road, s)
        section, lane, _ = poses.lane_beside(road, s, t)
        return LaneLocation(road_id, lane.id, s, t - poses.lane_t(road, section, lane, s)[0], t)

    # Movement

    def advance(
        self,
        location: LaneLocation,
        distance: float,
        *,
        route: Route | None = None,
        choose: BranchSelector | None = None,
        visit: int = 0,
        to_end: bool = False,
        by_reference_line: bool = False,
    ) -> LaneLocation | None:
        """Return the location `distance` [m] further along the lane in its driving direction (backwards if negative).

        The path passes links and junctions. At a fork the branch is selected by the route, else by `choose(branches)`,
        else it is that of the default route. If the lane ends, the result is None, or its end with `to_end`. `visit`
        is the visit of the route (`Route.visit`), which may pass a road several times. The distance is measured along
        the lane, or along the reference lines.
        """
        end = self.movement.travel(location, distance, route, choose, visit, to_end, by_reference_line)
        return None if end is None else end[0]

    def route(
        self,
        start: LaneLocation,
        end: LaneLocation,
        via: Sequence[LaneLocation] = (),
        costs: Sequence[Cost | None] | None = None,
        *,
        against_traffic: bool = False,
    ) -> Route:
        """Return the cheapest route over lanes from start to end. Raise RouteError if there is none.

        With `against_traffic` it leads against the driving direction of the lanes. A route over two-way lanes only may
        have either direction. `costs` holds one cost function for each leg: to each location of `via`, and to the end.
        None means the length, which is also the default.
        """
        stops = [start, *via, end]
        wanted = costs if costs is not None else [None] * (len(stops) - 1)
        parts = [
            self._find_route(a, b, cost, against_traffic=against_traffic)
            for (a, b), cost in zip(pairwise(stops), wanted, strict=True)
        ]
        return parts[0] if len(parts) == 1 else concatenate_routes(parts)

    def _find_route(self, a: LaneLocation, b: LaneLocation, cost: Cost | None, *, against_traffic: bool) -> Route:
        """Return the cheapest route of the given direction, or one of the other direction over two-way lanes only."""

        def route(find: Callable[..., tuple[LaneKey, ...]], *, against_traffic: bool) -> Route:
            lanes = find(b, a, cost)[::-1] if against_traffic else find(a, b, cost)
            return Route(self.tables, lanes, a, b, against_traffic=against_traffic)

        try:
            return route(self._find_lanes, against_traffic=against_traffic)
        except RouteError:
            if not (self.lane(a).is_two_way and self.lane(b).is_two_way):
                raise
            with suppress(RouteError):
                other = route(partial(find_lanes, self._ways, self.roads), against_traffic=not against_traffic)
                sections = [(self.roads[key.road].sections[key.section], key.lane) for key in other.lanes]
                if all(section.lanes[lane].is_two_way for section, lane in sections):
                    return other
            raise

    def _find_lanes(self, start: LaneLocation, end: LaneLocation, cost: Cost | None) -> tuple[LaneKey, ...]:
        """Return the lanes of the cheapest route. Raise RouteError; if the file lacks a link for it, with its rule."""
        try:
            return find_lanes(self._ways, self.roads, start, end, cost)
        except RouteError as error:
            ends = lane_key(self.roads, start), lane_key(self.roads, end)
            missing = missing_lane_link(self.roads, self.links, self._ways, *ends)
            if missing is None:
                raise
            (diagnostic,) = error.diagnostics
            message = f"{diagnostic.message} ({self.source}:{missing.line}: {missing.message})"
            named = replace(diagnostic, message=message, hint=missing.hint, rule=missing.rule.id)
            raise RouteError(named) from None

    def distance(
        self,
        a: LaneLocation,
        b: LaneLocation,
        by: Chain = "shortest",
        route: Route | None = None,
        sense: int = 0,
        *,
        along_lane: bool = False,
    ) -> tuple[float, float] | None:
        """Return the distances from a to b ahead and to the left [m] in road coordinates, or None.

        They refer to the driving direction of the lane of a, and are negative for behind and right. They are measured
        along the reference lines of connected roads, with `sense` 1 ahead only and -1 behind only, or along `route`;
        with `along_lane` along the center of the lane of a, unless this ends before b. The result is None if the roads
        are not connected or the route misses a location.
        """
        distances = self._distances.between(a, b, by, sense) if route is None else route.distance(a, b)
        if not along_lane or distances is None:
            return distances
        ahead, left = distances
        length, center = ahead, a._replace(offset=0.0)
        for _ in range(MOST_ITERATIONS):
            there = self.advance(center, length, route=route)
            rest = None if there is None else self.distance(there, b)
            if rest is None or abs(rest[0]) >= abs(ahead):
                break
            if abs(rest[0]) < EPSILON:
                return length, left
            length *= ahead / (ahead - rest[0])
        return distances

    def orientation(self, a: LaneLocation, b: LaneLocation) -> int | None:
        """Return +1 if s of the road of b increases in the direction of s of the road of a along the chain, else -1.

        The result is None if no chain of roads connects them.
        """
        relation = self._distances.placed(a, b)
        return None if relation is None else relation[2]

    def lanes_between(self, a: LaneLocation, b: LaneLocation) -> int | None:
        """Return the number of lanes from the lane of a to that of b, positive in the direction of t at a, or None.

        Lanes are followed along their links, as their numbers may change.
        """
        runs = self.orientation(a, b)
        return None if runs is None else lanes_between(self.roads, self.links, a, b, runs)

    def _usual_speed_on(self, road: str) -> float:
        return self.usual_speed(road, 0.5 * self.road(road).length)

    def bounds(self) -> tuple[float, float, float, float]:
        """Return the bounding rectangle of all lane centers: minimum x and y, maximum x and y [m]; 0 without lanes."""
        points: Array = self._locator.sample_points
        if not len(points):
            return 0.0, 0.0, 0.0, 0.0
        low, high = points.min(axis=0), points.max(axis=0)
        return float(low[0]), float(low[1]), float(high[0]), float(high[1])


@lru_cache(maxsize=KEPT)
def _loaded(text: bytes, source: str) -> RoadNetwork:
    return RoadNetwork(parse_road_map(text, source))
