"""Actors around one actor in the coordinates of its lane: gaps, speeds, the leader. Shared by criteria on pairs."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.geometry import components
from eidrive_scenario.base.tolerances import EPSILON
from eidrive_scenario.roads import LaneKey, LaneLocation, RoadNetwork
from eidrive_scenario.roads.geometry.poses import lane_t
from eidrive_scenario.world.view import WorldView

SPACING = 1.0
"""Distance of the sample points of a lane along the reference line [m]."""
RANGE = 200.0
"""Maximum gap to the actors that are considered, unless a larger one is requested [m]."""
FARTHEST = 1e9
"""Maximum of that [m], the largest coordinate of a road file: a distance may be infinite."""
STEP = 5
"""Number of sample points of a lane per point to which actors are compared."""
BESIDE = 15.0
"""Distance from the sample points of the lane within which actors are placed on their lanes [m]."""
CLOSE = 10.0
"""Distance between bodies up to which straight coordinates apply to actors beside the lane [m]."""
STANDING = 0.1
"""Maximum speed of a standing actor [m/s]. Its heading is irrelevant for the role of a leader."""


@dataclass(frozen=True)
class RoadOfChain:
    """Road of a chain of lanes.

    start      distance of its start from that of the own road of the actor, along the reference lines [m]
    direction  direction in s, 1 or -1
    length     of the road [m]
    lanes      lane of the chain by section index
    """

    start: float
    direction: int
    length: float
    lanes: Mapping[int, int]

    def along(self, s: float) -> float:
        """Return the distance of s from the start of the own road, along the reference lines [m]."""
        return self.start + (s if self.direction > 0 else self.length - s)


@dataclass(frozen=True)
class LaneChain:
    """Lanes behind and ahead up to a fork.

    roads      roads by number, in order
    along      (N,) distances of sample points from the start of the own road, along the reference lines [m]
    distances  (N,) distances of the sample points along the centers of the lanes [m]
    points     (N, 2) centers of the lanes [m]
    """

    roads: Mapping[str, RoadOfChain]
    along: Array
    distances: Array
    points: Array

    def distance(self, along: float) -> float:
        """Return the distance along the centers of the lanes of a distance along the reference lines [m]."""
        return float(np.interp(along, self.along, self.distances))


class _Body(NamedTuple):
    """Extent and velocity of a body in a frame: position, half extents [m], velocity [m/s]."""

    along: float
    left: float
    half_along: float
    half_left: float
    speed: float
    side_speed: float


class Relation(NamedTuple):
    """Another actor in the coordinates of the lane of an actor: longitudinal forward, lateral to the left.

    gap         longitudinal distance between the bodies [m]; 0 if they overlap longitudinally
    ahead       longitudinal distance of the center of the other body [m], negative behind
    side_gap    lateral distance between the bodies [m]; 0 if they overlap laterally
    left        lateral distance of the center of the other body [m], negative to the right
    speed, other_speed              along the lane [m/s], both positive in the direction of the actor
    side_speed, other_side_speed    to the left [m/s]
    wrong_way   whether the actor drives against the direction of its lane
    """

    other: str
    gap: float
    ahead: float
    side_gap: float
    left: float
    speed: float
    other_speed: float
    side_speed: float
    other_side_speed: float
    wrong_way: bool = False

    @property
    def crosses(self) -> bool:
        """Whether the other actor moves across the lane rather than along it."""
        return abs(self.other_side_speed) > max(abs(self.other_speed), STANDING) + EPSILON

    @property
    def leads(self) -> bool:
        """Whether the other actor is ahead in the path of the actor and neither approaches it nor crosses the path."""
        approaches = self.other_speed < -STANDING - EPSILON
        return self.ahead > 0.0 and self.side_gap == 0.0 and not approaches and not self.crosses

    @property
    def closing_speed(self) -> float:
        """Speed at which the gap to an actor ahead shrinks [m/s]."""
        return self.speed - self.other_speed


class LaneCoordinates:
    """Actors in the coordinates of the lane of one of them.

    Chains of lanes reach at least as far beyond the own road as requested, in doublings of RANGE, and as far behind it
    as bodies that are close may be. They are computed when needed.
    """

    def __init__(self, roads: RoadNetwork) -> None:
        self._roads = roads
        self._hints: dict[str, LaneLocation | None] = {}
        """Last location of each actor."""
        self._chains: dict[tuple[LaneKey, int, int], LaneChain] = {}

    def own_lane(self, view: WorldView, row: int) -> tuple[LaneLocation, int] | None:
        """Return the location of an actor on its lane and its direction in s; None off the road."""
        location, yaw = self._locate(view, row), view.plain_boxes[row][6]
        if location is None or not self._roads.on_road(location):
            return None
        heading = self._roads.road_pose_at(location.road, location.s).h
        return location, 1 if math.cos(yaw - heading) >= 0.0 else -1

    def in_reach(
        self, view: WorldView, row: int, near: list[int], location: LaneLocation, direction: int, reach: float
    ) -> list[int]:
        """Return the actors beside the lane and those in the straight path; the others are ignored."""
        chain = self._chain(location, direction, reach)
        begun = chain.roads[location.road].along(location.s)
        first, last = np.searchsorted(chain.along, (begun - 2.0 * BESIDE, begun + reach + 2.0 * BESIDE)).tolist()
        boxes = view.boxes[near]
        offset = boxes[:, None, :2] - chain.points[first:last:STEP]
        beside = (np.square(offset).sum(axis=-1) <= BESIDE * BESIDE).any(axis=1)
        own = view.plain_boxes[row]
        left = (boxes[:, 1] - own[1]) * math.cos(own[6]) - (boxes[:, 0] - own[0]) * math.sin(own[6])
        straight = np.abs(left) <= (np.hypot(boxes[:, 3], boxes[:, 4]) + own[4]) / 2.0
        return [near[index] for index in np.flatnonzero(beside | straight).tolist()]

    def bodies(
        self, view: WorldView, row: int, other: int, location: LaneLocation, direction: int, reach: float
    ) -> tuple[_Body, _Body] | None:
        """Return both bodies in the coordinates of the lane; None if the road bends away before the other one."""
        own, body = view.plain_boxes[row], view.plain_boxes[other]
        there = self._locate(view, other)
        chain = self._chain(location, direction, reach)
        begun = chain.roads[location.road].along(location.s)
        road = None if there is None else chain.roads.get(there.road)
        if there is None or road is None:
            distance = math.hypot(body[0] - own[0], body[1] - own[1]) - (own[3] + body[3]) / 2.0
            bends_away = there is not None and CLOSE < distance < chain.along[-1] - begun
            return None if bends_away else _straight(view, row, other)
        along = chain.distance(road.along(there.s)) - chain.distance(begun)
        left = (there.t - self._center(road, there.road, there.s)) * road.direction - location.offset * direction
        return (
            _body(view, row, 0.0, 0.0, self._heading(location, direction)),
            _body(view, other, along, left, self._heading(there, road.direction)),
        )

    def is_wrong_way(self, location: LaneLocation, direction: int) -> bool:
        """Return whether an actor drives against the direction of its lane."""
        return self._roads.driving_direction(location.road, location.lane) != direction

    def _locate(self, view: WorldView, row: int) -> LaneLocation | None:
        name = view.names[row]
        x, y, *_, yaw = view.plain_boxes[row]
        location = self._roads.locate_pose(x, y, yaw, view.states[row].z, self._hints.get(name))
        self._hints[name] = location
        return location

    def _heading(self, location: LaneLocation, direction: int) -> float:
        heading = self._roads.road_pose_at(location.road, location.s).h
        return heading if direction > 0 else heading + math.pi

    def _chain(self, location: LaneLocation, direction: int, reach: float) -> LaneChain:
        """Return the chain of the lane of an actor that moves in a direction of s."""
        road = self._roads.roads[location.road]
        key = LaneKey(location.road, road.section_at(location.s).index, location.lane)
        doublings = math.ceil(math.log2(reach / RANGE))
        chain = self._chains.get((key, direction, doublings))
        if chain is None:
            chain = self._chains[key, direction, doublings] = self._build(key, direction, RANGE * 2.0**doublings)
        return chain

    def _center(self, chain: RoadOfChain, number: str, s: float) -> float:
        """Return t of the center of the chain on one of its roads [m]; beyond its lanes that of the end of the last."""
        road = self._roads.roads[number]
        section = road.section_at(s)
        if section.index not in chain.lanes:
            section = road.sections[min(chain.lanes, key=lambda candidate: abs(candidate - section.index))]
            s = min(max(s, section.s), section.end)
        return lane_t(road, section, section.lanes[chain.lanes[section.index]], s)[0]

    def _build(self, key: LaneKey, direction: int, reach: float) -> LaneChain:
        own = self._roads.roads[key.road].length
        lanes = {key.road: {key.section: key.lane}}
        extents = {key.road: (0.0, direction, own)}
        # The centers of long bodies are beyond the gap.
        for side, limit in ((1, reach + 2.0 * BESIDE), (-1, 2.0 * BESIDE)):
            length, way, last = 0.0, side * direction, key
            while length <= limit:
                following = self._next_section(last, way)
                if following is None:
                    ways = list(self._roads.links.beyond(last, way))
                    if len(ways) != 1 or ways[0][0].road in extents:
                        break
                    following, way = ways[0]
                    if side < 0 and len(list(self._roads.links.beyond(following, -way))) > 1:
                        break  # The lane of the actor is one of several after a fork.
                    road = self._roads.roads[following.road]
                    start = own + length if side > 0 else -length - road.length
                    extents[following.road], lanes[following.road] = (start, side * way, road.length), {}
                    length += road.length
                lanes[following.road][following.section] = following.lane
                last = following
        order = sorted(extents, key=lambda number: extents[number][0])
        roads = {number: RoadOfChain(*extents[number], lanes[number]) for number in order}
        return LaneChain(roads, *self._sample(roads))

    def _next_section(self, key: LaneKey, direction: int) -> LaneKey | None:
        """Return the lane in the next section of the road: of several, the one with the nearest center."""
        here = [lane for lane, _ in self._roads.links.beyond(key, direction) if lane.road == key.road]
        here = [lane for lane in here if lane.section == key.section + direction]
        if len(here) <= 1:
            return here[0] if here else None
        section = self._roads.roads[key.road].sections[key.section]
        s = section.end if direction > 0 else section.s
        tables = self._roads.tables
        rows = np.array([tables.row_of(lane) for lane in (key, *here)])
        centers, _ = tables.lane_t(rows, np.full(len(rows), s))
        return here[int(np.abs(centers[1:] - centers[0]).argmin())]

    def _sample(self, roads: Mapping[str, RoadOfChain]) -> tuple[Array, Array, Array]:
        """Return distances along the reference lines and along the lanes (N,), and points (N, 2)."""
        tables = self._roads.tables
        along, rows, positions = [], [], []
        for number, road in roads.items():
            count = max(int(np.ceil(road.length / SPACING)), 1)
            s = np.linspace(0.0, road.length, count + 1)[:: road.direction]
            along.append(road.start + np.linspace(0.0, road.length, count + 1))
            sections = self._roads.roads[number].sections
            keys = [LaneKey(number, section.index, self._lane_of(number, section.index, road)) for section in sections]
            borders = np.array([section.s for section in sections[1:]])
            rows.append(np.array([tables.row_of(key) for key in keys])[np.searchsorted(borders, s, side="right")])
            positions.append(s)
        at_row, at_s = np.concatenate(rows), np.concatenate(positions)
        poses = tables.lane_poses(at_row, at_s, np.zeros(len(at_s)))
        points = np.column_stack([poses.x, poses.y])
        steps = np.hypot(*np.diff(points, axis=0).T)
        ahead = np.diff(np.concatenate(along))
        # Between roads and sections, centers of lanes may be apart.
        steps = np.where((ahead <= 0.0) | (np.diff(at_row) != 0), ahead, steps)
        return np.concatenate(along), np.concatenate([[0.0], np.cumsum(steps)]), points

    def _lane_of(self, number: str, index: int, road: RoadOfChain) -> int:
        """Return the lane of the chain in a section, or the one nearest to its lanes in number."""
        if index in road.lanes:
            return road.lanes[index]
        near = road.lanes[min(road.lanes, key=lambda candidate: abs(candidate - index))]
        numbers = [lane for lane in self._roads.roads[number].sections[index].lanes if lane]
        same = [lane for lane in numbers if (lane > 0) == (near > 0)] or numbers
        return min(same, key=lambda lane: abs(lane - near))


class Surroundings:
    """Relations of one actor to the others.

    Along the lane of the actor up to the first fork, ahead and behind, coordinates follow the lane. An actor on another
    road is placed in straight coordinates if it is within CLOSE or beyond the fork; else it is ignored, as the road
    does not lead to it. Without roads, or off the road, all coordinates are straight.
    """

    def __init__(self, roads: RoadNetwork | None) -> None:
        self._lanes = None if roads is None else LaneCoordinates(roads)

    def relations(
        self, view: WorldView, of: str, to: Collection[str] | None = None, reach: float = 0.0
    ) -> Iterator[Relation]:
        """Yield the relation to each other actor, or to those named `to`; none if `of` is absent.

        The gap is at most RANGE, or `reach` if it is larger [m].
        """
        row = view.rows.get(of)
        if row is None:
            return
        boxes, reach = view.plain_boxes, min(max(reach, RANGE), FARTHEST)
        own = boxes[row]
        near = [
            other
            for other, name in enumerate(view.names)
            if other != row
            and (to is None or name in to)
            and abs(boxes[other][2] - own[2]) <= (boxes[other][5] + own[5]) / 2.0 + 2.0
        ]
        if not near:
            return
        lanes = self._lanes
        lane = None if lanes is None else lanes.own_lane(view, row)
        if lanes is None or lane is None:
            relations = [_relation(view.names[other], *_straight(view, row, other)) for other in near]
        else:
            wrong_way = lanes.is_wrong_way(*lane)
            relations = [
                _relation(view.names[other], *bodies, wrong_way=wrong_way)
                for other in lanes.in_reach(view, row, near, *lane, reach)
                if (bodies := lanes.bodies(view, row, other, *lane, reach)) is not None  # else the road bends away
            ]
        yield from (relation for relation in relations if relation.gap <= reach)

    def leader(self, view: WorldView, of: str, to: Collection[str] | None = None) -> Relation | None:
        """Return the nearest actor ahead in the path of an actor, or None. `to` restricts the candidates."""
        leaders = (relation for relation in self.relations(view, of, to) if relation.leads)
        return min(leaders, key=lambda leader: leader.gap, default=None)


def _relation(name: str, a: _Body, b: _Body, *, wrong_way: bool = False) -> Relation:
    """Return the relation of the first body to the second one, which has the name."""
    ahead, left = b.along - a.along, b.left - a.left
    return Relation(
        other=name,
        gap=max(abs(ahead) - a.half_along - b.half_along, 0.0),
        ahead=ahead,
        side_gap=max(abs(left) - a.half_left - b.half_left, 0.0),
        left=left,
        speed=a.speed,
        other_speed=b.speed,
        side_speed=a.side_speed,
        other_side_speed=b.side_speed,
        wrong_way=wrong_way,
    )


def _straight(view: WorldView, row: int, other: int) -> tuple[_Body, _Body]:
    own, there = view.plain_boxes[row], view.plain_boxes[other]
    along, left = components(there[0] - own[0], there[1] - own[1], own[6])
    return _body(view, row, 0.0, 0.0, own[6]), _body(view, other, along, left, own[6])


def _body(view: WorldView, row: int, along: float, left: float, heading: float) -> _Body:
    """Return an actor at a position of a frame whose longitudinal axis has the heading."""
    _, _, _, length, width, _, yaw = view.plain_boxes[row]
    state = view.states[row]
    cos, sin = abs(math.cos(yaw - heading)), abs(math.sin(yaw - heading))
    return _Body(
        along,
        left,
        (length * cos + width * sin) / 2.0,
        (length * sin + width * cos) / 2.0,
        *components(state.velocity_x, state.velocity_y, heading),
    )
