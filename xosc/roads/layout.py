"""Description of a road network: lanes of streets, roads, junctions and the movements through them.

Lengths are in meters, angles in radians, x ahead and y to the left.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

from eidrive_scenario.roads.model import curves

Contact = Literal["start", "end"]
Control = Literal["", "light", "stop", "yield"]
Curb = Literal["", "corner", "straight"]


@dataclass(frozen=True)
class LaneSpec:
    """Lane of a street: type, width and the marking on its outer edge (type, color).

    end  width at the end of the lane section, if it differs
    """

    type: str
    width: float
    mark: tuple[str, str] = ("none", "white")
    end: float | None = None

    @property
    def width_at_end(self) -> float:
        return self.width if self.end is None else self.end


@dataclass(frozen=True)
class Street:
    """Lanes of a street, from lane 0 outwards, and the marking of lane 0."""

    left: tuple[LaneSpec, ...]
    right: tuple[LaneSpec, ...]
    center: tuple[str, str]

    def side(self, sign: int) -> tuple[LaneSpec, ...]:
        return self.left if sign > 0 else self.right

    def lane(self, number: int) -> LaneSpec:
        return self.side(number)[abs(number) - 1]

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
        return abs(self.center_of(last)) + self.lane(last).width / 2

    def beyond(self, sign: int) -> tuple[LaneSpec, ...]:
        """Return the lanes outside the last driving lane."""
        return self.side(sign)[abs(self.driving(sign)[-1]) :]

    def verge(self, sign: int) -> float:
        """Return the width between the last driving lane and the sidewalk."""
        return sum(spec.width for spec in self.beyond(sign) if spec.type != "sidewalk")


@dataclass(frozen=True)
class Section:
    """Lanes of a road from `s` on.

    offset    t of lane 0 at the start and at the end of the section; they differ where a lane opens on the left
    previous  lane of the previous section for each lane whose number differs; 0 for a lane that opens here
    """

    s: float
    street: Street
    offset: tuple[float, float] = (0.0, 0.0)
    previous: tuple[tuple[int, int], ...] = ()


@dataclass(frozen=True)
class Piece:
    """Part of a reference line: its length and its curvature at the start and at the end [1/m]."""

    length: float
    curvature: float = 0.0
    end_curvature: float | None = None


@dataclass(frozen=True)
class Slope:
    """Part of an elevation profile: its length and the grade at its end [m/m].

    The grade changes linearly from that before: a parabola, whose radius is about its length over the change.
    """

    length: float
    grade: float


@dataclass(frozen=True)
class Tunnel:
    """Tunnel of a road, with a wall at each edge of the road."""

    s: float
    length: float


@dataclass(frozen=True)
class Road:
    """Road outside junctions; its reference line starts at x, y with `heading`, and at z = 0 without grade.

    houses   distance of the rows of houses from a junction at one end of the road [m]; None for no houses
    profile  elevation, from the start on; the last grade continues to the end of the road
    tunnel   tunnel of the road, if it has one
    """

    id: str
    name: str
    sections: tuple[Section, ...]
    x: float
    y: float
    heading: float
    pieces: tuple[Piece, ...]
    houses: float | None = None
    profile: tuple[Slope, ...] = ()
    tunnel: Tunnel | None = None

    @cached_property
    def line(self) -> tuple[curves.Curve, ...]:
        return trace(self.x, self.y, self.heading, self.pieces)

    @property
    def length(self) -> float:
        return sum(piece.length for piece in self.pieces)

    @classmethod
    def straight(
        cls, id: str, name: str, street: Street, x: float, y: float, heading: float, length: float, **options: float
    ) -> Road:
        """Return a straight road with the same lanes all along."""
        return cls(id, name, (Section(0.0, street),), x, y, heading, (Piece(length),), **options)

    @classmethod
    def ramp(
        cls, id: str, name: str, street: Street, x: float, y: float, heading: float, pieces: tuple[Piece, ...]
    ) -> Road:
        """Return a road with the same lanes all along whose first right lane ends at a pose."""
        t = street.center_of(-1)
        x, y = x + t * math.sin(heading), y - t * math.cos(heading)
        end = trace(0.0, 0.0, 0.0, pieces)[-1].at(pieces[-1].length)
        start = heading - end.h
        cos, sin = math.cos(start), math.sin(start)
        x, y = x - cos * end.x + sin * end.y, y - sin * end.x - cos * end.y
        return cls(id, name, (Section(0.0, street),), x, y, start, pieces)


@dataclass(frozen=True)
class Arm:
    """End of a road at a junction.

    control    of the traffic that enters the junction
    line       distance of the signal from the junction
    crosswalk  whether a crosswalk is between stop line and junction
    """

    road: Road
    contact: Contact
    control: Control = ""
    line: float = 0.5
    crosswalk: bool = False

    @property
    def name(self) -> str:
        return self.road.name

    @property
    def approach(self) -> int:
        """Side of the lanes that lead to the junction: -1 right, +1 left."""
        return -1 if self.contact == "end" else 1

    @property
    def s(self) -> float:
        return self.road.length if self.contact == "end" else 0.0

    @property
    def section(self) -> Section:
        return self.road.sections[-1 if self.contact == "end" else 0]

    @property
    def street(self) -> Street:
        return self.section.street

    @property
    def offset(self) -> float:
        return self.section.offset[1 if self.contact == "end" else 0]

    @property
    def end(self) -> curves.CurvePoint:
        """Point of the reference line at the junction."""
        curve = self.road.line[-1 if self.contact == "end" else 0]
        return curve.at(curve.length if self.contact == "end" else 0.0)

    def mouth(self, lane: int) -> tuple[float, float]:
        """Return the point at which the center of a lane meets the junction."""
        t, end = self.offset + self.street.center_of(lane), self.end
        return end.x - math.sin(end.h) * t, end.y + math.cos(end.h) * t

    @property
    def inward(self) -> float:
        """Heading of traffic that enters the junction."""
        return self.end.h if self.contact == "end" else self.end.h + math.pi

    @property
    def outward(self) -> float:
        """Heading of traffic that leaves the junction."""
        return self.end.h if self.contact == "start" else self.end.h + math.pi


@dataclass(frozen=True)
class Way:
    """Connecting road from lanes of one arm to adjacent lanes of another, from the innermost.

    left  lanes on the left of lane 0
    right lanes on the right of the others that continue no lane, such as painted ground
    curb  `corner`: a margin and a sidewalk on the right; `straight`: the outer lanes of the street continue there
    line  center line of the first lane, where it is not the usual course
    """

    start: Arm
    end: Arm
    lanes: tuple[tuple[int, int], ...]
    turn: str
    left: tuple[LaneSpec, ...] = ()
    right: tuple[LaneSpec, ...] = ()
    curb: Curb = ""
    line: tuple[curves.Curve, ...] | None = None


@dataclass(frozen=True)
class Junction:
    """Junction with its arms and movements; `phases` are the groups of roads whose lights are green together."""

    id: str
    name: str
    arms: tuple[Arm, ...]
    ways: tuple[Way, ...]
    phases: tuple[tuple[str, ...], ...] = ()


@dataclass(frozen=True)
class Layout:
    """Road network of one file.

    bounds  west, south, east and north end, if they are not those of the reference lines
    """

    name: str
    roads: tuple[Road, ...]
    junctions: tuple[Junction, ...] = ()
    bounds: tuple[float, float, float, float] | None = None
    kind: str = "town"
    speed_limit: str = "50"


def trace(x: float, y: float, heading: float, pieces: tuple[Piece, ...]) -> tuple[curves.Curve, ...]:
    """Return the curves of consecutive pieces; a piece without length is omitted."""
    found: list[curves.Curve] = []
    s = 0.0
    for piece in pieces:
        if piece.length < 1e-9:
            continue
        if piece.end_curvature is not None:
            found.append(curves.spiral(s, x, y, heading, piece.length, piece.curvature, piece.end_curvature))
        else:
            found.append(curves.Arc(s, x, y, heading, piece.length, piece.curvature))
        x, y, heading, *_ = found[-1].at(piece.length)
        s += piece.length
    return tuple(found)


def movement(start: Arm, end: Arm, turn: str, lanes: tuple[tuple[int, int], ...] | None = None) -> Way:
    """Return the usual movement: ahead from every lane, right from the outermost lane, left from the innermost.

    The shared middle lane of a street continues straight ahead: each of the two directions has its half.
    """
    entering, leaving = start.street.driving(start.approach), end.street.driving(-end.approach)
    if turn == "right":
        return Way(start, end, lanes or ((entering[-1], leaving[-1]),), turn, curb="corner")
    if turn == "left":
        return Way(start, end, lanes or ((entering[0], leaving[0]),), turn)
    return Way(start, end, lanes or tuple(zip(entering, leaving, strict=True)), turn, _left_lanes(start))


def _left_lanes(arm: Arm) -> tuple[LaneSpec, ...]:
    """Return the lanes on the left of the driving lanes of one direction that continue straight through a junction."""
    street = arm.street
    inner = street.side(arm.approach)[0]
    if street.left[0].type == "bidirectional":
        return (LaneSpec("bidirectional", street.left[0].width / 2),)
    if inner.type == "median":
        return (inner,)
    return street.side(-arm.approach) if not street.driving(-arm.approach) else ()
