"""Elements of OpenDRIVE files: numbers, lanes, widths, road marks and reference lines."""

from __future__ import annotations

from collections.abc import Sequence

from lxml import etree

from eidrive_scenario.roads.model import curves
from xosc.roads.layout import LaneSpec, Slope

CURB = 0.12
"""Height of a sidewalk [m]."""

Element = etree._Element
Width = tuple[float, float, float, float, float]
"""Start of a piece of a width and the coefficients of its cubic."""


def text(value: float) -> str:
    """Return a number in the notation of the files."""
    return f"{value + 0.0:.12g}"


def add(parent: Element, tag: str, **attributes: str | float) -> Element:
    """Append a child element and return it."""
    return etree.SubElement(
        parent, tag, {key.rstrip("_"): text(v) if isinstance(v, float) else str(v) for key, v in attributes.items()}
    )


def add_width(lane: Element, pieces: Sequence[Width]) -> None:
    """Append a width of cubic pieces to a lane."""
    for s, a, b, c, d in pieces:
        add(lane, "width", sOffset=s, a=a, b=b, c=c, d=d)


def smooth_change(start: float, end: float, length: float, s: float = 0.0) -> Width:
    """Return a cubic from one value to another with zero slope at both ends."""
    return (s, start, 0.0, 3.0 * (end - start) / length**2, -2.0 * (end - start) / length**3)


def smooth_width(start: float, middle: float, end: float, length: float) -> list[Width]:
    """Return a width that changes smoothly from start over middle to end."""
    half = length / 2
    return [smooth_change(start, middle, half), smooth_change(middle, end, half, half)]


def add_mark(lane: Element, mark: tuple[str, str]) -> None:
    """Append a road mark (type, color) to a lane; lanes may be changed across broken marks and where there is none."""
    change = "both" if mark[0] in ("broken", "none") else "none"
    add(lane, "roadMark", sOffset=0.0, type=mark[0], weight="standard", color=mark[1], width=0.13, laneChange=change)


def add_lane(side: Element, number: int, spec: LaneSpec, length: float = 0.0) -> Element:
    """Append a lane; its width changes over `length` [m] if the specification has another one at the end."""
    lane = add(side, "lane", id=number, type=spec.type, level="false")
    add(lane, "link")
    changes = spec.width_at_end != spec.width
    add_width(
        lane, [smooth_change(spec.width, spec.width_at_end, length) if changes else (0.0, spec.width, 0.0, 0.0, 0.0)]
    )
    add_mark(lane, spec.mark)
    if spec.type == "sidewalk":
        add(lane, "height", sOffset=0.0, inner=CURB, outer=CURB)
    return lane


def add_road(
    root: Element,
    number: str,
    name: str,
    length: float,
    junction: str,
    kind: str = "town",
    speed_limit: str = "50",
    profile: Sequence[Slope] = (),
) -> tuple[Element, Element, Element]:
    """Append a road with its fixed children. Return the road, its link and its planView."""
    road = add(root, "road", rule="RHT", name=name, length=length, id=number, junction=junction)
    link = add(road, "link")
    add(add(road, "type", s=0.0, type=kind), "speed", max=speed_limit, unit="km/h")
    plan = add(road, "planView")
    add_elevation(add(road, "elevationProfile"), profile)
    add(road, "lateralProfile")
    return road, link, plan


def add_elevation(element: Element, profile: Sequence[Slope]) -> None:
    """Append the pieces of an elevation profile, a level one by default."""
    s, z, grade = 0.0, 0.0, 0.0
    for part in profile:
        change = (part.grade - grade) / (2.0 * part.length)
        add(element, "elevation", s=s, a=z, b=grade, c=change, d=0.0)
        s, z, grade = s + part.length, z + (grade + part.grade) / 2.0 * part.length, part.grade
    add(element, "elevation", s=s, a=z, b=grade, c=0.0, d=0.0)


def add_line(plan: Element, line: Sequence[curves.Curve]) -> None:
    """Append the curves of a reference line to a planView."""
    for curve in line:
        geometry = add(plan, "geometry", s=curve.s, x=curve.x, y=curve.y, hdg=curve.h, length=curve.length)
        if isinstance(curve, curves.Spiral):
            add(geometry, "spiral", curvStart=curve.curvature, curvEnd=curve.curvature + curve.rate * curve.length)
        elif isinstance(curve, curves.Arc) and curve.curvature:
            add(geometry, "arc", curvature=curve.curvature)
        else:
            add(geometry, "line")
