"""Cross sections of the streets of the library, from lane 0 outwards; widths in meters.

The sections of EI-Drive's places are those of CARLA's towns.
"""

from __future__ import annotations

from xosc.roads.layout import LaneSpec, Street

LANE = 3.5
DRIVING_INNER = LaneSpec("driving", LANE, ("broken", "white"))
DRIVING_OUTER = LaneSpec("driving", LANE, ("solid", "white"))
GUTTER = LaneSpec("shoulder", 0.63, ("curb", "standard"))
STRIP = LaneSpec("shoulder", 0.5)
WALK = LaneSpec("sidewalk", 2.0)
WIDE_WALK = LaneSpec("sidewalk", 4.0)
BROAD_WALK = LaneSpec("sidewalk", 6.0)
DOUBLE_YELLOW = ("solid solid", "yellow")


def two_way(
    *side: LaneSpec, center: tuple[str, str] = DOUBLE_YELLOW, other: tuple[LaneSpec, ...] | None = None
) -> Street:
    """Return a street with these lanes on the right and, mirrored, on the left, or `other` lanes there."""
    return Street(left=side if other is None else other, right=side, center=center)


_AVENUE_SIDE = (DRIVING_INNER, DRIVING_OUTER, LaneSpec("shoulder", 2.5), GUTTER, WALK)
AVENUE = two_way(
    *_AVENUE_SIDE,
    center=("broken solid", "yellow"),
    other=(LaneSpec("bidirectional", LANE, ("solid broken", "yellow")), *_AVENUE_SIDE),
)
"""Street with two lanes per direction around a shared left-turn lane, which is the first lane on the left."""
SIDE_STREET = two_way(DRIVING_OUTER, LaneSpec("parking", 3.5), STRIP, GUTTER, WALK)
"""Street with one lane per direction and parking on both sides."""
BROAD_SIDE_STREET = two_way(DRIVING_OUTER, LaneSpec("parking", 3.5), GUTTER, BROAD_WALK)
"""The same with broad sidewalks."""
MEDIAN = LaneSpec("median", 2.25, ("solid", "yellow"))
"""Half of a median of 4.5 m."""
BOULEVARD = two_way(
    MEDIAN, DRIVING_INNER, DRIVING_OUTER, LaneSpec("shoulder", 2.5), GUTTER, WALK, center=("none", "white")
)
"""Street with two lanes per direction and a median."""
COUNTRY_ROAD = two_way(
    LaneSpec("driving", 4.0, ("solid", "white")), LaneSpec("shoulder", 0.3), WIDE_WALK, center=("broken", "yellow")
)
"""Road with one wide lane per direction and no parking."""
LOCAL_STREET = two_way(DRIVING_OUTER, LaneSpec("parking", 2.0), GUTTER, WIDE_WALK, center=("broken", "yellow"))
"""Street with one lane per direction and narrow parking lanes."""
ARTERIAL = two_way(DRIVING_INNER, DRIVING_OUTER, STRIP, GUTTER, WIDE_WALK)
"""Street with two lanes per direction and no median."""
ARTERIAL_WITH_PARKING = two_way(DRIVING_INNER, DRIVING_OUTER, LaneSpec("parking", 3.0), GUTTER, WIDE_WALK)


PLAIN_STREET = two_way(DRIVING_OUTER, STRIP, GUTTER, WIDE_WALK, center=("solid", "white"))
"""Street with one lane per direction and no parking."""
DUAL_CARRIAGEWAY = two_way(
    MEDIAN, DRIVING_INNER, DRIVING_OUTER, LaneSpec("shoulder", 1.5), LaneSpec("border", 6.0), center=("none", "white")
)
"""Country road with two lanes per direction, a median and grass."""
TUNNEL_STREET = two_way(DRIVING_OUTER, STRIP, center=("solid", "white"))
"""One lane per direction between the walls of a tunnel."""
RING = Street(
    left=(GUTTER,), right=(LaneSpec("driving", 4.5, ("solid", "white")), STRIP, GUTTER, WALK), center=("none", "white")
)
"""Lane of a roundabout; lane 0 is at the central island."""


def one_way(lanes: int, opening: tuple[float, float] | None = None) -> Street:
    """Return a one-way street with lane 0 on its left; a lane of another width may open on the left."""
    inside = (DRIVING_INNER,) * (lanes - 1) + (DRIVING_OUTER,)
    if opening is not None:
        inside = (LaneSpec("driving", opening[0], ("broken", "white"), opening[1]), *inside)
    return Street(left=(STRIP, GUTTER), right=(*inside, STRIP, GUTTER), center=("solid", "white"))


MOTORWAY_LANE = 3.75
_EDGE = LaneSpec("shoulder", 0.75)
_HARD_SHOULDER = LaneSpec("shoulder", 2.5)


def motorway(lanes: int, acceleration: tuple[float, float] | None = None) -> Street:
    """Return a carriageway with a hard shoulder; an acceleration lane may be on the right of the others.

    acceleration  its width at both ends of the section
    """
    inner, outer = (LaneSpec("driving", MOTORWAY_LANE, (kind, "white")) for kind in ("broken", "solid"))
    inside: tuple[LaneSpec, ...] = (inner,) * (lanes - 1) + (outer,)
    if acceleration is not None:
        inside = (inner,) * lanes + (LaneSpec("driving", acceleration[0], ("solid", "white"), acceleration[1]),)
    return Street(left=(_EDGE,), right=(*inside, _HARD_SHOULDER), center=("solid", "white"))
