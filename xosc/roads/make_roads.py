"""Generator of the road files of the scenario library: `python -m xosc.roads.make_roads` in the checkout."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from lxml import etree

from eidrive_scenario.roads.model import curves
from xosc.roads.crossings import (
    CROSSINGS,
    DRIVING_INNER,
    LANE,
    WALK,
    Arm,
    Crossing,
    LaneSpec,
    Way,
    course,
    ways,
)

CURB = 0.12
CORNER_MARGIN = 2.6
"""Width between the lane of a right turn and the curb in the middle of the turn [m]."""
HOUSES = ((14.0, 10.0, 9.5), (11.0, 9.0, 6.5), (18.0, 12.0, 13.0))
"""Length along the street, depth and height of the houses of a row [m]."""
HOUSE_GAP, SETBACK, CORNER_CLEARANCE = 5.0, 3.0, 14.0
"""Gap between houses, distance from the sidewalk, and distance from the junction [m]."""
SPEED_LIMIT = "50"
PROJECTION = "+proj=tmerc +lat_0=49 +lon_0=8 +k=1 +x_0=0 +y_0=0 +datum=WGS84 +units=m"
"""Projection of the maps, by which V2X messages carry latitude and longitude. The position on Earth is arbitrary."""

Element = etree._Element


def text(value: float) -> str:
    """Return a number in the notation of the files."""
    return f"{value + 0.0:.12g}"


def add(parent: Element, tag: str, **attributes: str | float) -> Element:
    """Append a child element and return it."""
    return etree.SubElement(
        parent, tag, {key.rstrip("_"): text(v) if isinstance(v, float) else str(v) for key, v in attributes.items()}
    )


def add_width(lane: Element, pieces: Sequence[tuple[float, float, float, float, float]]) -> None:
    for s, a, b, c, d in pieces:
        add(lane, "width", sOffset=s, a=a, b=b, c=c, d=d)


def smooth_width(
    start: float, middle: float, end: float, length: float
) -> list[tuple[float, float, float, float, float]]:
    """Return a width that changes smoothly from start over middle to end."""
    pieces = []
    half = length / 2
    for s, a, b in ((0.0, start, middle), (half, middle, end)):
        pieces.append((s, a, 0.0, 3.0 * (b - a) / half**2, -2.0 * (b - a) / half**3))
    return pieces


def add_mark(lane: Element, mark: tuple[str, str]) -> None:
    change = "both" if mark[0] in ("broken", "none") else "none"
    add(lane, "roadMark", sOffset=0.0, type=mark[0], weight="standard", color=mark[1], width=0.13, laneChange=change)


def add_lane(side: Element, number: int, spec: LaneSpec) -> Element:
    lane = add(side, "lane", id=number, type=spec.type, level="false")
    add(lane, "link")
    add_width(lane, [(0.0, spec.width, 0.0, 0.0, 0.0)])
    add_mark(lane, spec.mark)
    if spec.type == "sidewalk":
        add(lane, "height", sOffset=0.0, inner=CURB, outer=CURB)
    return lane


def add_road(root: Element, number: str, name: str, length: float, junction: str) -> tuple[Element, Element, Element]:
    """Append a road with its fixed children. Return the road, its link and its planView."""
    road = add(root, "road", rule="RHT", name=name, length=length, id=number, junction=junction)
    link = add(road, "link")
    kind = add(road, "type", s=0.0, type="town")
    add(kind, "speed", max=SPEED_LIMIT, unit="km/h")
    plan = add(road, "planView")
    add(add(road, "elevationProfile"), "elevation", s=0.0, a=0.0, b=0.0, c=0.0, d=0.0)
    add(road, "lateralProfile")
    return road, link, plan


def write_arm(root: Element, arm: Arm, crossing: Crossing) -> None:
    road, link, plan = add_road(root, arm.id, arm.name, arm.length, "-1")
    add(link, "successor" if arm.contact == "end" else "predecessor", elementType="junction", elementId="100")
    geometry = add(plan, "geometry", s=0.0, x=arm.x, y=arm.y, hdg=arm.heading, length=arm.length)
    add(geometry, "line")
    section = add(add(road, "lanes"), "laneSection", s=0.0)
    left = add(section, "left")
    for i in range(len(arm.street.left), 0, -1):
        add_lane(left, i, arm.street.left[i - 1])
    center = add(add(section, "center"), "lane", id=0, type="none", level="false")
    add(center, "link")
    add_mark(center, arm.street.center)
    right = add(section, "right")
    for i, spec in enumerate(arm.street.right, start=1):
        add_lane(right, -i, spec)
    write_objects_and_signals(road, arm, crossing)


def write_objects_and_signals(road: Element, arm: Arm, crossing: Crossing) -> None:
    """Add crosswalk, stop line, and stop sign or traffic light for the traffic that enters the junction."""
    sign = arm.approach
    end, back = (arm.length, -1.0) if arm.contact == "end" else (0.0, 1.0)
    curbs = [side * (arm.street.edge(side) + arm.street.verge(side)) for side in (-1, 1)]
    inner = min(abs(arm.street.center_of(lane)) for lane in arm.street.driving(sign)) - LANE / 2
    lanes = arm.street.driving(sign)
    objects = add(road, "objects")
    write_area(objects, "0", "crosswalk", end + back * 0.8, end + back * 3.8, curbs[0], curbs[1])
    write_area(objects, "1", "roadMark", end + back * 5.0, end + back * 5.4, sign * inner, sign * arm.street.edge(sign))
    write_buildings(objects, arm)
    kind = ("1000001", "-1", "yes", 0.86, 0.3, "light") if crossing.lights else ("206", "-1", "no", 0.75, 0.75, "stop")
    signal = add(
        add(road, "signals"),
        "signal",
        s=end + back * 4.4,
        t=sign * (arm.street.edge(sign) + arm.street.verge(sign) + 0.5),
        id=f"{arm.id}0",
        name=f"{kind[5]} {arm.name}",
        dynamic=kind[2],
        orientation="+" if sign < 0 else "-",
        zOffset=2.4,
        country="DE",
        type=kind[0],
        subtype=kind[1],
        height=kind[3],
        width=kind[4],
        hOffset=0.0,
        pitch=0.0,
        roll=0.0,
    )
    add(signal, "validity", fromLane=min(lanes), toLane=max(lanes))


def write_buildings(objects: Element, arm: Arm) -> None:
    """Add a row of houses on each side, set back from the sidewalk and away from the corners of the junction."""
    for side in (-1, 1):
        curb = sum(spec.width for spec in arm.street.side(side))
        from_junction = CORNER_CLEARANCE
        for number, (length, depth, height) in enumerate(HOUSES if side > 0 else reversed(HOUSES)):
            middle = from_junction + length / 2
            add(
                objects,
                "object",
                id=f"{2 if side > 0 else 3}{number}",
                name=f"house {arm.name} {'left' if side > 0 else 'right'} {number + 1}",
                type="building",
                s=arm.length - middle if arm.contact == "end" else middle,
                t=side * (curb + SETBACK + depth / 2),
                zOffset=0.0,
                orientation="none",
                length=length,
                width=depth,
                height=height,
                hdg=0.0,
                pitch=0.0,
                roll=0.0,
            )
            from_junction += length + HOUSE_GAP


def write_area(objects: Element, number: str, kind: str, s: float, s_end: float, t: float, t_end: float) -> None:
    """Add a painted area of the road between two s and two t."""
    middle, across = (s + s_end) / 2, (t + t_end) / 2
    item = add(
        objects,
        "object",
        id=number,
        name=kind,
        type=kind,
        s=middle,
        t=across,
        zOffset=0.0,
        orientation="none",
        length=abs(s_end - s),
        width=abs(t_end - t),
        height=0.0,
        hdg=0.0,
        pitch=0.0,
        roll=0.0,
    )
    outline = add(add(item, "outlines"), "outline", id=0, fillType="paint", closed="true")
    for i, (corner_s, corner_t) in enumerate(((s, t), (s_end, t), (s_end, t_end), (s, t_end))):
        add(outline, "cornerRoad", id=i, s=corner_s, t=corner_t, dz=0.0, height=0.0)


def write_way(root: Element, number: str, way: Way) -> None:
    line = course(way)
    length = sum(curve.length for curve in line)
    road, link, plan = add_road(root, number, f"{way.start.name} {way.turn}", length, "100")
    for tag, arm in (("predecessor", way.start), ("successor", way.end)):
        add(link, tag, elementType="road", elementId=arm.id, contactPoint=arm.contact)
    for curve in line:
        geometry = add(plan, "geometry", s=curve.s, x=curve.x, y=curve.y, hdg=curve.h, length=curve.length)
        if isinstance(curve, curves.Spiral):
            add(geometry, "spiral", curvStart=curve.curvature, curvEnd=curve.curvature + curve.rate * curve.length)
        elif isinstance(curve, curves.Arc) and curve.curvature:
            add(geometry, "arc", curvature=curve.curvature)
        else:
            add(geometry, "line")
    lanes = add(road, "lanes")
    add(lanes, "laneOffset", s=0.0, a=LANE / 2, b=0.0, c=0.0, d=0.0)
    section = add(lanes, "laneSection", s=0.0)
    center = add(add(section, "center"), "lane", id=0, type="none", level="false")
    add(center, "link")
    add_mark(center, ("none", "white"))
    if way.turn == "ahead" and way.start.street.left[0].type == "bidirectional":
        # Each of the two straight connecting roads covers half of the middle lane, which ends at the junction.
        left = etree.Element("left")
        section.insert(0, left)
        add_lane(left, 1, LaneSpec("bidirectional", LANE / 2))
    right = add(section, "right")
    for i, (before, after) in enumerate(way.lanes, start=1):
        lane = add_lane(right, -i, replace(DRIVING_INNER, mark=("none", "white")))
        ends = lane.find("link")
        assert ends is not None
        add(ends, "predecessor", id=before)
        add(ends, "successor", id=after)
    if way.turn == "right":
        write_corner(right, way, length)


def write_corner(right: Element, way: Way, length: float) -> None:
    """Add the margin between the lane of a right turn and the curb, then the sidewalk."""
    start = way.start.street.verge(way.start.approach)
    end = way.end.street.verge(-way.end.approach)
    margin = add_lane(right, -2, LaneSpec("shoulder", start, ("curb", "standard")))
    for old in margin.findall("width"):
        margin.remove(old)
    for i, (s, a, b, c, d) in enumerate(smooth_width(start, CORNER_MARGIN, end, length)):
        width = etree.Element("width")
        for key, value in (("sOffset", s), ("a", a), ("b", b), ("c", c), ("d", d)):
            width.set(key, text(value))
        margin.insert(1 + i, width)
    add_lane(right, -3, WALK)


def write(crossing: Crossing, path: Path) -> None:
    """Write the OpenDRIVE file of a crossing."""
    arms = crossing.arms()
    near_end, far_end, right_end, left_end = crossing.reach
    root = etree.Element("OpenDRIVE")
    header = add(
        root,
        "header",
        revMajor=1,
        revMinor=6,
        name=crossing.name,
        version="1.00",
        date="2025-01-01T00:00:00",
        north=left_end,
        south=right_end,
        east=far_end,
        west=near_end,
        vendor="eidrive-scenario",
    )
    add(header, "geoReference").text = etree.CDATA(PROJECTION)
    for arm in arms.values():
        write_arm(root, arm, crossing)
    found = [(str(101 + i), way) for i, way in enumerate(ways(arms))]
    for number, way in found:
        write_way(root, number, way)
    if crossing.lights:
        for number, pair in (("1", ("1", "2")), ("2", ("3", "4"))):
            controller = add(root, "controller", id=number, name=f"phase {number}", sequence=int(number) - 1)
            for arm_id in pair:
                add(controller, "control", signalId=f"{arm_id}0", type="0")
    junction = add(root, "junction", id="100", name=crossing.name, type="default")
    for i, (number, way) in enumerate(found):
        connection = add(
            junction, "connection", id=i, incomingRoad=way.start.id, connectingRoad=number, contactPoint="start"
        )
        for lane, (before, _) in enumerate(way.lanes, start=1):
            add(connection, "laneLink", from_=before, to=-lane)
    if crossing.lights:
        for i, number in enumerate(("1", "2")):
            add(junction, "controller", id=number, type="0", sequence=i)
    tree = etree.ElementTree(root)
    etree.indent(tree, "  ")
    text = etree.tostring(tree, xml_declaration=True, encoding="UTF-8")
    path.write_bytes(text + b"\n")


def main() -> None:
    for crossing in CROSSINGS:
        write(crossing, Path(__file__).parent / f"{crossing.name}.xodr")


if __name__ == "__main__":
    main()
