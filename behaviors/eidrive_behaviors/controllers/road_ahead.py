"""Perception of the road ahead: lead objects, their gaps and their closing speeds."""

from __future__ import annotations

import math
from dataclasses import dataclass

from eidrive_scenario.api.actions import Actor, ControllerContext, facing, model
from eidrive_scenario.api.common import LaneLocation

Span = tuple[float, float]
"""Interval from, to [m]."""


@dataclass(frozen=True)
class LeadObject:
    """Object ahead in road coordinates: s along the lane in the direction that the actor faces, t to the left of it.

    name        name of the entity
    gap         free space along the road [m], 0 if both overlap
    aside       free space across the road [m], 0 if both overlap
    closing     own speed along the road minus the speed of the object [m/s]
    nearing     closing speed across the road [m/s]
    speed       speed of the object along the road [m/s]
    change      acceleration of the object along its heading [m/s²]
    sideways    absolute speed of the object across the road [m/s]
    lanes       0 in the own lane, 1 in the next lane to the left, -1 to the right; further lanes are ignored
    towards     distance of its center from the center of its lane, toward the own side [m]; negative on the far side
    intrusion   distance of its near front wheel inside the own lane [m]; negative outside
    covers      True if it covers the full width of the own front, or lies within it: a full wrap
    across      t of its reference point relative to the own one [m]
    walks       True for a pedestrian
    """

    name: str
    gap: float
    aside: float
    closing: float
    nearing: float
    speed: float
    change: float
    sideways: float
    lanes: int
    towards: float
    intrusion: float
    covers: bool
    across: float
    walks: bool

    @property
    def time_to_collision(self) -> float:
        """Gap divided by closing speed [s]; infinite if it does not close."""
        return self.gap / self.closing if self.closing > 0.0 else math.inf

    def headway(self, speed: float) -> float:
        """Return the time headway at the own speed [s]; infinite if the gap does not close."""
        return self.gap / speed if self.closing > 0.0 and speed > 0.0 else math.inf


class RoadAhead:
    """Search along the road of one actor, up to a range [m].

    tolerance  maximum lateral gap to the edges of the front at which a full wrap counts [m]
    later      time by which the states of other actors are predicted [s]
    """

    def __init__(
        self, context: ControllerContext, actor: Actor, reach: float, *, tolerance: float = 0.0, later: float = 0.0
    ) -> None:
        self._context, self._actor, self._reach = context, actor, reach
        self._tolerance, self._later = tolerance, later

    def find_lead_objects(self) -> list[LeadObject]:
        """Return objects ahead in the own and adjacent lanes, and pedestrians in any lane, by ascending gap."""
        here, roads = self._context.location(self._actor.name), self._context.roads
        if here is None or roads is None:
            return []
        others = (other for other in self._context.actors.values() if other is not self._actor and other.present)
        observed = (self._observe(here, other) for other in others if other.name in self._context.view)
        objects = [candidate for candidate in observed if candidate is not None]
        return sorted(objects, key=lambda candidate: candidate.gap)

    def _observe(self, here: LaneLocation, other: Actor) -> LeadObject | None:
        roads, there = self._context.roads, self._context.location(other.name)
        distances = roads.distance(here, there) if roads is not None and there is not None else None
        if roads is None or there is None or distances is None:
            return None
        turn = facing(self._context, self._actor.name, here)
        apart = distances[0] * turn, distances[1] * turn
        if not 0.0 < apart[0] <= self._reach:
            return None
        width = roads.lane_width(here.road, here.lane, here.s)
        is_same_road = here.road == there.road
        own = roads.lanes_between(here, there) == 0 if is_same_road else abs(apart[1]) < 0.5 * width
        walks = isinstance(other.entity, model.Pedestrian)
        if not walks and not own and abs(apart[1]) > 1.5 * width:
            return None
        side = math.copysign(1.0, apart[1])
        way = roads.driving_direction(here.road, here.lane) * turn
        along, across = self._velocity(self._actor, here)
        its_along, its_across = self._velocity(other, there)
        moved = (apart[0] + its_along * self._later, apart[1] + its_across * self._later)
        mine, theirs = self._extents(self._actor, here), self._extents(other, there, *moved)
        border = 0.5 * width - side * here.offset * way
        return LeadObject(
            name=other.name,
            gap=max(0.0, theirs[0][0] - mine[0][1]),
            aside=max(0.0, theirs[1][0] - mine[1][1], mine[1][0] - theirs[1][1]),
            closing=along - its_along,
            nearing=side * (across - its_across),
            speed=its_along,
            change=self._change(other),
            sideways=abs(its_across),
            lanes=0 if own else int(side),
            towards=-side * (there.offset * self._way_at(here, there) + 0.5 * sum(theirs[1]) - apart[1]),
            intrusion=border - side * self._front_wheel_offset(other, there, moved[1], side),
            covers=self._covers(mine[1], theirs[1]),
            across=moved[1],
            walks=walks,
        )

    def _relative_heading(self, actor: Actor, location: LaneLocation) -> float:
        """Return the angle of an actor to the own direction along the lane at a lane location [rad]."""
        roads = self._context.roads
        assert roads is not None
        lane = roads.lane_pose_at(*location[:4]).h
        here = self._context.location(self._actor.name)
        assert here is not None
        flip = 0.0 if self._way_at(here, location) > 0 else math.pi
        return self._context.pose(actor.name).h - lane - flip

    def _way_at(self, here: LaneLocation, location: LaneLocation) -> int:
        """Return +1 if the actor faces in the direction of s on the road of a lane location, else -1."""
        roads = self._context.roads
        assert roads is not None
        way = roads.driving_direction(here.road, here.lane) * facing(self._context, self._actor.name, here)
        return way * (roads.orientation(here, location) or 1)

    def _extents(
        self, actor: Actor, location: LaneLocation, along: float = 0.0, across: float = 0.0
    ) -> tuple[Span, Span]:
        """Return the extents of an actor along and across the road, relative to the own reference point [m]."""
        turn, bounds = self._relative_heading(actor, location), actor.entity.bounding_box
        cos, sin = math.cos(turn), math.sin(turn)
        x = along + bounds.center.x * cos - bounds.center.y * sin
        y = across + bounds.center.x * sin + bounds.center.y * cos
        half_x = 0.5 * (bounds.dimensions.length * abs(cos) + bounds.dimensions.width * abs(sin))
        half_y = 0.5 * (bounds.dimensions.length * abs(sin) + bounds.dimensions.width * abs(cos))
        return (x - half_x, x + half_x), (y - half_y, y + half_y)

    def _front_wheel_offset(self, actor: Actor, location: LaneLocation, across: float, side: float) -> float:
        """Return t of the corner beside the front axle that is nearest to the own actor [m]."""
        turn, bounds = self._relative_heading(actor, location), actor.entity.bounding_box
        axles = actor.entity.axles if isinstance(actor.entity, model.Vehicle) else None
        front = axles.front_axle if axles is not None else None
        x = front.position_x if front is not None else bounds.center.x + 0.5 * bounds.dimensions.length
        y = math.copysign(0.5 * bounds.dimensions.width, -side * math.cos(turn))
        return across + x * math.sin(turn) + y * math.cos(turn)

    def _velocity(self, actor: Actor, location: LaneLocation) -> tuple[float, float]:
        """Return the velocity along and across the road [m/s]."""
        view = self._context.view
        vx, vy, _ = view.velocity[view.rows[actor.name]].tolist()
        axis = self._context.pose(actor.name).h - self._relative_heading(actor, location)
        cos, sin = math.cos(axis), math.sin(axis)
        return vx * cos + vy * sin, vy * cos - vx * sin

    def _change(self, actor: Actor) -> float:
        view = self._context.view
        ax, ay, _ = view.acceleration[view.rows[actor.name]].tolist()
        h = self._context.pose(actor.name).h
        return float(ax * math.cos(h) + ay * math.sin(h))

    def _covers(self, mine: Span, theirs: Span) -> bool:
        tolerance = self._tolerance
        inside = theirs[0] >= mine[0] - tolerance and theirs[1] <= mine[1] + tolerance
        return inside or (theirs[0] <= mine[0] + tolerance and theirs[1] >= mine[1] - tolerance)
