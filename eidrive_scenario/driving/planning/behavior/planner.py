"""Planner `behavior`: decides on fused objects between proposals along the lane graph."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cached_property
from typing import ClassVar

import numpy as np
from msgspec.structs import replace

from eidrive_scenario.base.arrays import Array, Bools
from eidrive_scenario.base.coverage import PerceptionRegion
from eidrive_scenario.base.detections import Detections
from eidrive_scenario.base.geometry import wrap_angle
from eidrive_scenario.base.requests import Goal
from eidrive_scenario.base.tolerances import TIME_TOLERANCE
from eidrive_scenario.driving.planner_settings import PlannerSettings
from eidrive_scenario.driving.planning.behavior.conflict_ways import ConflictWay, ConflictWays
from eidrive_scenario.driving.planning.behavior.decision import Decider, Decision
from eidrive_scenario.driving.planning.behavior.lane_changes import LaneChange, RouteLane, route_lanes
from eidrive_scenario.driving.planning.behavior.maneuvers import Situation
from eidrive_scenario.driving.planning.behavior.memory import KnownObject, ObjectMemory, nearest_rows
from eidrive_scenario.driving.planning.behavior.occlusion import HiddenTraffic, Occluders
from eidrive_scenario.driving.planning.behavior.prediction import Predictor
from eidrive_scenario.driving.planning.behavior.proposals import Body, Wall, speed_limits
from eidrive_scenario.driving.planning.behavior.reference import ReferenceLine
from eidrive_scenario.driving.planning.behavior.right_of_way import JunctionRules, Passage
from eidrive_scenario.driving.planning.behavior.rollout import LEAST_ACCELERATION
from eidrive_scenario.driving.planning.behavior.settings import BehaviorSettings
from eidrive_scenario.driving.planning.path import PlannedPath
from eidrive_scenario.driving.planning.route_planner import HORIZON, RoutePlanner
from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.driving.step import Plan
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.roads.model.signal_states import ON, lamps
from eidrive_scenario.sensing.readings import EgoState
from eidrive_scenario.world.actor import ActorSpec

STEP = 0.25
"""Time step of rollouts [s]."""
CREEPING = 0.35
"""Speed of a plan for a vehicle that starts from standstill [m/s]; the controller holds its brake below 0.3."""
STEEPEST = 0.5
"""Maximum angle between the vehicle and its line from which a lateral motion starts [rad]."""
SAME_LINE = 0.3
"""Maximum difference of the offsets from two lines at which one is the extension of the other [m]."""
VIEW = 80.0
"""Assumed range of sensors without a limit [m]."""
MARGIN_AHEAD = 40.0
"""Length of the line that is considered beyond the horizon and behind the vehicle [m]."""


class BehaviorPlanner(RoutePlanner):
    """Follow the route, and react to objects: follow, give way, pass, brake.

    In the manner of PDM-Closed (Dauner et al., CoRL 2023): proposals are rolled out by the improved Intelligent Driver
    Model against predicted objects and scored. Beyond it: lane changes and passing, giving way at crossing ways,
    emergency braking at any speed, and objects with covariance and existence probability.
    """

    settings_type: ClassVar[type[PlannerSettings]] = BehaviorSettings
    planner_settings: BehaviorSettings
    max_lateral_offset: ClassVar[float] = 6.0

    def __init__(
        self, settings: AgentSettings, spec: ActorSpec, roads: RoadNetwork | None, *, dt: float, seed: int
    ) -> None:
        super().__init__(settings, spec, roads, dt=dt, seed=seed)
        own = self.planner_settings
        usable = min(own.acceleration, max(spec.max_acceleration, LEAST_ACCELERATION))
        own = self.planner_settings = own.model_copy(update={"acceleration": usable})
        self._times: Array = np.arange(0.0, own.horizon + 1e-9, STEP)
        self._body = Body.of(spec)
        self._memory = ObjectMemory(own)
        self._rules = None if roads is None else JunctionRules(roads)
        self._predictor = Predictor(roads, self._times, self._rules)
        self._passages: tuple[Passage, ...] = ()
        self._line: ReferenceLine | None = None
        self._index = 0
        """Point of the line at the vehicle in the last plan."""
        self._released = -math.inf
        """Time of the last plan with a stop that a signal requires [s]."""
        self._route_lanes: list[RouteLane] = []
        """Lanes of a path that changes lanes, from the current one on."""
        self._conflict_ways: ConflictWays | None = None
        if own.caution and roads is not None and self._rules is not None:
            self._conflict_ways = ConflictWays(roads, self._rules, spec.size[:2])
        self._ways: list[ConflictWay] = []
        self._hidden: HiddenTraffic | None = None
        self.observes_regions = self._conflict_ways is not None
        self._lights_work = True
        """Whether the last traffic light in sight was lit."""
        self._regions: Sequence[PerceptionRegion] = ()
        self._limits: Array = np.empty(0)
        self._curve_limits: Array = np.empty(0)
        self._limited: tuple[ReferenceLine | None, bool] = (None, False)
        """Line of the limits, and whether they contain the speed limits of its lanes."""
        self._decision: Decision | None = None
        self._decided = -math.inf
        self._reasons: Array = np.empty((0, 2))
        """Places of the objects that are the reason of the decision [m]."""

    @cached_property
    def _ranges(self) -> tuple[float, float]:
        """Distances up to which the sensors show a car ahead and behind [m]; they are known after the constructor."""
        if not self.view:
            return VIEW, VIEW
        ahead = [sector.range + sector.x for sector in self.view if abs(sector.yaw) <= sector.half_angle]
        turned = ((sector, abs(wrap_angle(sector.yaw - math.pi))) for sector in self.view)
        behind = [sector.range - sector.x for sector, turn in turned if turn <= sector.half_angle]
        front, rear = max(ahead, default=VIEW), max(behind, default=0.0)
        return front if math.isfinite(front) else VIEW, rear if math.isfinite(rear) else VIEW

    @cached_property
    def _decider(self) -> Decider:
        return Decider(self.planner_settings, self.spec, self._body, self._times, self._ranges)

    def observe_regions(self, regions: Sequence[PerceptionRegion]) -> None:
        self._regions = regions

    def plan(self, ego: EgoState, objects: Detections, goal: Goal | None, now: float) -> Plan:
        x, y, _ = ego.position.tolist()
        path = self._advanced_path(ego, goal)
        line = self._line_of(path, ego)
        self._limit(line, follows_signs=self._follows_speed_limits(goal))
        position = self._project(line, x, y)
        self._index = line.index_at(position[0])
        wanted = self._target_speed(ego, goal)
        if self._decision is None or now - self._decided >= self.planner_settings.period - TIME_TOLERANCE:
            self._decided = now
            self._decision = self._decide(ego, objects, line, position, wanted, now)
            rows = self._decision.objects
            self._reasons = objects.boxes[list(rows), :2]
        else:
            rows = nearest_rows(objects, self._reasons)
        part = _planned_part(line, self._index)
        plan = _trajectory(line, part, self._decision, position[0], rows)
        if goal is not None and goal.acceleration and self._decision.is_free:
            limits = self._limits[part]
            if float(limits[0]) >= wanted:
                return replace(plan, speeds=np.minimum(limits, wanted), acceleration=goal.acceleration)
        return plan

    def _line_of(self, path: PlannedPath, ego: EgoState) -> ReferenceLine:
        """Return the reference line of the path; the current maneuver continues on an extended path."""
        before, aside = self._line, 0.0
        x, y, z = ego.position.tolist()
        if before is not None and before.path is path:
            aside = self._changed_by(before, x, y)
            if not aside:
                return before
            line, self._route_lanes = before, self._route_lanes[1:]
        else:
            line, goal = ReferenceLine(path, self.roads, z), self._goal
            self._route_lanes = route_lanes(line) if goal is not None and goal.follows_route else []
        if self._route_lanes:
            line = ReferenceLine(path, self.roads, z, self._route_lanes[0].offsets)
        self._line = line
        self._passages = self._rules.passages(line.points, line.heights) if self._rules is not None else ()
        if self._conflict_ways is not None:
            self._ways = self._conflict_ways.along(line, self._passages)
        shift = None
        if before is not None:
            # Near the last place: laps of a closed path lie on each other.
            (s, d), (s_before, d_before) = self._project(line, x, y), before.project_near(x, y, self._index)
            shift = s - s_before if abs(d - d_before + aside) < SAME_LINE else None
        self._decision = None
        self._decider.line_changed(shift, aside)
        return line

    def _limit(self, line: ReferenceLine, *, follows_signs: bool) -> None:
        """Set the speed limits along a line; the vehicle slows down before lower ones."""
        if self._limited == (line, follows_signs):
            return
        self._limited = line, follows_signs
        own, curvature, spacing = self.planner_settings, line.curvature, line.spacing
        self._limits = self._curve_limits = speed_limits(curvature, line.path_limits, spacing, own)
        if follows_signs:
            limits = np.minimum(line.path_limits, line.speed_limits)
            self._limits = speed_limits(curvature, limits, spacing, own)

    def _change(self, line: ReferenceLine, s: float) -> LaneChange | None:
        """Return the lane change that the path requires next, at a distance along the line; None without one."""
        if len(self._route_lanes) < 2:
            return None
        here, after = self._route_lanes[:2]
        begin, end = (float(line.along[index]) for index in (here.begin, here.end))
        index = line.index_at(min(max(s, begin), end))
        last = math.inf if here.last == len(line.points) - 1 else float(line.along[here.last])
        return LaneChange(begin, end, float(after.offsets[index] - here.offsets[index]), last)

    def _changed_by(self, line: ReferenceLine, x: float, y: float) -> float:
        """Return the distance to the lane of the next change, to the left [m], if the vehicle is in it now; else 0."""
        if len(self._route_lanes) < 2:
            return 0.0
        s, d = self._project(line, x, y)
        change = self._change(line, s)
        return change.offset if change is not None and abs(d - change.offset) < abs(change.offset) / 2.0 else 0.0

    def _caution(
        self, ego: EgoState, objects: Detections, line: ReferenceLine, s: float, wanted: float, now: float
    ) -> tuple[Array, str]:
        """Return the speed limits along the line, with those before hidden ways, and the kind of the nearest one."""
        if not self._ways or self.roads is None:
            return self._limits, ""
        if self._hidden is None:
            fixed = Occluders.of_map(self.roads)
            self._hidden = HiddenTraffic(self.planner_settings, fixed, self._body, self.view or (), self._ranges[0])
        motion = (s, max(ego.speed, 0.0), wanted)
        position: tuple[float, float, float] = tuple(ego.position.tolist())
        ways = [way for way in self._ways if not way.has_light] if self._relies_on_lights(s) else self._ways
        caution = self._hidden.limits(ways, line.along, motion, position, self._regions, objects, now)
        return (self._limits, "") if caution is None else (np.minimum(self._limits, caution[0]), caution[1])

    def _relies_on_lights(self, s: float) -> bool:
        """Return whether the vehicle obeys traffic lights, and these are lit."""
        if self._stops is None:
            return False
        ahead = self._stops.signals.ahead(s)
        states = (light.state for light in ahead if light.kind == "light" and light.state is not None)
        state = next(states, None)
        if state is not None:
            self._lights_work = any(mode == ON for _, mode in lamps(state))
        return self._lights_work

    def _project(self, line: ReferenceLine, x: float, y: float) -> tuple[float, float]:
        return line.project_near(x, y, self._progress)

    def _front_axle(self, ego: EgoState, line: ReferenceLine) -> tuple[float, float, float]:
        """Return the place of the front axle on the line and the slope of its motion."""
        x, y, _ = ego.position.tolist()
        ahead = self.spec.wheelbase
        s, d = self._project(line, x + ahead * math.cos(ego.yaw), y + ahead * math.sin(ego.yaw))
        turn = wrap_angle(ego.yaw - float(line.heading[line.index_at(s)]))
        return s, d, math.tan(min(max(turn, -STEEPEST), STEEPEST))

    def _decide(
        self,
        ego: EgoState,
        objects: Detections,
        line: ReferenceLine,
        position: tuple[float, float],
        wanted: float,
        now: float,
    ) -> Decision:
        x, y, _ = ego.position.tolist()
        s, d = position
        known_objects = self._memory.update(objects, now, self._in_view(ego, objects))
        lanes = self._predictor.lanes(known_objects)
        self._predictor.follow_lanes(known_objects, lanes)
        way = max(ego.speed, wanted) * self.planner_settings.horizon
        indexes = [
            index
            for index, known_object in enumerate(known_objects)
            if math.hypot(known_object.x - x, known_object.y - y) < max(MARGIN_AHEAD + 2.0 * way, self._ranges[0])
        ]
        near = [known_objects[index] for index in indexes]
        stop = self._stop(line.path, ego, x, y, now)
        if stop is not None:
            self._released = now
        passages = tuple(passage for passage in self._passages if passage.end > s)
        gives_way, defers = self._precedence(passages)
        limits, hidden = self._caution(ego, objects, line, s, wanted, now)
        low = line.index_at(s - MARGIN_AHEAD)
        high = line.index_at(s + max(way + MARGIN_AHEAD, self._ranges[0])) + 1
        situation = Situation(
            settings=self.planner_settings,
            body=self._body,
            line=line,
            limits=limits,
            curve_limits=self._curve_limits,
            s=s,
            d=d,
            steered=self._front_axle(ego, line),
            speed=max(ego.speed, 0.0),
            wanted=wanted,
            objects=near,
            prediction=self._predictor.predict(near, [lanes[index] for index in indexes], defers),
            window=(low, max(high, low + 2)),
            stop=None if stop is None else Wall(line.along_of(stop.along), math.inf, stop.reason),
            now=now,
            gives_way=gives_way,
            hidden=hidden,
            change=self._change(line, s),
            passages=passages,
            released=self._released,
        )
        return self._decider.decide(situation)

    def _precedence(self, passages: Sequence[Passage]) -> tuple[Callable[[Passage], bool] | None, ...]:
        """Return functions of a passage of another vehicle: whether a vehicle with these passages ahead gives way to
        it, and whether it gives way to that vehicle; None: there are no junctions."""
        rules = self._rules
        ahead = {passage.junction: passage for passage in reversed(passages)}
        if rules is None or not ahead:
            return None, None
        return (
            lambda other: other.junction in ahead and rules.gives_way(ahead[other.junction], other),
            lambda other: other.junction in ahead and rules.gives_way(other, ahead[other.junction]),
        )

    def _in_view(self, ego: EgoState, objects: Detections) -> Callable[[Sequence[KnownObject]], Bools] | None:
        """Return a function that determines which objects are in view of the sensors; None: all of them.

        objects  in view, which hide what is behind them
        """
        if self.view is None:
            return None
        x, y, z = ego.position.tolist()
        eyes = [sector.placed(x, y, z, ego.yaw) for sector in self.view]

        def in_view(lost: Sequence[KnownObject]) -> Bools:
            points = np.array([(known_object.x, known_object.y) for known_object in lost])
            radius = np.array([known_object.width / 2.0 for known_object in lost])
            occluders = Occluders.of_boxes(objects.boxes)
            shown = np.zeros(len(lost), dtype=bool)
            for eye in eyes:
                inside = ~occluders.block(eye, points, z)
                if eye.half_angle < math.pi:
                    inside &= eye.contains(points[:, 0], points[:, 1], radius)
                shown |= inside
            return shown

        return in_view


def _trajectory(line: ReferenceLine, part: slice, decision: Decision, s: float, rows: tuple[int, ...]) -> Plan:
    """Return the plan of a decision along a part of the line, from the place of the vehicle on.

    rows  fused objects that are the reason
    """
    along = line.along[part]
    offset = decision.profile.offset(along)
    points = line.points[part] + offset[:, None] * line.normal[part]
    # The first point is behind the vehicle; its speed is that at the vehicle.
    squares = np.interp([s, *along[1:]], decision.s, decision.speed**2)
    speeds = np.sqrt(squares) if s < line.length or not line.path.ends else np.zeros(len(along))
    # It does not start for the last decimeters of a gap, which it does not cover faster than that.
    if decision.acceleration > 0.0 and speeds[0] < CREEPING <= decision.speed.max():
        speeds = np.maximum(speeds, CREEPING)
    return Plan(points, speeds, decision.reason, decision.acceleration, decision.braking, rows)


def _planned_part(line: ReferenceLine, first: int) -> slice:
    """Return the points of the line that a plan covers from the one at the vehicle on, at least two."""
    last = min(first + HORIZON, len(line.points))
    return slice(min(first, last - 2), last)
