"""Roads of the cooperative scenarios 3 to 8 of EI-Drive: signalized crossings of Town05 and Town06.

Each is in the start frame of the ego vehicle. Lane centers are those of the towns, moved by at most 0.3 m so that the
ego vehicle starts on the center of its lane and opposite arms have one reference line.
"""

from __future__ import annotations

import math

from xosc.roads.crossings import CORNER_CLEARANCE, OPPOSITE_PAIRS, Crossing, all_movements
from xosc.roads.layout import Arm, Junction, LaneSpec, Layout, Piece, Road, Section, Way, movement
from xosc.roads.streets import (
    ARTERIAL,
    ARTERIAL_WITH_PARKING,
    DRIVING_INNER,
    DRIVING_OUTER,
    GUTTER,
    LANE,
    MEDIAN,
    STRIP,
    one_way,
    two_way,
)

QUARTER = math.pi / 2
LIGHT_LINE = 4.2
"""Distance of the signals from the junction in Town05 [m]."""


def arterial_crossing() -> Layout:
    """Crossing of two streets with two lanes per direction (coop. 3 and 4): Town05, (-126, 90)."""
    return Crossing(
        name="coop_3",
        ego_street=ARTERIAL,
        cross_street=ARTERIAL_WITH_PARKING,
        y=1.75,
        x=17.35,
        box=(1.4, 33.3, -11.7, 15.6),
        reach=(-98.6, 133.3, -111.7, 115.6),
        control="light",
    ).layout()


def crossing_behind_a_bend() -> Layout:
    """Crossing of two streets; the left one has a bend just before the junction (coop. 5 and 6): Town05, (-50, -90).

    The radius of its reference line is 37.35 m, so that the lane of the incoming car is at y = 53.9 before the bend;
    that of Town05 is 40.5 m and ends inside the junction.
    """
    bend = (Piece(37.35 * QUARTER, 1.0 / 37.35), Piece(80.0))
    near = Road.straight("1", "near", ARTERIAL, -80.0, 5.25, 0.0, 125.2, houses=CORNER_CLEARANCE)
    far = Road.straight("2", "far", ARTERIAL, 75.4, 5.25, 0.0, 60.0, houses=CORNER_CLEARANCE)
    left = Road("3", "left", (Section(0.0, ARTERIAL),), 61.35, 18.3, QUARTER, bend)
    right = Road.straight("4", "right", ARTERIAL, 61.35, -279.8, QUARTER, 270.0, houses=CORNER_CLEARANCE)
    arms = (
        Arm(near, "end", "light", LIGHT_LINE, crosswalk=True),
        Arm(far, "start", "light", LIGHT_LINE, crosswalk=True),
        Arm(left, "start", "light", LIGHT_LINE, crosswalk=True),
        Arm(right, "end", "light", LIGHT_LINE, crosswalk=True),
    )
    junction = Junction("100", "coop_5", arms, tuple(all_movements(*arms)), OPPOSITE_PAIRS)
    return Layout("coop_5", (near, far, left, right), (junction,))


def one_way_crossing() -> Layout:
    """Crossing of a one-way street of four lanes and a street with a median (coop. 7 and 8): Town06, (-3, 48).

    Traffic turns right from the rightmost lane of the one-way street, and right into it. All others continue straight.
    """
    lanes = (DRIVING_INNER, DRIVING_OUTER, STRIP, GUTTER)
    street = two_way(MEDIAN, *lanes, center=("none", "white"))
    wide = two_way(MEDIAN, DRIVING_INNER, *lanes, center=("none", "white"))
    near = Road.straight("1", "near", one_way(4), -80.0, 12.25, 0.0, 100.4, houses=CORNER_CLEARANCE)
    far = Road.straight("2", "far", one_way(4), 61.8, 12.25, 0.0, 60.0, houses=CORNER_CLEARANCE)
    left = Road.straight("3", "left", street, 43.1, 25.0, QUARTER, 100.0, houses=CORNER_CLEARANCE)
    right = Road.straight("4", "right", wide, 43.1, -211.9, QUARTER, 200.0, houses=CORNER_CLEARANCE)
    from_near, to_far = Arm(near, "end", "light"), Arm(far, "start")
    at_left, at_right = Arm(left, "start", "light"), Arm(right, "end", "light")
    median = (LaneSpec("shoulder", MEDIAN.width),)
    ways = (
        Way(from_near, to_far, ((-1, -1), (-2, -2), (-3, -3)), "ahead", right=(LaneSpec("shoulder", LANE),)),
        movement(from_near, at_right, "right", ((-4, 4),)),
        Way(at_left, at_right, ((2, 2), (3, 3)), "ahead", left=median),
        Way(at_right, at_left, ((-2, -2), (-3, -3)), "ahead", left=median),
        movement(at_right, to_far, "right", ((-4, -4),)),
    )
    junction = Junction("100", "coop_7", (from_near, to_far, at_left, at_right), ways, (("1",), ("3", "4")))
    return Layout("coop_7", (near, far, left, right), (junction,))


COOP_CROSSINGS: tuple[Layout, ...] = (arterial_crossing(), crossing_behind_a_bend(), one_way_crossing())
