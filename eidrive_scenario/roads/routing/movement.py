"""Motion along a lane by a distance through lane sections, links and junctions."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from eidrive_scenario.base.geometry import wrap_angle
from eidrive_scenario.roads.geometry.poses import LEAST_STRETCH, lane_at, lane_t, pose_in_lane
from eidrive_scenario.roads.model.curves import Arc
from eidrive_scenario.roads.model.location import LaneKey, LaneLocation, Pose
from eidrive_scenario.roads.model.road_map import Lane, LaneSection, Road
from eidrive_scenario.roads.routing.links import LaneLinks
from eidrive_scenario.roads.routing.route import Branch, BranchSelector, Route
from eidrive_scenario.roads.routing.steady_lanes import LEAST_REST, STRIDE, SteadyLane

EQUAL_TURN = 1e-6
"""Maximum difference of the sizes of two turns that count as equal [rad]."""
LOOK_AHEAD = 30.0
"""Distance ahead at which the direction of a branch is evaluated outside of connecting roads [m]."""


class Movement:
    """Motion of lane locations over one road network."""

    def __init__(self, roads: Mapping[str, Road], links: LaneLinks) -> None:
        self._roads = roads
        self._links = links
        self._steady: dict[tuple[str, int], SteadyLane] = {}
        self._forks: dict[tuple[LaneKey, int], tuple[Branch, ...]] = {}

    def travel(
        self,
        location: LaneLocation,
        distance: float,
        route: Route | None = None,
        choose: BranchSelector | None = None,
        visit: int = 0,
        to_end: bool = False,
        by_reference_line: bool = False,
    ) -> tuple[LaneLocation, int] | None:
        """Return the location `distance` [m] further in the driving direction (backwards if negative), or None.

        The second result is the direction of travel there: +1 along s, else -1. It is against the traffic of a lane
        if the only link leads to the end of that lane, as of sidewalks on maps of CARLA.

        The distance is measured on the path at the offset of the location, or along the reference lines. Where the lane
        forks, the branch is selected by the route, else by `choose`, else it is that of the default route. If the lane
        ends, the result is None, or the end of the lane with `to_end`.
        """
        road = self._roads[location.road]
        section, lane = lane_at(road, location.lane, location.s)
        direction = road.driving_direction(lane.id)
        with_traffic = distance >= 0.0
        if not with_traffic:
            direction = -direction
        remaining, s, offset = abs(distance), min(max(location.s, 0.0), road.length), location.offset
        while True:
            if by_reference_line:
                s, remaining = _along_reference_line(road, section, s, direction, remaining)
            else:
                s, remaining = _along(road, section, lane, s, offset, direction, remaining)
            inside = section.index == len(road.sections) - 1 if direction > 0 else True
            if remaining <= 0.0 and (inside or s < section.end):
                break
            following = self._next_lane(
                road, section, lane, direction, with_traffic, route=route, choose=choose, visit=visit
            )
            if following is None and (remaining <= 0.0 or to_end):
                if not inside:
                    # At the end of the section, the next one starts without this lane.
                    s = math.nextafter(s, section.s)
                break
            if following is None:
                return None
            key, heading_on, shift = following
            if heading_on != direction:
                offset = -offset
            offset += shift
            direction = heading_on
            if route is not None and key.road != road.id:
                visit = route.visit(key.road, visit)
            road = self._roads[key.road]
            section = road.sections[key.section]
            lane = section.lanes[key.lane]
            s = section.s if direction > 0 else section.end
        t, _ = lane_t(road, section, lane, s)
        return LaneLocation(road.id, lane.id, s, offset, t + offset), direction

    def step_in_section(self, location: LaneLocation, distance: float) -> tuple[LaneLocation, Pose] | None:
        """Return the location of `travel`, and the pose there with the heading of the lane along s.

        The result is None if the step leaves the lane section, or if the lane does not exist.
        """
        name, number, s, offset, _ = location
        steady = self._steady.get((name, number))
        if steady is None:
            road = self._roads[name]
            steady = self._steady[name, number] = SteadyLane(road, number, road.driving_direction(number))
        stepped = steady.step(s, offset, distance)
        if stepped is not None:
            return stepped
        road = self._roads[name]
        section = road.section_at(s)
        lane = section.lanes.get(number)
        if lane is None or not 0.0 <= s <= road.length:
            return None
        direction = road.driving_direction(number) if distance >= 0.0 else -road.driving_direction(number)
        if direction < 0 and s == section.s and section.index > 0:
            return None
        s, remaining = _along(road, section, lane, s, offset, direction, abs(distance))
        inside = direction < 0 or s < section.end or section.index == len(road.sections) - 1
        if remaining > 0.0 or not inside:
            return None
        t, sideways = lane_t(road, section, lane, s)
        t += offset
        return LaneLocation(road.id, number, s, offset, t), pose_in_lane(road, section, lane, s, offset, t, sideways)

    def rest(self, key: LaneKey, s: float, direction: int, distance: float) -> float:
        """Return what is left of a distance from s along the center of a lane at the end of its section [m], or 0."""
        road = self._roads[key.road]
        section = road.sections[key.section]
        return _along(road, section, section.lanes[key.lane], s, 0.0, direction, distance)[1]

    def _next_lane(
        self,
        road: Road,
        section: LaneSection,
        lane: Lane,
        direction: int,
        with_traffic: bool,
        *,
        route: Route | None,
        choose: BranchSelector | None,
        visit: int,
    ) -> tuple[LaneKey, int, float] | None:
        """Return the lane after the end of a lane, the direction in it, and the change of offset; None without one."""
        key = LaneKey(road.id, section.index, lane.id)
        branches = self.branches(key, direction, with_traffic)
        if not branches:
            return self._beside_end(road, section, lane, direction)
        if len(branches) == 1:
            return branches[0].lane, branches[0].direction, 0.0
        chosen: Branch | None = None
        if route is not None:
            chosen = route.pick(branches, road.id, visit) or self._towards(route, branches, visit)
        if chosen is None and choose is not None:
            chosen = choose(branches)
        if chosen is None:
            chosen = min(branches, key=lambda branch: default_rank(branch.turn, road))
        return chosen.lane, chosen.direction, 0.0

    def _towards(self, route: Route, branches: Sequence[Branch], visit: int) -> Branch | None:
        """Return the branch that leads to a later road of a route by another way, as in a lane against the traffic."""
        ends = [{name for name, _ in self._links.beyond_road(b.lane.road, b.direction)} for b in branches]
        later = (name for name in route.roads_from(visit + 1) if any(name in roads for roads in ends))
        goal = next(later, None)
        return next((branch for branch, roads in zip(branches, ends, strict=True) if goal in roads), None)

    def branches(self, key: LaneKey, direction: int, with_traffic: bool = True) -> list[Branch]:
        """Return the branches at the end of a lane in the order of the file, preferably those with the traffic."""
        fork = self.fork(key, direction)
        wanted = 1 if with_traffic else -1
        along = [b for b in fork if self._roads[b.lane.road].driving_direction(b.lane.lane) * b.direction == wanted]
        return along or list(fork)

    def fork(self, key: LaneKey, direction: int) -> tuple[Branch, ...]:
        """Return all branches at the end of a lane in the order of the file."""
        fork = self._forks.get((key, direction))
        if fork is None:
            road = self._roads[key.road]
            start = road.reference.at(road.length if direction > 0 else 0.0).h + (0.0 if direction > 0 else math.pi)
            beyond = self._links.beyond(key, direction)
            fork = tuple(Branch(k, d, wrap_angle(self._exit_heading(k, d) - start)) for k, d in beyond)
            self._forks[key, direction] = fork
        return fork

    def _exit_heading(self, key: LaneKey, direction: int) -> float:
        road = self._roads[key.road]
        ahead = road.length if road.junction_id is not None else min(road.length, LOOK_AHEAD)
        return road.reference.at(ahead).h if direction > 0 else road.reference.at(road.length - ahead).h + math.pi

    def _beside_end(
        self, road: Road, section: LaneSection, lane: Lane, direction: int
    ) -> tuple[LaneKey, int, float] | None:
        """Return the nearest lane of the same direction beside the end of a lane, in the next section or the only next
        road, the direction in it, and the change of offset.

        The result is None if the road ends as well.
        """
        index, following, heading_on = section.index + direction, road, direction
        s = s_there = section.end if direction > 0 else section.s
        t = lane_t(road, section, lane, s)[0]
        if not 0 <= index < len(road.sections):
            linked = list(self._links.beyond_road(road.id, direction))
            if len(linked) != 1:
                return None
            following, heading_on = self._roads[linked[0][0]], linked[0][1]
            index = 0 if heading_on > 0 else len(following.sections) - 1
            s_there = 0.0 if heading_on > 0 else following.length
            here, there = road.reference.at(s), following.reference.at(s_there)
            x, y = here.x - there.x - t * math.sin(here.h), here.y - there.y + t * math.cos(here.h)
            t = y * math.cos(there.h) - x * math.sin(there.h)
        other = following.sections[index]
        choices = [
            (abs(lane_t(following, other, candidate, s_there)[0] - t), number)
            for number, candidate in other.lanes.items()
            if candidate.side * heading_on == lane.side * direction and candidate.drivable == lane.drivable
        ]
        if not choices:
            return None
        number = min(choices)[1]
        shift = t - lane_t(following, other, other.lanes[number], s_there)[0]
        return LaneKey(following.id, index, number), heading_on, shift


def default_rank(turn: float, road: Road) -> float:
    """Return the rank of a turn at a fork; the default route has the smallest (ASAM OpenSCENARIO XML 1.3.1, 6.8.1).

    It has the smallest turn. Of a left and a right turn of equal size, it is the right one with right-hand traffic, and
    the left one with left-hand traffic.
    """
    is_far_side = turn > EQUAL_TURN if road.rule == "RHT" else turn < -EQUAL_TURN
    return abs(turn) + (EQUAL_TURN if is_far_side else 0.0)


def _along_reference_line(
    road: Road, section: LaneSection, s: float, direction: int, remaining: float
) -> tuple[float, float]:
    """Return s after `remaining` [m] of the reference line or at the end of the section, and the rest of the length."""
    room = abs(_end_of(road, section, direction) - s)
    if remaining < room:
        return s + direction * remaining, 0.0
    return _end_of(road, section, direction), max(remaining - room, 0.0)


def _end_of(road: Road, section: LaneSection, direction: int) -> float:
    """Return s at the end of a section in a direction."""
    if section.index == len(road.sections) - 1 and direction > 0:
        return road.length
    return section.end if direction > 0 else section.s


def _along(
    road: Road, section: LaneSection, lane: Lane, s: float, offset: float, direction: int, remaining: float
) -> tuple[float, float]:
    """Return s after `remaining` [m] of path or at the end of the section, and the length that is left (0 if none).

    The result is exact on a line or arc at constant t, else by the midpoint rule.
    """
    end = _end_of(road, section, direction)
    steady = road.lane_offset.constant_value is not None
    steady = steady and (lane.id == 0 or lane.center.constant_value is not None)
    while remaining > 0.0:
        room = (end - s) * direction
        if room <= 0.0:
            return end, remaining
        curve, limit = road.reference.ahead(s, direction)
        reach = min(room, (limit - s) * direction)
        if steady and isinstance(curve, Arc):
            stretch = 1.0
            if curve.curvature:
                t = lane_t(road, section, lane, s)[0] + offset
                stretch = max(1.0 - curve.curvature * t, LEAST_STRETCH)
            ds = remaining / stretch
        else:
            stretch = _stretch(road, section, lane, s, offset)
            ds = min(min(remaining, STRIDE) / stretch, reach)
            stretch = _stretch(road, section, lane, s + 0.5 * direction * ds, offset)
            ds = min(remaining, STRIDE) / stretch
        if ds < reach:
            s += direction * ds
            remaining -= ds * stretch
            if remaining < LEAST_REST:
                return s, 0.0
        else:
            s = end if reach == room else limit
            remaining -= reach * stretch
            if remaining <= LEAST_REST:
                return s, 0.0
    return s, 0.0


def _stretch(road: Road, section: LaneSection, lane: Lane, s: float, offset: float) -> float:
    """Return the path length at an offset from a lane center per meter of s, ignoring superelevation."""
    t, slope = lane_t(road, section, lane, s)
    curvature, speed = road.reference.bend(s)
    across = speed * (1.0 - curvature * (t + offset))
    stretch = math.hypot(across, slope) if slope else across
    return stretch if stretch > LEAST_STRETCH else LEAST_STRETCH
