"""Roads of the EIScenarios and of the pipeline scenarios of EI-Drive, with the lane widths of CARLA's towns.

Each is in the start frame of the ego vehicle of the scenario that its description names first. Straight streets replace
the slightly bent ones of the towns: lane centers deviate by less than half a meter.
"""

from __future__ import annotations

import math

from xosc.roads.crossings import OPPOSITE_PAIRS, all_movements
from xosc.roads.layout import Arm, Junction, Layout, Piece, Road, Section, Way, movement
from xosc.roads.movements import side_road
from xosc.roads.streets import (
    AVENUE,
    BOULEVARD,
    BROAD_SIDE_STREET,
    COUNTRY_ROAD,
    LOCAL_STREET,
    SIDE_STREET,
    one_way,
)

QUARTER = math.pi / 2
CLEARANCE = 40.0
"""Distance of houses from the junctions, so that they hide no vehicle at the start [m]."""


def avenue_crossing() -> Layout:
    """Signalized crossing of a street and an avenue with a bend (EI 2, 3, 6; 5 and 9): Town03, (-81, 134)."""
    near = Road.straight("1", "near", AVENUE, -80.0, 1.75, 0.0, 101.6, houses=CLEARANCE)
    bend = (Piece(10.9), Piece(44.0, 1.0 / 43.0), Piece(60.0 * (QUARTER - 44.0 / 43.0), 1.0 / 60.0), Piece(40.0))
    far = Road("2", "far", (Section(0.0, AVENUE),), 48.1, 1.75, 0.0, bend)
    left = Road.straight("3", "left", SIDE_STREET, 35.2, 23.8, QUARTER, 100.0, houses=CLEARANCE)
    right = Road.straight("4", "right", SIDE_STREET, 35.2, -113.4, QUARTER, 100.0, houses=CLEARANCE)
    arms = (
        Arm(near, "end", "light"),
        Arm(far, "start", "light"),
        Arm(left, "start", "light"),
        Arm(right, "end", "light"),
    )
    junction = Junction("100", "avenue_crossing", arms, tuple(all_movements(*arms)), OPPOSITE_PAIRS)
    return Layout("avenue_crossing", (near, far, left, right), (junction,))


def boulevard() -> Layout:
    """Boulevard with two side streets on the left, right turns only (EI 4): Town03, (37, 4).

    The roundabout behind the start of the ego vehicle is omitted.
    """
    heading = math.radians(-0.8)

    def place(x: float, y: float) -> tuple[float, float]:
        return x * math.cos(heading) - y * math.sin(heading), x * math.sin(heading) + y * math.cos(heading)

    roads = [
        Road.straight(number, name, BOULEVARD, *place(x, 4.0), heading, x_end - x)
        for number, name, x, x_end in (
            ("1", "west", -60.0, 27.8),
            ("2", "middle", 56.8, 98.6),
            ("3", "east", 127.6, 240.0),
        )
    ]
    streets = [
        Road.straight(number, name, SIDE_STREET, *place(x, 18.3), heading + QUARTER, 80.0, houses=CLEARANCE)
        for number, name, x in (("4", "first street", 42.3), ("5", "second street", 113.1))
    ]
    junctions = []
    for number, (west, east, street) in enumerate(zip(roads, roads[1:], streets, strict=False), start=1):
        arms = Arm(east, "start"), Arm(west, "end"), Arm(street, "start", "stop")
        ways = side_road(*arms, left_turns=False)
        junctions.append(Junction(f"{number}00", f"boulevard {street.name}", arms, ways))
    return Layout("boulevard", (*roads, *streets), tuple(junctions))


def t_junction() -> Layout:
    """T-junction of local streets with a stop sign on the stem (EI 11; pipeline 4): Town05, (150, -1)."""
    near = Road.straight("1", "near", LOCAL_STREET, -80.0, 2.25, 0.0, 99.0, houses=CLEARANCE)
    far = Road.straight("2", "far", LOCAL_STREET, 44.0, 2.25, 0.0, 126.0, houses=CLEARANCE)
    stem = Road.straight("3", "stem", LOCAL_STREET, 31.55, 12.8, QUARTER, 110.0, houses=CLEARANCE)
    arms = Arm(far, "start"), Arm(near, "end"), Arm(stem, "start", "stop")
    junction = Junction("100", "t_junction", arms, side_road(*arms))
    return Layout("t_junction", (near, far, stem), (junction,))


def one_way_road() -> Layout:
    """One-way road of four lanes with an opening lane, a left exit and an on-ramp (EI 12, 14, 18; pipeline 1 and 2).

    Town06, x as in CARLA, y = 52.3 - y of CARLA: the center of the rightmost lane is at y = 0.
    """
    edge = 12.25
    shifted = tuple((-number, 1 - number) for number in range(1, 8))
    sections = (
        Section(0.0, one_way(4), (edge, edge)),
        Section(91.0, one_way(4, (0.0, 3.5)), (edge, edge + 3.5), shifted),
        Section(119.0, one_way(5), (edge + 3.5, edge + 3.5)),
    )
    before = Road("1", "before the exit", sections, -60.0, 0.0, 0.0, (Piece(184.0),))
    between = Road.straight("2", "before the ramp", one_way(4), 152.0, edge, 0.0, 78.0)
    after = Road.straight("3", "after the ramp", one_way(4), 262.2, edge, 0.0, 187.8)
    leave = left_exit("4", 152.0, 18.6, math.radians(25.0))
    bend = (Piece(60.0), Piece(86.0 * math.radians(23.8), -1.0 / 86.0))
    ramp = Road.ramp("5", "ramp", one_way(1), 230.6, -4.47, math.radians(16.76), bend)
    first = Arm(before, "end"), Arm(between, "start"), Arm(leave, "start")
    main = tuple((-lane - 1, -lane) for lane in range(1, 5))
    out = (
        Way(first[0], first[1], main, "ahead", curb="straight"),
        Way(first[0], first[2], ((-1, -1),), "exit", before.sections[-1].street.left),
    )
    second = Arm(between, "end"), Arm(after, "start"), Arm(ramp, "end", "yield", line=7.0)
    into = movement(second[0], second[1], "ahead"), Way(second[2], second[1], ((-1, -4),), "merge", curb="straight")
    junctions = Junction("100", "exit", first, out), Junction("200", "merge", second, into)
    return Layout("one_way_road", (before, between, after, leave, ramp), junctions)


def left_exit(number: str, x: float, y: float, heading: float) -> Road:
    """Return a road of one lane, whose center begins at a pose, that bends to the left."""
    street = one_way(1)
    t = -street.center_of(-1)
    pieces = (Piece(20.0), Piece(40.0 * (QUARTER - heading), 1.0 / 40.0), Piece(20.0))
    x, y = x - t * math.sin(heading), y + t * math.cos(heading)
    return Road(number, "exit", (Section(0.0, street),), x, y, heading, pieces)


def avenue_t_junctions() -> Layout:
    """Avenue with a signalized T-junction, and one with stop signs 40 m further (EI 13; EI 15; pipeline 3): Town03.

    EI 15 starts at (30.4, 116.9) with heading -90°.
    """
    tilt = math.atan(0.0235)

    def avenue(number: str, name: str, y: float, y_end: float) -> Road:
        x = 34.65 + 0.0235 * (y - 1.0) + 1.75
        return Road.straight(number, name, AVENUE, x, y, QUARTER - tilt, (y_end - y) / math.cos(tilt))

    south, middle, north = (
        avenue("1", "south", -110.0, -18.3),
        avenue("2", "middle", 20.3, 40.9),
        avenue("3", "north", 79.4, 190.0),
    )
    street = Road.straight("4", "street", BROAD_SIDE_STREET, -80.0, 1.85, 0.0, 87.9, houses=CLEARANCE)
    wide = Road.straight("5", "boulevard", BOULEVARD, -80.0, 60.0, 0.0, 98.5)
    first = Arm(middle, "start", "light"), Arm(south, "end", "light"), Arm(street, "end", "stop")
    second = Arm(north, "start", "stop"), Arm(middle, "end"), Arm(wide, "end", "stop")
    return Layout(
        "avenue_t_junctions",
        (south, middle, north, street, wide),
        (
            Junction("100", "street", first, side_road(*first), (("1", "2"),)),
            Junction("200", "boulevard", second, side_road(*second, left_turns=False, right_lanes=2)),
        ),
    )


def street_t_junction() -> Layout:
    """T-junction of streets with parking, stop signs on the stem and on the left (EI 17): Town03, (169, 65)."""
    near = Road.straight("1", "stem", BROAD_SIDE_STREET, -80.0, 1.55, 0.0, 97.0, houses=CLEARANCE)
    left = Road.straight("2", "left", BROAD_SIDE_STREET, 34.85, 19.5, QUARTER, 110.0, houses=CLEARANCE)
    right = Road.straight("3", "right", BROAD_SIDE_STREET, 34.85, -115.2, QUARTER, 100.0, houses=CLEARANCE)
    arms = Arm(left, "start", "stop"), Arm(right, "end"), Arm(near, "end", "stop")
    junction = Junction("100", "street_t_junction", arms, side_road(*arms))
    return Layout("street_t_junction", (near, left, right), (junction,))


def two_lane_road() -> Layout:
    """Straight road with a wide lane per direction (EI 1, 7, 8, 16): Town01. The right lane is centered on y = 0."""
    road = Road.straight("1", "road", COUNTRY_ROAD, -80.0, 2.0, 0.0, 420.0)
    return Layout("two_lane_road", (road,))


EI_SITES: tuple[Layout, ...] = (
    avenue_crossing(),
    boulevard(),
    t_junction(),
    one_way_road(),
    avenue_t_junctions(),
    street_t_junction(),
    two_lane_road(),
)
