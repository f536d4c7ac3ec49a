"""OpenDRIVE texts for tests: a map from its roads, a road from its parts, and the parts that many tests need."""

from __future__ import annotations

import math
from collections.abc import Mapping


def map_xml(*roads: str, header: str = "", rest: str = "") -> str:
    """Return a map with these roads, content of the header, and elements after the roads. It has no line breaks."""
    return f'<OpenDRIVE><header revMajor="1" revMinor="7">{header}</header>{"".join(roads)}{rest}</OpenDRIVE>'


def lane_xml(number: int, width: float | str = 3.5, *, kind: str = "driving", link: str = "", more: str = "") -> str:
    """Return a lane of constant width [m]; `more` are elements after the width."""
    return (
        f'<lane id="{number}" type="{kind}"><link>{link}</link>'
        f'<width sOffset="0" a="{width}" b="0" c="0" d="0"/>{more}</lane>'
    )


def section_xml(left: str = "", right: str = "", *, s: float = 0, center: str = "") -> str:
    """Return a lane section with the lanes of both sides, from the outside left to the outside right; `center` is
    content of the center lane.
    """
    lefts = f"<left>{left}</left>" if left else ""
    rights = f"<right>{right}</right>" if right else ""
    middle = f'<center><lane id="0" type="none">{center}</lane></center>'
    return f'<laneSection s="{s}">{lefts}{middle}{rights}</laneSection>'


def lanes_xml(left: int = 1, right: int = 1, width: float | str = 3.5, *, s: float = 0, more: str = "") -> str:
    """Return a lane section with a number of equal lanes on both sides."""
    return section_xml(
        "".join(lane_xml(number, width, more=more) for number in range(left, 0, -1)),
        "".join(lane_xml(-number, width, more=more) for number in range(1, right + 1)),
        s=s,
    )


BOTH_WAYS = lanes_xml()
"""Lane section with a lane of 3.5 m in each direction."""


def road_xml(
    number: str = "1",
    *,
    length: float = 100.0,
    x: float = 0.0,
    y: float = 0.0,
    hdg: float = 0.0,
    curvature: float = 0.0,
    geometry: str | None = None,
    link: str = "",
    profiles: str = "",
    lanes: str = BOTH_WAYS,
    extra: str = "",
    junction: str = "-1",
    rule: str = "RHT",
) -> str:
    """Return a road: a line or an arc from x, y [m] with heading `hdg` [rad], or the elements `geometry`.

    `profiles` are elements before the lanes (elevation and lateral profile), `extra` elements after them.
    """
    if geometry is None:
        shape = f'<arc curvature="{curvature!r}"/>' if curvature else "<line/>"
        geometry = f'<geometry s="0" x="{x!r}" y="{y!r}" hdg="{hdg!r}" length="{length!r}">{shape}</geometry>'
    return (
        f'<road id="{number}" name="" length="{length!r}" junction="{junction}" rule="{rule}"><link>{link}</link>'
        f"<planView>{geometry}</planView>{profiles}<lanes>{lanes}</lanes>{extra}</road>"
    )


def ring_xml(radius: float, lanes: str) -> str:
    """Return a map of two roads a and b, half circles around the origin counter-clockwise, with these lanes."""
    return map_xml(
        *(
            road_xml(
                name,
                length=math.pi * radius,
                x=x,
                hdg=hdg,
                curvature=1.0 / radius,
                link=predecessor_xml(other) + successor_xml(other),
                lanes=lanes,
            )
            for name, other, x, hdg in (("a", "b", radius, math.pi / 2), ("b", "a", -radius, -math.pi / 2))
        )
    )


def elevation_xml(height: float = 0.0, slope: float = 0.0, curvature: float = 0.0) -> str:
    """Return an elevation profile: height at s = 0 [m], slope, and half of the second derivative [1/m]."""
    return f'<elevationProfile><elevation s="0" a="{height}" b="{slope}" c="{curvature}" d="0"/></elevationProfile>'


def superelevation_xml(bank: float) -> str:
    """Return a lateral profile of constant superelevation [rad]."""
    return f'<lateralProfile><superelevation s="0" a="{bank}" b="0" c="0" d="0"/></lateralProfile>'


def predecessor_xml(road: str = "", contact: str = "end", *, junction: str = "") -> str:
    """Return the link of a road's start to the end (`contact`) of another road, or to a junction."""
    return _link("predecessor", road, contact, junction)


def successor_xml(road: str = "", contact: str = "start", *, junction: str = "") -> str:
    """Return the link of a road's end to the start (`contact`) of another road, or to a junction."""
    return _link("successor", road, contact, junction)


def _link(kind: str, road: str, contact: str, junction: str) -> str:
    if junction:
        return f'<{kind} elementType="junction" elementId="{junction}"/>'
    return f'<{kind} elementType="road" elementId="{road}" contactPoint="{contact}"/>'


def lane_links_xml(before: int | None = None, after: int | None = None) -> str:
    """Return the links of a lane to lanes of the section before and after it."""
    links = (("predecessor", before), ("successor", after))
    return "".join(f'<{kind} id="{number}"/>' for kind, number in links if number is not None)


def junction_xml(number: str, incoming: str, connecting: Mapping[str, int], *, to: int = -1) -> str:
    """Return a junction: by connecting road, the lane of the incoming road that leads to its lane `to`."""
    connections = "".join(
        f'<connection id="{road}" incomingRoad="{incoming}" connectingRoad="{road}" contactPoint="start">'
        f'<laneLink from="{lane}" to="{to}"/></connection>'
        for road, lane in connecting.items()
    )
    return f'<junction id="{number}" name="">{connections}</junction>'
