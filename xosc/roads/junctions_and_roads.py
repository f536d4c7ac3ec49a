"""Roads of general use: four-lane road, motorway with on-ramp, roundabout, four-way junctions.

The center of the right lane is at y = 0 where an ego vehicle would start, at x = 0.
"""

from __future__ import annotations

import math

from eidrive_scenario.roads.model import curves
from xosc.roads.crossings import Crossing
from xosc.roads.layout import Arm, Junction, Layout, Piece, Road, Section, Slope, Tunnel, Way, movement
from xosc.roads.streets import (
    ARTERIAL,
    COUNTRY_ROAD,
    DUAL_CARRIAGEWAY,
    LOCAL_STREET,
    MOTORWAY_LANE,
    PLAIN_STREET,
    RING,
    TUNNEL_STREET,
    motorway,
)

QUARTER = math.pi / 2


def four_lane_road() -> Layout:
    """Road with two lanes per direction and a bend of 200 m radius to the left."""
    bend = (Piece(200.0), Piece(40.0, 0.0, 1 / 200), Piece(100.0, 1 / 200), Piece(40.0, 1 / 200, 0.0), Piece(200.0))
    return Layout("four_lane_road", (Road("1", "road", (Section(0.0, ARTERIAL),), -60.0, 5.25, 0.0, bend),))


def winding_road() -> Layout:
    """Road with one lane per direction and an S-bend of 50 m radius."""
    left = (Piece(20.0, 0.0, 1 / 50), Piece(40.0, 1 / 50), Piece(20.0, 1 / 50, 0.0))
    right = (Piece(20.0, 0.0, -1 / 50), Piece(40.0, -1 / 50), Piece(20.0, -1 / 50, 0.0))
    pieces = (Piece(120.0), *left, *right, Piece(200.0))
    return Layout("winding_road", (Road("1", "road", (Section(0.0, COUNTRY_ROAD),), -80.0, 2.0, 0.0, pieces),))


def crest_road() -> Layout:
    """Dual carriageway over a crest of 800 m radius at x = 0: a car is hidden until about 100 m."""
    hill = (Slope(150.0, 0.0), Slope(90.0, 0.06), Slope(60.0, 0.06), Slope(96.0, -0.06), Slope(60.0, -0.06))
    profile = (*hill, Slope(90.0, 0.0))
    section = Section(0.0, DUAL_CARRIAGEWAY)
    lane = -DUAL_CARRIAGEWAY.center_of(-3)
    road = Road("1", "crest", (section,), -348.0, lane, 0.0, (Piece(800.0),), profile=profile)
    return Layout("crest_road", (road,), kind="rural", speed_limit="100")


def tunnel_road() -> Layout:
    """Road with one lane per direction through a tunnel with a bend of 150 m radius to the right."""
    bend = (Piece(40.0, 0.0, -1 / 150), Piece(160.0, -1 / 150), Piece(40.0, -1 / 150, 0.0))
    pieces = (Piece(160.0), *bend, Piece(160.0))
    lane = -TUNNEL_STREET.center_of(-1)
    section = Section(0.0, TUNNEL_STREET)
    road = Road("1", "tunnel", (section,), -80.0, lane, 0.0, pieces, tunnel=Tunnel(120.0, 320.0))
    return Layout("tunnel_road", (road,), kind="rural", speed_limit="80")


def motorway_with_on_ramp() -> Layout:
    """Motorway of three lanes per direction; the on-ramp becomes an acceleration lane of 200 m with a taper of 60 m."""
    inner = 2.5 * MOTORWAY_LANE
    end = 50.0
    before = Road.straight("1", "before the ramp", motorway(3), -300.0, inner, 0.0, 300.0)
    sections = (
        Section(0.0, motorway(3, (MOTORWAY_LANE, MOTORWAY_LANE))),
        Section(200.0, motorway(3, (MOTORWAY_LANE, 0.0))),
        Section(260.0, motorway(3), previous=((-4, -5),)),
    )
    after = Road("2", "after the ramp", sections, end, inner, 0.0, (Piece(750.0),))
    opposite = Road.straight("3", "opposite", motorway(3), end + 750.0, inner + 4.5, math.pi, 1100.0)
    bend = (Piece(60.0), Piece(150.0 * math.radians(35.0), -1 / 150), Piece(40.0))
    ramp = Road.ramp("4", "ramp", motorway(1), 0.0, -8.0, math.radians(10.0), bend)
    arms = Arm(before, "end"), Arm(after, "start"), Arm(ramp, "end")
    ahead = Way(arms[0], arms[1], ((-1, -1), (-2, -2), (-3, -3)), "ahead", before.sections[0].street.left)
    junction = Junction("100", "merge", arms, (ahead, Way(arms[2], arms[1], ((-1, -4),), "merge", curb="straight")))
    roads = (before, after, opposite, ramp)
    return Layout("motorway", roads, (junction,), kind="motorway", speed_limit="130")


RADIUS, HALF_ANGLE, LEG = 20.0, math.radians(32.0), 34.0
"""Of the roundabout: radius of the lane center [m], angle between a leg and its entry, start of the legs [m]."""


def roundabout() -> Layout:
    """Roundabout of one lane with four legs; traffic in the circle has priority."""
    center, legs, ring = (LEG + 20.0, 1.75), [], []
    for number, angle in enumerate((math.pi, -QUARTER, 0.0, QUARTER)):
        x, y = center[0] + LEG * math.cos(angle), center[1] + LEG * math.sin(angle)
        legs.append(Road.straight(f"{number + 1}", f"leg {number + 1}", PLAIN_STREET, x, y, angle, 80.0))
        radius, start = RADIUS - RING.right[0].width / 2, angle + HALF_ANGLE
        x, y = center[0] + radius * math.cos(start), center[1] + radius * math.sin(start)
        arc = (Piece(radius * (QUARTER - 2.0 * HALF_ANGLE), 1.0 / radius),)
        ring.append(Road(f"{number + 5}", f"circle {number + 1}", (Section(0.0, RING),), x, y, start + QUARTER, arc))
    junctions = []
    for number, leg in enumerate(legs):
        outer, into, out = Arm(leg, "start", "yield"), Arm(ring[number - 1], "end"), Arm(ring[number], "start")
        x, y = into.mouth(-1)
        around = curves.Arc(0.0, x, y, into.inward, 2.0 * HALF_ANGLE * RADIUS, 1.0 / RADIUS)
        ways = (
            Way(into, out, ((-1, -1),), "around", RING.left, line=(around,)),
            movement(into, outer, "right"),
            movement(outer, out, "right"),
        )
        junctions.append(Junction(f"{number + 1}00", f"leg {number + 1}", (outer, into, out), ways))
    return Layout("roundabout", (*legs, *ring), tuple(junctions))


FOUR_WAY_SIGNALS = Crossing(
    name="four_way_signals",
    ego_street=ARTERIAL,
    cross_street=ARTERIAL,
    y=1.75,
    x=42.0,
    box=(26.0, 58.0, -14.25, 17.75),
    reach=(-80.0, 164.0, -120.25, 123.75),
    control="light",
)
FOUR_WAY_JUNCTION = Crossing(
    name="four_way_junction",
    ego_street=LOCAL_STREET,
    cross_street=LOCAL_STREET,
    y=1.75,
    x=42.0,
    box=(29.0, 55.0, -11.25, 14.75),
    reach=(-80.0, 164.0, -120.25, 123.75),
    control="",
)
"""Four-way junction without signs: priority to the right."""

JUNCTIONS_AND_ROADS: tuple[Layout, ...] = (
    four_lane_road(),
    winding_road(),
    crest_road(),
    tunnel_road(),
    motorway_with_on_ramp(),
    roundabout(),
    FOUR_WAY_SIGNALS.layout(),
    FOUR_WAY_JUNCTION.layout(),
)
