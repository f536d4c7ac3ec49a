"""Generator of the road files of the scenario library: `python -m xosc.roads.make_roads` in the checkout."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

from lxml import etree

from xosc.roads.coop_crossings import COOP_CROSSINGS
from xosc.roads.coop_sites import COOP_SITES
from xosc.roads.courses import course
from xosc.roads.ei_sites import EI_SITES
from xosc.roads.furniture import signal_ids, write_objects_and_signals
from xosc.roads.junctions_and_roads import JUNCTIONS_AND_ROADS
from xosc.roads.layout import Arm, Junction, LaneSpec, Layout, Road, Way
from xosc.roads.opendrive import Element, add, add_lane, add_line, add_mark, add_road, smooth_change, smooth_width, text

LAYOUTS: tuple[Layout, ...] = (*COOP_SITES, *COOP_CROSSINGS, *EI_SITES, *JUNCTIONS_AND_ROADS)
"""All road networks of the library."""
CORNER_MARGIN = 2.6
"""Width between the lane of a right turn and the curb in the middle of the turn [m]."""
PROJECTION = "+proj=tmerc +lat_0=49 +lon_0=8 +k=1 +x_0=0 +y_0=0 +datum=WGS84 +units=m"
"""Projection of the maps, by which V2X messages carry latitude and longitude. The position on Earth is arbitrary."""


def write(layout: Layout, path: Path) -> None:
    """Write the OpenDRIVE file of a road network."""
    root = etree.Element("OpenDRIVE")
    write_header(root, layout)
    for road in layout.roads:
        write_road(root, road, layout)
    for junction in layout.junctions:
        for number, way in numbered(junction):
            write_way(root, number, way, junction, layout)
    controllers = write_controllers(root, layout)
    for junction in layout.junctions:
        write_junction(root, junction, controllers[junction.id])
    tree = etree.ElementTree(root)
    etree.indent(tree, "  ")
    content = etree.tostring(tree, xml_declaration=True, encoding="UTF-8")
    path.write_bytes(content + b"\n")


def numbered(junction: Junction) -> list[tuple[str, Way]]:
    """Return the connecting roads of a junction with their ids."""
    return [(str(int(junction.id) + 1 + i), way) for i, way in enumerate(junction.ways)]


def write_header(root: Element, layout: Layout) -> None:
    west, south, east, north = layout.bounds or reference_line_bounds(layout)
    header = add(
        root,
        "header",
        revMajor=1,
        revMinor=6,
        name=layout.name,
        version="1.00",
        date="2025-01-01T00:00:00",
        north=north,
        south=south,
        east=east,
        west=west,
        vendor="eidrive-scenario",
    )
    add(header, "geoReference").text = etree.CDATA(PROJECTION)


def reference_line_bounds(layout: Layout) -> tuple[float, float, float, float]:
    """Return west, south, east and north end of the reference lines outside junctions [m], rounded outwards."""
    points = [curve.at(curve.length * part / 8) for road in layout.roads for curve in road.line for part in range(9)]
    x, y = [point.x for point in points], [point.y for point in points]
    west, south = (float(math.floor(min(values))) for values in (x, y))
    east, north = (float(math.ceil(max(values))) for values in (x, y))
    return west, south, east, north


def write_road(root: Element, road: Road, layout: Layout) -> None:
    """Append a road outside junctions."""
    item, link, plan = add_road(
        root, road.id, road.name, road.length, "-1", layout.kind, layout.speed_limit, road.profile
    )
    for tag, contact in (("predecessor", "start"), ("successor", "end")):
        for junction in layout.junctions:
            if any(arm.road.id == road.id and arm.contact == contact for arm in junction.arms):
                add(link, tag, elementType="junction", elementId=junction.id)
    add_line(plan, road.line)
    write_sections(add(item, "lanes"), road)
    write_objects_and_signals(item, arms_of(layout, road.id), road)


def write_sections(lanes: Element, road: Road) -> None:
    """Append the lane sections of a road, with the offset of lane 0 where it is not 0."""
    ends = [*(section.s for section in road.sections[1:]), road.length]
    if any(section.offset != (0.0, 0.0) for section in road.sections):
        for section, end in zip(road.sections, ends, strict=True):
            s, a, b, c, d = smooth_change(*section.offset, end - section.s, section.s)
            add(lanes, "laneOffset", s=s, a=a, b=b, c=c, d=d)
    for number, (section, end) in enumerate(zip(road.sections, ends, strict=True)):
        item = add(lanes, "laneSection", s=section.s)
        left = add(item, "left")
        for i in range(len(section.street.left), 0, -1):
            add_lane(left, i, section.street.left[i - 1], end - section.s)
        center = add(add(item, "center"), "lane", id=0, type="none", level="false")
        add(center, "link")
        add_mark(center, section.street.center)
        right = add(item, "right")
        for i, spec in enumerate(section.street.right, start=1):
            add_lane(right, -i, spec, end - section.s)
        if number:
            link_sections(lanes[-2], item, dict(section.previous))


def link_sections(before: Element, after: Element, previous: dict[int, int]) -> None:
    """Link the lanes of consecutive sections: those of the same number, or as `previous` states."""
    old = {lane.get("id"): lane for lane in before.iter("lane")}
    for lane in after.iter("lane"):
        number = int(lane.get("id", "0"))
        other = old.get(str(previous.get(number, number)))
        if number and other is not None and other.get("id") != "0":
            add(lane[0], "predecessor", id=other.get("id", ""))
            add(other[0], "successor", id=number)


def write_way(root: Element, number: str, way: Way, junction: Junction, layout: Layout) -> None:
    """Append a connecting road."""
    line = course(way)
    length = sum(curve.length for curve in line)
    name = f"{way.start.name} {way.turn}"
    road, link, plan = add_road(root, number, name, length, junction.id, layout.kind, layout.speed_limit)
    for tag, arm in (("predecessor", way.start), ("successor", way.end)):
        add(link, tag, elementType="road", elementId=arm.road.id, contactPoint=arm.contact)
    add_line(plan, line)
    specs = [lane_between(way, before, after) for before, after in way.lanes]
    lanes = add(road, "lanes")
    s, a, b, c, d = smooth_change(specs[0].width / 2, specs[0].width_at_end / 2, length)
    add(lanes, "laneOffset", s=s, a=a, b=b, c=c, d=d)
    section = add(lanes, "laneSection", s=0.0)
    if way.left:
        left = add(section, "left")
        for i in range(len(way.left), 0, -1):
            add_lane(left, i, way.left[i - 1])
    center = add(add(section, "center"), "lane", id=0, type="none", level="false")
    add(center, "link")
    add_mark(center, ("none", "white"))
    right = add(section, "right")
    for i, (spec, (before, after)) in enumerate(zip(specs, way.lanes, strict=True), start=1):
        lane = add_lane(right, -i, spec, length)
        add(lane[0], "predecessor", id=before)
        add(lane[0], "successor", id=after)
    for i, spec in enumerate(way.right, start=len(specs) + 1):
        add_lane(right, -i, spec)
    if way.curb == "corner":
        write_corner(right, way, length)
    elif way.curb == "straight":
        for i, spec in enumerate(way.start.street.beyond(way.start.approach), start=len(specs) + 1):
            add_lane(right, -i, replace(spec, type="shoulder") if spec.type == "parking" else spec)


def lane_between(way: Way, before: int, after: int) -> LaneSpec:
    """Return the lane of a connecting road that continues one lane in another."""
    width, end = way.start.street.lane(before).width_at_end, way.end.street.lane(after).width
    return LaneSpec("driving", width, end=end)


def write_corner(right: Element, way: Way, length: float) -> None:
    """Add the margin between the lane of a right turn and the curb, then the sidewalk."""
    start, end = way.start.street, way.end.street
    entering, leaving = way.start.approach, -way.end.approach
    first, last = start.verge(entering), end.verge(leaving)
    margin = add_lane(right, -len(way.lanes) - 1, LaneSpec("shoulder", first, ("curb", "standard")))
    for old in margin.findall("width"):
        margin.remove(old)
    for i, (s, a, b, c, d) in enumerate(smooth_width(first, CORNER_MARGIN, last, length)):
        width = etree.Element("width")
        for key, value in (("sOffset", s), ("a", a), ("b", b), ("c", c), ("d", d)):
            width.set(key, text(value))
        margin.insert(1 + i, width)
    walks = [
        sum(lane.width for lane in street.beyond(side) if lane.type == "sidewalk")
        for street, side in ((start, entering), (end, leaving))
    ]
    if all(walks):
        add_lane(right, -len(way.lanes) - 2, LaneSpec("sidewalk", walks[0], end=walks[1]), length)


def arms_of(layout: Layout, road: str) -> list[Arm]:
    """Return the ends of a road that are at junctions."""
    return [arm for junction in layout.junctions for arm in junction.arms if arm.road.id == road]


def write_controllers(root: Element, layout: Layout) -> dict[str, list[str]]:
    """Append a controller per phase. Return the ids of the controllers of each junction."""
    found: dict[str, list[str]] = {junction.id: [] for junction in layout.junctions}
    number = 0
    for junction in layout.junctions:
        for sequence, roads in enumerate(junction.phases):
            number += 1
            found[junction.id].append(str(number))
            controller = add(root, "controller", id=number, name=f"phase {number}", sequence=sequence)
            for road in roads:
                for signal in signal_ids(arms_of(layout, road), junction):
                    add(controller, "control", signalId=signal, type="0")
    return found


def write_junction(root: Element, item: Junction, controllers: list[str]) -> None:
    """Append a junction with its connections and controllers."""
    junction = add(root, "junction", id=item.id, name=item.name, type="default")
    for i, (number, way) in enumerate(numbered(item)):
        connection = add(
            junction, "connection", id=i, incomingRoad=way.start.road.id, connectingRoad=number, contactPoint="start"
        )
        for lane, (before, _) in enumerate(way.lanes, start=1):
            add(connection, "laneLink", from_=before, to=-lane)
    for i, number in enumerate(controllers):
        add(junction, "controller", id=number, type="0", sequence=i)


def main() -> None:
    for layout in LAYOUTS:
        write(layout, Path(__file__).parent / f"{layout.name}.xodr")


if __name__ == "__main__":
    main()
