"""Crossings of the scenario library: lanes of the streets, arms, and the course of each connecting road.

Each is a crossing of two straight streets with the lanes of one site of the paper. The ego vehicle starts at the origin
and drives along x; y points left. Lengths are in meters. Connecting roads follow lane centers: straight for every lane,
right from the outermost lane, left from the innermost. A turn is a line, then clothoid, arc and clothoid, so that the
curvature is continuous.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from eidrive_scenario.roads.model import curves

LANE = 3.5
SIDEWALK = 2.0
CLOTHOID = math.radians(25.0)
"""Part of a quarter turn that each of the two clothoids covers [rad]."""


@dataclass(frozen=True)
class LaneSpec:
    """Lane of a street: type, width and the marking on its outer edge (type, color)."""

    type: str
    width: float
    mark: tuple[str, str] = ("none", "white")


@dataclass(frozen=True)
class Street:
    """Lanes of a street, from lane 0 outwards."""

    left: tuple[LaneSpec, ...]
    right: tuple[LaneSpec, ...]
    center: tuple[str, str]

    def side(self, sign: int) -> tuple[LaneSpec, ...]:
        return self.left if sign > 0 else self.right

    def center_of(self, lane: int) -> float:
        """Return t of the center of a lane."""
        specs = self.side(lane)
        sign = 1 if lane > 0 else -1
        return sign * (sum(spec.width for spec in specs[: abs(lane) - 1]) + specs[abs(lane) - 1].width / 2)

    def driving(self, sign: int) -> list[int]:
        """Return the ids of the driving lanes on one side, from the innermost."""
        return [sign * (i + 1) for i, spec in enumerate(self.side(sign)) if spec.type == "driving"]

    def edge(self, sign: int) -> float:
        """Return |t| of the outer edge of the last driving lane."""
        last = self.driving(sign)[-1]
        return abs(self.center_of(last)) + LANE / 2

    def verge(self, sign: int) -> float:
        """Return the width between the last driving lane and the sidewalk."""
        specs = self.side(sign)[abs(self.driving(sign)[-1]) :]
        return sum(spec.width for spec in specs if spec.type != "sidewalk")


DRIVING_INNER = LaneSpec("driving", LANE, ("broken", "white"))
DRIVING_OUTER = LaneSpec("driving", LANE, ("solid", "white"))
GUTTER = LaneSpec("shoulder", 0.63, ("curb", "standard"))
WALK = LaneSpec("sidewalk", SIDEWALK)
AVENUE_SIDE = (DRIVING_INNER, DRIVING_OUTER, LaneSpec("shoulder", 2.5), GUTTER, WALK)
AVENUE = Street(
    left=(LaneSpec("bidirectional", LANE, ("solid broken", "yellow")), *AVENUE_SIDE),
    right=AVENUE_SIDE,
    center=("broken solid", "yellow"),
)
"""Street with two lanes per direction around a shared left-turn lane."""
SIDE_STREET_SIDE = (DRIVING_OUTER, LaneSpec("parking", 3.5), LaneSpec("shoulder", 0.5), GUTTER, WALK)
SIDE_STREET = Street(left=SIDE_STREET_SIDE, right=SIDE_STREET_SIDE, center=("solid solid", "yellow"))
"""Street with one lane per direction and parking on both sides."""


@dataclass(frozen=True)
class Arm:
    """Street up to (contact 'end') or from (contact 'start') the junction; its reference line has the direction
    `heading`.

    x, y      start of the reference line
    approach  side of the lanes that lead to the junction: -1 right, +1 left
    """

    id: str
    name: str
    street: Street
    x: float
    y: float
    heading: float
    length: float
    contact: str
    right: str = ""
    left: str = ""
    ahead: str = ""

    @property
    def approach(self) -> int:
        return -1 if self.contact == "end" else 1

    def mouth(self, lane: int) -> tuple[float, float]:
        """Return the point at which the center of a lane meets the junction."""
        s, t = (self.length if self.contact == "end" else 0.0), self.street.center_of(lane)
        cos, sin = math.cos(self.heading), math.sin(self.heading)
        return self.x + cos * s - sin * t, self.y + sin * s + cos * t

    @property
    def inward(self) -> float:
        """Heading of traffic that enters the junction."""
        return self.heading if self.contact == "end" else self.heading + math.pi


@dataclass(frozen=True)
class Crossing:
    """Street of the ego along x with lane 0 at y = `y`, and a street along y with lane 0 at x = `x`.

    box    ends of the arms at the junction: near x, far x, right y, left y
    reach  outer ends of the arms, in that order
    """

    name: str
    ego_street: Street
    cross_street: Street
    y: float
    x: float
    box: tuple[float, float, float, float]
    reach: tuple[float, float, float, float]
    lights: bool

    def arms(self) -> dict[str, Arm]:
        near, far, right, left = self.box
        near_end, far_end, right_end, left_end = self.reach
        quarter = math.pi / 2
        e, c = self.ego_street, self.cross_street
        arms = (
            Arm("1", "near", e, near_end, self.y, 0.0, near - near_end, "end", "4", "3", "2"),
            Arm("2", "far", e, far, self.y, 0.0, far_end - far, "start", "3", "4", "1"),
            Arm("3", "left", c, self.x, left, quarter, left_end - left, "start", "1", "2", "4"),
            Arm("4", "right", c, self.x, right_end, quarter, right - right_end, "end", "2", "1", "3"),
        )
        return {arm.id: arm for arm in arms}


CROSSINGS = (
    Crossing(
        name="coop_1",
        ego_street=SIDE_STREET,
        cross_street=AVENUE,
        y=1.75,
        x=38.25,
        box=(20.0, 54.5, -11.5, 14.5),
        reach=(-80.0, 134.5, -101.5, 114.5),
        lights=False,
    ),
    Crossing(
        name="coop_2",
        ego_street=AVENUE,
        cross_street=SIDE_STREET,
        y=1.75,
        x=26.75,
        box=(13.4, 39.9, -13.7, 23.5),
        reach=(-80.0, 129.9, -103.7, 113.5),
        lights=True,
    ),
)


@dataclass(frozen=True)
class Way:
    """Connecting road from lanes of one arm to lanes of another."""

    start: Arm
    end: Arm
    lanes: tuple[tuple[int, int], ...]
    turn: str


def ways(arms: dict[str, Arm]) -> Iterator[Way]:
    """Yield all movements of a crossing."""
    for arm in arms.values():
        entering = arm.street.driving(arm.approach)
        for turn, other in (("ahead", arms[arm.ahead]), ("right", arms[arm.right]), ("left", arms[arm.left])):
            leaving = other.street.driving(-other.approach)
            if turn == "ahead":
                yield Way(arm, other, tuple(zip(entering, leaving, strict=True)), turn)
            else:
                yield Way(
                    arm, other, ((entering[-1], leaving[-1]) if turn == "right" else (entering[0], leaving[0]),), turn
                )


def course(way: Way) -> list[curves.Curve]:
    """Return the center line of the first lane of a connecting road."""
    (x, y), (x_end, y_end) = way.start.mouth(way.lanes[0][0]), way.end.mouth(way.lanes[0][1])
    heading = way.start.inward
    along = math.cos(heading) * (x_end - x) + math.sin(heading) * (y_end - y)
    across = math.cos(heading) * (y_end - y) - math.sin(heading) * (x_end - x)
    if way.turn == "ahead":
        return [curves.Arc(0.0, x, y, heading, along)]
    sign = 1.0 if way.turn == "left" else -1.0
    tangent = min(along, abs(across))
    pieces = [("line", along - tangent), *_quarter_turn(tangent), ("line", abs(across) - tangent)]
    found: list[curves.Curve] = []
    s, curvature = 0.0, 0.0
    for kind, length, *target in pieces:
        if length < 1e-9:
            continue
        if kind == "spiral":
            found.append(curves.spiral(s, x, y, heading, length, curvature, sign * target[0]))
            curvature = sign * target[0]
        else:
            found.append(curves.Arc(s, x, y, heading, length, curvature))
        x, y, heading, *_ = found[-1].at(length)
        s += length
    return found


def _quarter_turn(tangent: float) -> list[tuple[str, float] | tuple[str, float, float]]:
    """Return a clothoid, an arc and a clothoid that turn by 90° and use `tangent` [m] of both straight lines."""
    spiral_length, arc_length = 2.0 * CLOTHOID, math.pi / 2 - 2.0 * CLOTHOID
    x, y, h = 0.0, 0.0, 0.0
    for start, end, length in ((0.0, 1.0, spiral_length), (1.0, 1.0, arc_length), (1.0, 0.0, spiral_length)):
        x, y, h, *_ = curves.spiral(0.0, x, y, h, length, start, end).at(length)
    radius = tangent / x
    return [
        ("spiral", spiral_length * radius, 1.0 / radius),
        ("arc", arc_length * radius),
        ("spiral", spiral_length * radius, 0.0),
    ]
