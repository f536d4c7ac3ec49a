"""Interface of planners, and the planner along a route, which ignores objects."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.coverage import PerceptionRegion, ViewSector
from eidrive_scenario.base.detections import Detections
from eidrive_scenario.base.geometry import distances_along
from eidrive_scenario.base.requests import ASTRAY, LONGEST_WAY, Goal
from eidrive_scenario.driving.planner_settings import PlannerSettings
from eidrive_scenario.driving.planning.path import (
    SPACING,
    PathPart,
    PlannedPath,
    path_heights,
)
from eidrive_scenario.driving.planning.signal_stops import CanReadLight, SignalStops, StopPoint
from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.driving.step import Plan
from eidrive_scenario.errors import Diagnostic
from eidrive_scenario.extensions.settings import parse_settings
from eidrive_scenario.roads import USUAL_SPEED, LaneLocation, RoadNetwork, RouteError, lanes_near, select_lanes
from eidrive_scenario.sensing.readings import EgoState, SignalReading
from eidrive_scenario.world.actor import ActorSpec


class Planner(ABC):
    """Planner of one station: a trajectory in every tick. Built once for each station and run.

    A class is registered in the entry points `eidrive_scenario.planners`. It is built as
    `cls(settings, spec, roads, dt=…, seed=…)`. Its inputs are those of its station only.
    """

    settings_type: ClassVar[type[PlannerSettings]] = PlannerSettings
    """Type of the settings that the controller may give the planner, each as a property of its name or in the property
    `planner_settings`."""
    planner_settings: PlannerSettings
    view: tuple[ViewSector, ...] | None = None
    """Sectors around the vehicle in which its detector can detect objects; None: in all directions."""
    can_read_light: CanReadLight | None = None
    """As `Detector.can_read_light`; None: the vehicle has all lights in view up to their stop lines."""
    observes_regions: bool = False
    """Whether the planner uses the perception regions, which are determined only then."""

    def __init__(
        self, settings: AgentSettings, spec: ActorSpec, roads: RoadNetwork | None, *, dt: float, seed: int
    ) -> None:
        own = settings.planner_settings
        if not isinstance(own, self.settings_type):
            own = parse_settings(self.settings_type, own.model_dump(exclude_unset=True))
        self.settings = settings
        self.planner_settings = own
        self.spec = spec
        self.roads = roads
        self.dt = dt
        self.seed = seed

    def observe_signals(self, signals: Sequence[SignalReading]) -> None:  # noqa: B027 - for planners that know signals
        """Receive the visible traffic lights and stop signs; called before `plan` if the station obeys signals."""

    def observe_regions(self, regions: Sequence[PerceptionRegion]) -> None:  # noqa: B027 - for planners that use them
        """Receive the newest perception region of the own sensors and of each sender of CPMs; called before `plan`."""

    @abstractmethod
    def plan(self, ego: EgoState, objects: Detections, goal: Goal | None, now: float) -> Plan:
        """Return the trajectory from the ego pose at `now` [s]. `goal` is the request of the scenario, or None."""


HORIZON = 60
"""Number of points of a plan ahead of the vehicle."""
LOOK_AHEAD = 300
"""Number of lane points that are computed in advance without a destination."""
STRIDE = 10
"""Number of lane points that are computed in one step on a continuous lane."""
TURNS = 50.0
"""Maximum length of a road that may lead into itself within a stride [m]."""
BEYOND = 100.0
"""Distance beyond the end of the road within which a vehicle still stops for it [m]; farther away it was teleported."""
BEHIND = 5
"""Number of points behind the vehicle that are kept when the path is extended."""


class RoutePlanner(Planner):
    """Planner along the path of the goal, or on the shortest route through its waypoints, to a stop at the end.

    A lap after the path is repeated. Without path and waypoints the planner follows its lane, at most to the end of the
    road. Outside roads, waypoints are connected by a smooth curve. Objects are ignored. With `obey_signals` the vehicle
    stops at red lights and stop signs in sight. Raise RouteError if no road leads to a waypoint, or if the way is too
    long.
    """

    max_lateral_offset: ClassVar[float] = 2.5
    """Distance from the followed lane above which the vehicle was teleported, and its lane is located again [m]."""

    def __init__(
        self, settings: AgentSettings, spec: ActorSpec, roads: RoadNetwork | None, *, dt: float, seed: int
    ) -> None:
        super().__init__(settings, spec, roads, dt=dt, seed=seed)
        self._path: PlannedPath | None = None
        self._goal: Goal | None = None
        self._way: tuple[Array | None, Array | None, Array | None] = (None, None, None)
        self._progress = 0
        self._lane: list[LaneLocation] = []
        self._sense = 1
        """-1 while the lane ahead is a two-way lane against its usual direction, else 1."""
        self._first_speed: float | None = None
        self._stops = SignalStops(roads, spec) if settings.obey_signals else None
        self._path_of_stops: PlannedPath | None = None
        self._location: LaneLocation | None = None

    def observe_signals(self, signals: Sequence[SignalReading]) -> None:
        if self._stops is not None:
            self._stops.signals.update(signals)

    def plan(self, ego: EgoState, objects: Detections, goal: Goal | None, now: float) -> Plan:
        x, y, _ = ego.position.tolist()
        path = self._advanced_path(ego, goal)
        part = slice(self._progress, self._progress + HORIZON)
        target = self._target_speed(ego, goal)
        speeds = np.minimum(path.limits[part], target)
        free = bool(speeds[0] >= target)
        reason = "keep speed" if free else "curve or end of route ahead"
        stop = self._stop(path, ego, x, y, now)
        if stop is not None and self._stops is not None:
            held = self._stops.limits(stop, part)
            if np.any(held < speeds):
                speeds, free, reason = np.minimum(speeds, held), False, stop.reason
        acceleration = goal.acceleration if goal is not None and free else 0.0
        return Plan(path.points[part], speeds, reason, acceleration)

    def path_ahead(self, ego: EgoState, goal: Goal | None) -> PathPart:
        """Return the path of `plan` without its speeds; the first segment is that at the vehicle."""
        return self._advanced_path(ego, goal).part(self._progress, HORIZON)

    def _advanced_path(self, ego: EgoState, goal: Goal | None) -> PlannedPath:
        """Return the path of the goal after setting the progress of the vehicle on it; extended where it continues."""
        x, y, _ = ego.position.tolist()
        path = self._current_path(ego, goal)
        self._progress = path.project(x, y, self._progress)
        if goal is not None and goal.follows_route and path.distance(x, y, self._progress) > ASTRAY:
            self._progress = path.project(x, y, max(path.nearest(x, y, ego.yaw) - 1, 0))
        if (
            self._way[0] is None
            and self._way[1] is None
            and path.distance(x, y, self._progress) > self.max_lateral_offset
            and not self._is_past_end(path, x, y)
        ):
            self._lane = []
            path = self._path = self._lane_ahead(ego)
            self._progress = path.project(x, y)
        if not path.ends and len(path) - self._progress < 2 * HORIZON:
            behind = path.points[max(self._progress - BEHIND, 0) :]
            lap = self._way[2]
            path = self._path = self._lane_ahead(ego) if lap is None else _with_laps(behind, lap)
            self._progress = path.project(x, y)
        return path

    def _is_past_end(self, path: PlannedPath, x: float, y: float) -> bool:
        """Return whether a vehicle has left the end of its lane straight ahead, where it has to stop."""
        if not path.ends or self._progress < len(path) - 2:
            return False
        (x0, y0), (x1, y1) = path.points[-2:].tolist()
        length = math.hypot(x1 - x0, y1 - y0)
        ux, uy = (x1 - x0) / length, (y1 - y0) / length
        ahead, aside = (x - x1) * ux + (y - y1) * uy, (y - y1) * ux - (x - x1) * uy
        return bool(0.0 <= ahead <= BEYOND and abs(aside) <= self.max_lateral_offset)

    def _stop(self, path: PlannedPath, ego: EgoState, x: float, y: float, now: float) -> StopPoint | None:
        """Return the stop point of the next traffic light or stop sign, or None."""
        if self._stops is None:
            return None
        if self._path_of_stops is not path:
            self._path_of_stops = path
            self._stops.follow(path.points, path_heights(path, self.roads, float(ego.position[2])))
        return self._stops.next(self._stops.along(self._progress, x, y), ego.speed, now, self.can_read_light)

    def _target_speed(self, ego: EgoState, goal: Goal | None) -> float:
        """Return the target speed [m/s]: that of the goal, of the settings, the speed limit of the lane, or the initial
        speed."""
        if goal is not None and goal.speed is not None:
            return goal.speed
        if self.settings.target_speed is not None:
            return self.settings.target_speed
        if self.settings.follow_speed_limit and self.roads is not None:
            here = self._location = _lane_below(self.roads, ego, self._location)
            usual = USUAL_SPEED if here is None else self.roads.usual_speed(here.road, here.s, here.lane)
            return min(usual, self.spec.max_speed)
        if self._first_speed is None:
            self._first_speed = max(ego.speed, 0.0)
        return self._first_speed

    def _follows_speed_limits(self, goal: Goal | None) -> bool:
        """Return whether the speed limits of the road determine the target speed."""
        is_given = self.settings.target_speed is not None or (goal is not None and goal.speed is not None)
        return self.settings.follow_speed_limit and not is_given

    def _current_path(self, ego: EgoState, goal: Goal | None) -> PlannedPath:
        if self._path is not None and goal is self._goal:
            return self._path
        self._goal = goal
        way = (None, None, None) if goal is None else (goal.path, goal.waypoints, goal.lap)
        is_same = all(
            new is old or (new is not None and old is not None and np.array_equal(new, old))
            for new, old in zip(way, self._way, strict=True)
        )
        if self._path is None or not is_same:
            self._way, self._progress, self._lane = way, 0, []
            self._path = self._build_path(ego, *way)
        return self._path

    def _build_path(self, ego: EgoState, path: Array | None, waypoints: Array | None, lap: Array | None) -> PlannedPath:
        line: Array | None = None
        if path is not None and len(path) > 1:
            _check_length(path)
            if lap is not None:
                return _with_laps(path, lap)
            line = path[:, :2]
        elif waypoints is not None and len(waypoints):
            x, y, _ = ego.position.tolist()
            _check_length(np.vstack([[x, y, 0.0], waypoints]))
            line = self._by_road(ego, waypoints)
            line = _curve(x, y, ego.yaw, waypoints) if line is None else line
        if line is None:
            return self._lane_ahead(ego)
        try:
            return PlannedPath(line, ends=True)
        except ValueError:  # The destination is at the vehicle
            return _path_to(ego)

    def _by_road(self, ego: EgoState, waypoints: Array) -> Array | None:
        """Return the route through all waypoints; None if one of them or the vehicle is outside the road."""
        if self.roads is None:
            return None
        locations = [_lane_below(self.roads, ego), *(self.roads.locate_at(x, y) for x, y in waypoints[:, :2].tolist())]
        on_road = [location for location in locations if location is not None]
        if len(on_road) < len(locations):
            return None
        places = [on_road[:1], *(lanes_near(self.roads, location) for location in on_road[1:])]
        start, *via, end = select_lanes(self.roads, places)
        line = self.roads.route(start, end, via).polyline(SPACING)
        return np.asarray(line)[:, :2]

    def _lane_ahead(self, ego: EgoState) -> PlannedPath:
        """Return a path along the lane and its successors, extended from the last call; straight without a lane."""
        if self.roads is not None:
            self._lane = self._lane[max(0, self._progress - BEHIND) :]
            if not self._lane:
                self._lane, self._sense = _lane_at(self.roads, ego)
            onward = True
            while onward and self._lane and len(self._lane) < LOOK_AHEAD:
                if self._sense > 0:
                    more = _further(self.roads, self._lane[-1])
                else:
                    more, self._sense = _further_against(self.roads, self._lane[-1])
                self._lane += more
                onward = bool(more)
            if len(self._lane) == 1:  # Within the last meter of the road
                return _path_to(ego)
            if self._lane:
                return PlannedPath(self.roads.centers(self._lane), ends=not onward)
        reach = np.array([[0.0], [float(LOOK_AHEAD)]])
        yaw = ego.yaw
        return PlannedPath(ego.position[:2] + reach * np.array([[math.cos(yaw), math.sin(yaw)]]), ends=False)


def _lane_below(roads: RoadNetwork, ego: EgoState, hint: LaneLocation | None = None) -> LaneLocation | None:
    x, y, z = ego.position.tolist()
    return roads.locate_pose(x, y, ego.yaw, z, hint, drivable=True)


def _lane_at(roads: RoadNetwork, ego: EgoState) -> tuple[list[LaneLocation], int]:
    """Return the lane at the vehicle, or the nearest one in its direction if traffic of that lane drives against it.

    The second result is -1 for a two-way lane against its usual direction, else 1.
    """
    location = _lane_below(roads, ego)
    if location is None or roads.angle_to_lane(location, ego.yaw) < math.pi / 2.0:
        return [] if location is None else [location], 1
    if roads.lane(location).is_two_way:
        return [location], -1
    return _lane_of_direction(roads, location, -roads.driving_direction(location.road, location.lane)), 1


def _lane_of_direction(roads: RoadNetwork, location: LaneLocation, direction: int) -> list[LaneLocation]:
    """Return the location on the nearest lane for vehicles whose traffic drives in a direction, if there is one."""
    road = location.road
    lanes = [
        roads.location(road, lane, location.s)
        for lane in roads.lane_ids(road, location.s, drivable=True)
        if roads.driving_direction(road, lane) == direction
    ]
    return sorted(lanes, key=lambda lane: abs(lane.t - location.t))[:1]


def _further(roads: RoadNetwork, location: LaneLocation) -> list[LaneLocation]:
    """Return the next STRIDE positions along the lane, about SPACING apart; fewer at its end."""
    there = roads.advance(location, STRIDE * SPACING)
    if there is not None and there[:2] == location[:2]:
        road, step = roads.road(location.road), (there.s - location.s) / STRIDE
        same = road.section_at(location.s) is road.section_at(there.s)
        if same and road.length > TURNS and step * roads.driving_direction(location.road, location.lane) > 0.0:
            return [*(location._replace(s=location.s + number * step) for number in range(1, STRIDE)), there]
    locations = [location]
    while len(locations) <= STRIDE and (onward := roads.advance(locations[-1], SPACING)) is not None:
        locations.append(onward)
    return locations[1:]


def _further_against(roads: RoadNetwork, location: LaneLocation) -> tuple[list[LaneLocation], int]:
    """Return the next position on a two-way lane against its usual direction, none at its end.

    Where it becomes a lane for one direction, the position is on the nearest lane of the direction of the vehicle. The
    second result is -1 if the position is on a two-way lane against its usual direction, else 1.
    """
    ahead = roads.movement.travel(location, -SPACING)
    if ahead is None:
        return [], -1
    there, direction = ahead
    against = direction != roads.driving_direction(there.road, there.lane)
    if against and not roads.lane(there).is_two_way:
        return _lane_of_direction(roads, there, direction), 1
    return [there], -1 if against else 1


def _path_to(ego: EgoState) -> PlannedPath:
    """Return the path of a vehicle that stops where it is."""
    here, ahead = ego.position[:2], np.array([math.cos(ego.yaw), math.sin(ego.yaw)])
    return PlannedPath(np.array([here - ahead, here]), ends=True)


def _with_laps(line: Array, lap: Array) -> PlannedPath:
    """Return the path of the line and as many laps as LOOK_AHEAD requires."""
    length = float(np.hypot(*np.diff(lap[:, :2], axis=0).T).sum())
    laps = [lap[1:, :2]] * math.ceil(LOOK_AHEAD * SPACING / length)
    return PlannedPath(np.concatenate([line[:, :2], *laps]), ends=False)


def _check_length(line: Array) -> None:
    """Raise RouteError if a polyline (K, 3) is longer than LONGEST_WAY."""
    length = float(np.hypot(*np.diff(line[:, :2], axis=0).T).sum())
    if not length <= LONGEST_WAY:
        x, y = line[-1, :2].tolist()
        message = f"the way to the destination at ({x:g}, {y:g}) m has a length of {length / 1000.0:,.0f} km"
        raise RouteError(Diagnostic(message, f"a way has at most {LONGEST_WAY / 1000.0:.0f} km: check the position"))


def _curve(x: float, y: float, yaw: float, waypoints: Array) -> Array:
    """Return a smooth line (K, 2) from the vehicle, along its heading, through the waypoints."""

    from scipy.interpolate import PchipInterpolator

    nose = [x + SPACING * math.cos(yaw), y + SPACING * math.sin(yaw)]
    knots = np.array([[x, y], nose, *waypoints[:, :2].tolist()])
    along = distances_along(knots)
    keep = np.concatenate([[True], np.diff(along) > 1e-6])
    stations = np.linspace(0.0, along[-1], max(2, math.ceil(along[-1] / SPACING) + 1))
    return np.asarray(PchipInterpolator(along[keep], knots[keep])(stations))
