"""Plain data of an OpenDRIVE file: roads, lanes, junctions, signals, and objects with outlines and repetitions.

Names follow ASAM OpenDRIVE 1.6 to 1.8; lengths in meters, angles in radians, speeds in m/s.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import msgspec

from eidrive_scenario.roads.model.curves import ReferenceLine
from eidrive_scenario.roads.model.map_warnings import MapWarning
from eidrive_scenario.roads.model.polynomials import Polynomials

AT_END, STEP = 1e-6, 1e-3
"""Distance before the end of a lane section at which its lanes end, and least step of a lane offset there [m]."""


class Corner(msgspec.Struct, frozen=True):
    """Corner of the outline of an object: (s, t, dz) on the road, or (u, v, z) in the frame of the object."""

    on_road: bool
    x: float
    y: float
    z: float
    height: float


class Repeat(msgspec.Struct, frozen=True):
    """Repetition of an object along the road; distance 0 means without gaps.

    length  extent of the repetition along the road [m]
    size, radius, …  values of the first and of the last object [m]; `size` is their length
    detached         whether the objects are on the straight line between the first and the last one
    """

    s: float
    length: float
    distance: float
    t: tuple[float, float]
    width: tuple[float, float]
    height: tuple[float, float]
    z_offset: tuple[float, float]
    size: tuple[float, float]
    radius: tuple[float, float]
    detached: bool


class RoadObject(msgspec.Struct, frozen=True):
    """Object at a road, such as a barrier, pole, tree, building, crosswalk or parking space.

    outlines  corners of areas
    lines     corners of linear features: outlines with closed="false"
    """

    id: str
    name: str
    type: str
    subtype: str
    road: str
    s: float
    t: float
    z_offset: float
    heading: float
    pitch: float
    roll: float
    length: float
    width: float
    height: float
    radius: float
    outlines: tuple[tuple[Corner, ...], ...] = ()
    lines: tuple[tuple[Corner, ...], ...] = ()
    repeats: tuple[Repeat, ...] = ()


Contact = Literal["start", "end"]

DRIVABLE = frozenset(
    (
        *("driving", "bidirectional", "entry", "exit", "onRamp", "offRamp", "connectingRamp", "slipLane"),
        *("mwyEntry", "mwyExit", "HOV", "bus", "taxi", "special1", "special2", "special3"),
    )
)
"""Lane types for cars."""


class Header(msgspec.Struct, frozen=True):
    """Header of an OpenDRIVE file.

    geo_reference       PROJ string or EPSG number; empty if the file omits it
    geo_reference_line  line of <geoReference> in the file
    offset              origin of the file in the plane of the projection: x, y, z [m] and rotation [rad]
    """

    geo_reference: str = ""
    geo_reference_line: int | None = None
    offset: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)


class RoadMarkLine(msgspec.Struct, frozen=True):
    """Line of a road mark: dashes of a length and a space after each; 0 for a solid line, inf for a single dash."""

    length: float
    space: float
    t_offset: float
    s_offset: float
    width: float


class RoadMark(msgspec.Struct, frozen=True):
    """Marking on the outer edge of a lane from s_offset on, counted from the start of the lane section."""

    s_offset: float
    type: str
    color: str
    width: float
    lane_change: str
    lines: tuple[RoadMarkLine, ...] = ()


class LaneHeight(msgspec.Struct, frozen=True):
    """Height of the inner and outer edge of a lane above the road from s_offset on."""

    s_offset: float
    inner: float
    outer: float


@dataclass(frozen=True)
class Lane:
    """Lane of a lane section.

    width         function of ds from the start of the section
    inner, outer  distances of the edges from lane 0, at least 0, towards the side of the lane
    """

    id: int
    type: str
    width: Polynomials
    inner: Polynomials
    outer: Polynomials
    center: Polynomials
    predecessors: tuple[int, ...] = ()
    successors: tuple[int, ...] = ()
    direction: str = "standard"
    road_marks: tuple[RoadMark, ...] = ()
    heights: tuple[LaneHeight, ...] = ()
    speeds: tuple[tuple[float, float], ...] = ()
    """(s_offset, limit [m/s]) in the order of s_offset."""
    width_from: float = 0.0
    """First s_offset with a specified width, inf if there is none. Before it the width is 0."""
    line: int | None = field(default=None, compare=False, repr=False)

    @property
    def side(self) -> int:
        """+1 left of lane 0, -1 right of it, 0 for lane 0."""
        return (self.id > 0) - (self.id < 0)

    @property
    def drivable(self) -> bool:
        """True if the lane type is drivable for cars."""
        return self.type in DRIVABLE

    @property
    def is_two_way(self) -> bool:
        """True if traffic drives in both directions."""
        return self.type == "bidirectional" or self.direction == "both"


class LaneSection(msgspec.Struct, frozen=True):
    """Section of a road with constant lanes, from s over `length`; lanes by id from left to right."""

    index: int
    s: float
    length: float
    lanes: Mapping[int, Lane]

    @property
    def end(self) -> float:
        """s of the end of the section."""
        return self.s + self.length


class RoadLink(msgspec.Struct, frozen=True):
    """Successor or predecessor of a road."""

    element_type: Literal["road", "junction"]
    element_id: str
    contact: Contact | None = None
    line: int | None = None


class RoadType(msgspec.Struct, frozen=True):
    """Type of a road from s on, with its speed limit [m/s]; None if none is given, inf for no limit."""

    s: float
    type: str
    speed: float | None = None


@dataclass(frozen=True)
class Road:
    """Road: its reference line, profiles and lane sections."""

    id: str
    name: str
    length: float
    rule: Literal["RHT", "LHT"]
    junction_id: str | None
    reference: ReferenceLine
    elevation: Polynomials
    superelevation: Polynomials
    lane_offset: Polynomials
    sections: tuple[LaneSection, ...]
    predecessor: RoadLink | None = None
    successor: RoadLink | None = None
    types: tuple[RoadType, ...] = ()
    line: int | None = None
    section_starts: tuple[float, ...] = field(default=(), repr=False)

    def type_at(self, s: float) -> RoadType | None:
        """Return the type of the road at s, or None if the map states none."""
        return next((kind for kind in reversed(self.types) if kind.s <= s + 1e-9), None)

    @cached_property
    def directions(self) -> Mapping[int, int]:
        """+1 if traffic drives in the direction of s, else -1, by lane id; +1 for lane 0.

        An id has one direction: that of the first section in which it is a lane for cars, if there is any.
        """
        directions = {0: 1}
        lanes = [lane for section in self.sections for lane in section.lanes.values()]
        for lane in sorted(lanes, key=lambda lane: not lane.drivable):
            directions.setdefault(lane.id, self.own_direction(lane))
        return directions

    def own_direction(self, lane: Lane) -> int:
        """Return the direction that a lane specifies: +1 along s, else -1. `both` has the usual one."""
        usual = self._usual_direction(lane.id)
        return -usual if lane.direction == "reversed" else usual

    def driving_direction(self, lane_id: int) -> int:
        """Return `directions` of a lane, also of one that the road does not have."""
        direction = self.directions.get(lane_id)
        return self._usual_direction(lane_id) if direction is None else direction

    def _usual_direction(self, lane_id: int) -> int:
        return -1 if (lane_id > 0) == (self.rule == "RHT") else 1

    def section_at(self, s: float) -> LaneSection:
        """Return the lane section at s."""
        return self.sections[bisect_right(self.section_starts, s, 1) - 1]

    def lane_offset_in(self, section: LaneSection, s: float) -> tuple[float, float]:
        """Return the lane offset in a section at s, and its derivative.

        A step at the end of the section belongs to the next one, in which the lanes have other numbers.
        """
        offset, slope = self.lane_offset.value_and_slope(s)
        if s >= section.end - AT_END:
            before = self.lane_offset.value_and_slope(s - AT_END)
            return before if abs(before[0] - offset) > STEP else (offset, slope)
        return offset, slope


class Connection(msgspec.Struct, frozen=True):
    """Connection through a junction. In a direct junction `connecting_road` is the linked road itself."""

    id: str
    incoming_road: str
    connecting_road: str
    contact: Contact
    lane_links: tuple[tuple[int, int], ...]
    line: int | None = None


class Junction(msgspec.Struct, frozen=True):
    """Junction of type default, direct or virtual.

    priorities  pairs of connecting roads: traffic on the second one gives way to that on the first one
    """

    id: str
    name: str
    type: str
    connections: tuple[Connection, ...]
    controllers: tuple[str, ...] = ()
    priorities: tuple[tuple[str, str], ...] = ()


class SignalPlace(msgspec.Struct, frozen=True):
    """Position and validity of a signal or of a signal reference along a road.

    orientation  '+' valid for traffic in the direction of s, '-' against it, 'none' for both
    validity     ranges of lane ids, empty for all lanes
    """

    road: str
    s: float
    t: float
    orientation: str
    validity: tuple[tuple[int, int], ...] = ()


NOT_FOR_VEHICLES = ("1000002", "1000013")
"""Types of the lights for pedestrians and cyclists in the OpenDRIVE signal catalog."""


class Signal(msgspec.Struct, frozen=True):
    """Traffic sign (dynamic False) or light (dynamic True). `references` are further roads for which it is valid."""

    id: str
    name: str
    type: str
    subtype: str
    country: str
    value: float | None
    unit: str
    text: str
    dynamic: bool
    place: SignalPlace
    z_offset: float
    h_offset: float
    width: float
    height: float
    references: tuple[SignalPlace, ...] = ()

    @property
    def stops_vehicles(self) -> bool:
        """True for a traffic light for vehicles."""
        return self.dynamic and self.type not in NOT_FOR_VEHICLES


class SignalController(msgspec.Struct, frozen=True):
    """Group of signals that switch together."""

    id: str
    name: str
    signals: tuple[str, ...]


class RoadMap(msgspec.Struct, frozen=True):
    """Content of an OpenDRIVE file."""

    source: str
    header: Header
    roads: Mapping[str, Road]
    junctions: Mapping[str, Junction]
    signals: Mapping[str, Signal]
    controllers: Mapping[str, SignalController]
    objects: tuple[RoadObject, ...]
    map_warnings: tuple[MapWarning, ...] = ()
    """Deviations from the standard with which the file is readable."""
