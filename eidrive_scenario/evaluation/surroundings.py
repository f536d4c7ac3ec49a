"""Actors around one actor in the coordinates of its lane: gaps, speeds, the leader. Shared by criteria on pairs."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator
from typing import NamedTuple

import numpy as np

from eidrive_scenario.evaluation.lane_chains import SPACING, LaneChains
from eidrive_scenario.roads import LaneLocation, RoadNetwork
from eidrive_scenario.world.view import WorldView

RANGE = 200.0
"""Maximum distance of the actors that are considered [m]."""
STEP = 5
"""Number of sample points of a lane per point to which actors are compared."""
BESIDE = 15.0
"""Distance from the sample points of the lane within which actors are placed on their lanes [m]."""
CLOSE = 10.0
"""Distance between bodies up to which straight coordinates apply to actors beside the lane [m]."""
STANDING = 0.1
"""Maximum speed of a standing actor [m/s]. Its heading is irrelevant for the role of a leader."""


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
        return abs(self.other_side_speed) > max(abs(self.other_speed), STANDING)

    @property
    def leads(self) -> bool:
        """Whether the other actor is ahead in the path of the actor and neither approaches it nor crosses the path."""
        return self.ahead > 0.0 and self.side_gap == 0.0 and self.other_speed > -STANDING and not self.crosses

    @property
    def closing_speed(self) -> float:
        """Speed at which the gap to an actor ahead shrinks [m/s]."""
        return self.speed - self.other_speed


class _Body(NamedTuple):
    """Extent and velocity of a body in a frame: position, half extents [m], velocity [m/s]."""

    along: float
    left: float
    half_along: float
    half_left: float
    speed: float
    side_speed: float


class Surroundings:
    """Relations of one actor to the others.

    Along the lane of the actor up to the first fork, coordinates follow the lane. An actor on another road is placed in
    straight coordinates if it is within CLOSE or beyond the fork; else it is ignored, as the road does not lead to it.
    Without roads, or off the road, all coordinates are straight.
    """

    def __init__(self, roads: RoadNetwork | None) -> None:
        self._roads = roads
        self._chains = None if roads is None else LaneChains(roads, RANGE)
        self._hints: dict[str, LaneLocation | None] = {}

    def relations(self, view: WorldView, of: str, to: Collection[str] | None = None) -> Iterator[Relation]:
        """Yield the relation to each other actor within RANGE, or to those named `to`; none if `of` is absent."""
        row = view.rows.get(of)
        if row is None:
            return
        boxes = view.plain_boxes
        own = boxes[row]
        near = [
            other
            for other, name in enumerate(view.names)
            if other != row
            and (to is None or name in to)
            and abs(boxes[other][0] - own[0]) <= RANGE
            and abs(boxes[other][1] - own[1]) <= RANGE
            and abs(boxes[other][2] - own[2]) <= (boxes[other][5] + own[5]) / 2.0 + 2.0
        ]
        if not near:
            return
        lane = self._own_lane(view, row)
        if lane is not None:
            near = self._in_reach(view, row, near, *lane)
        for other in near:
            found = self._relation(view, row, other, lane)
            if found is not None:
                yield found

    def leader(self, view: WorldView, of: str, to: Collection[str] | None = None) -> Relation | None:
        """Return the nearest actor ahead in the path of an actor, or None. `to` restricts the candidates."""
        return min(
            (found for found in self.relations(view, of, to) if found.leads), key=lambda each: each.gap, default=None
        )

    def _in_reach(self, view: WorldView, row: int, near: list[int], place: LaneLocation, direction: int) -> list[int]:
        """Return the actors beside the lane and those in the straight path; the others are ignored."""
        assert self._chains is not None
        chain = self._chains.chain(place, direction)
        begun = chain.roads[place.road].along(place.s)
        first, last = np.searchsorted(chain.along, (begun - 2.0 * BESIDE, begun + RANGE + SPACING)).tolist()
        boxes = view.boxes[near]
        offset = boxes[:, None, :2] - chain.points[first:last:STEP]
        beside = (np.square(offset).sum(axis=-1) <= BESIDE * BESIDE).any(axis=1)
        own = view.plain_boxes[row]
        left = (boxes[:, 1] - own[1]) * math.cos(own[6]) - (boxes[:, 0] - own[0]) * math.sin(own[6])
        straight = np.abs(left) <= (np.hypot(boxes[:, 3], boxes[:, 4]) + own[4]) / 2.0
        return [near[index] for index in np.flatnonzero(beside | straight).tolist()]

    def _own_lane(self, view: WorldView, row: int) -> tuple[LaneLocation, int] | None:
        """Return the location of an actor on its lane and its direction in s; None off the road."""
        if self._roads is None:
            return None
        place, yaw = self._locate(view, row), view.plain_boxes[row][6]
        if place is None or not self._roads.on_road(place):
            return None
        heading = self._roads.road_pose_at(place.road, place.s).h
        return place, 1 if math.cos(yaw - heading) >= 0.0 else -1

    def _relation(
        self, view: WorldView, row: int, other: int, lane: tuple[LaneLocation, int] | None
    ) -> Relation | None:
        """Return the relation to another actor; None if the road bends away before it."""
        found = self._straight(view, row, other) if lane is None else self._along_lane(view, row, other, *lane)
        if found is None:
            return None
        a, b = found
        ahead, left = b.along - a.along, b.left - a.left
        return Relation(
            other=view.names[other],
            gap=max(abs(ahead) - a.half_along - b.half_along, 0.0),
            ahead=ahead,
            side_gap=max(abs(left) - a.half_left - b.half_left, 0.0),
            left=left,
            speed=a.speed,
            other_speed=b.speed,
            side_speed=a.side_speed,
            other_side_speed=b.side_speed,
            wrong_way=lane is not None and self._wrong_way(*lane),
        )

    def _wrong_way(self, place: LaneLocation, direction: int) -> bool:
        assert self._roads is not None
        return self._roads.driving_direction(place.road, place.lane) != direction

    def _straight(self, view: WorldView, row: int, other: int) -> tuple[_Body, _Body]:
        own, there = view.plain_boxes[row], view.plain_boxes[other]
        dx, dy, yaw = there[0] - own[0], there[1] - own[1], own[6]
        cos, sin = math.cos(yaw), math.sin(yaw)
        return _body(view, row, 0.0, 0.0, yaw), _body(view, other, cos * dx + sin * dy, cos * dy - sin * dx, yaw)

    def _along_lane(
        self, view: WorldView, row: int, other: int, place: LaneLocation, direction: int
    ) -> tuple[_Body, _Body] | None:
        """Return both bodies in the coordinates of the lane."""
        assert self._chains is not None
        own, body = view.plain_boxes[row], view.plain_boxes[other]
        there = self._locate(view, other)
        chain = self._chains.chain(place, direction)
        begun = chain.roads[place.road].along(place.s)
        road = None if there is None else chain.roads.get(there.road)
        if there is None or road is None:
            distance = math.hypot(body[0] - own[0], body[1] - own[1]) - (own[3] + body[3]) / 2.0
            bends_away = there is not None and CLOSE < distance < chain.length - begun
            return None if bends_away else self._straight(view, row, other)
        along = chain.distance(road.along(there.s)) - chain.distance(begun)
        left = (there.t - self._chains.center(road, there.road, there.s)) * road.direction - place.offset * direction
        return (
            _body(view, row, 0.0, 0.0, self._heading(place, direction)),
            _body(view, other, along, left, self._heading(there, road.direction)),
        )

    def _locate(self, view: WorldView, row: int) -> LaneLocation | None:
        assert self._roads is not None
        name = view.names[row]
        x, y, z, *_ = view.plain_boxes[row]
        place = self._roads.locate_at(x, y, self._hints.get(name), z)
        self._hints[name] = place
        return place

    def _heading(self, place: LaneLocation, direction: int) -> float:
        assert self._roads is not None
        heading = self._roads.road_pose_at(place.road, place.s).h
        return heading if direction > 0 else heading + math.pi


def _body(view: WorldView, row: int, along: float, left: float, heading: float) -> _Body:
    """Return an actor at a position of a frame whose longitudinal axis has the heading."""
    _, _, _, length, width, _, yaw = view.plain_boxes[row]
    state = view.states[row]
    cos, sin = abs(math.cos(yaw - heading)), abs(math.sin(yaw - heading))
    ahead, aside = math.cos(heading), math.sin(heading)
    vx, vy = state.velocity_x, state.velocity_y
    return _Body(
        along,
        left,
        (length * cos + width * sin) / 2.0,
        (length * sin + width * cos) / 2.0,
        ahead * vx + aside * vy,
        ahead * vy - aside * vx,
    )
