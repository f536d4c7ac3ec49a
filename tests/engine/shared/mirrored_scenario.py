"""Scenarios and maps mirrored at the x axis: left and right, and the side of the traffic, are exchanged."""

from __future__ import annotations

import re
from pathlib import Path

from lxml import etree

Node = etree._Element

LATERAL = {
    "WorldPosition": ("y", "h"),
    "RelativeWorldPosition": ("dy",),
    "RelativeObjectPosition": ("dy",),
    "RoadPosition": ("t",),
    "LanePosition": ("laneId", "offset"),
    "RelativeLanePosition": ("dLane", "offset"),
    "AbsoluteTargetLane": ("value",),
    "RelativeTargetLane": ("value",),
    "Orientation": ("h",),
}
"""Attributes of a scenario with a direction to the left or a lane number."""
SCENES = {
    "parked_car_with_room": "pass car on the left",
    "parked_car_without_room": "pass truck on the left",
    "oncoming_overtaker": None,
    "slow_truck": "change lane to the left",
    "merging": None,
    "left_turn": None,
    "roundabout": None,
}
"""Scenes `driving/*` that are driven on both sides, with a maneuver of the ego."""
NUMBER = r"[-+]?[\d.]+"


def negate(node: Node, *names: str) -> None:
    for name in names:
        if node.get(name) is not None:
            node.set(name, repr(-float(node.attrib[name])))


def negate_lane(node: Node, *names: str) -> None:
    for name in names:
        if node.get(name) is not None:
            node.set(name, str(-int(node.attrib[name])))


def mirror_road(road: Node) -> None:
    for node in road.iter("geometry"):
        negate(node, "y", "hdg")
    for node in road.iter("arc", "spiral"):
        negate(node, "curvature", "curvStart", "curvEnd")
    for node in road.iter("laneOffset"):
        negate(node, "a", "b", "c", "d")
    for node in road.iter("object", "cornerRoad", "signal"):
        negate(node, "t", "hdg", "hOffset")
    for node in road.iter("validity"):
        negate_lane(node, "fromLane", "toLane")
        first, last = node.attrib["fromLane"], node.attrib["toLane"]
        node.set("fromLane", last)
        node.set("toLane", first)
    for node in road.iter("laneLink"):
        negate_lane(node, "from", "to")
    for node in road.iter("road"):
        node.set("rule", "LHT" if node.get("rule", "RHT") == "RHT" else "RHT")
    for section in road.iter("laneSection"):
        for lane in section.iter("lane"):
            negate_lane(lane, "id")
            for link in lane.iter("predecessor", "successor"):
                negate_lane(link, "id")
        sides = {side.tag: side for side in section if side.tag in ("left", "right")}
        for side in sides.values():
            side[:] = list(reversed(side))
            side.tag = "right" if side.tag == "left" else "left"
        section[:] = sorted(section, key=lambda side: ["left", "center", "right"].index(side.tag))


def mirror_positions(scenario: Node) -> None:
    """Mirror positions, orientations and lanes; their values may be expressions."""
    for tag, names in LATERAL.items():
        for node in scenario.iter(tag):
            for name in names:
                value = node.get(name)
                if value is not None:
                    node.set(name, _negated(value))


def mirror_areas(scenario: Node) -> None:
    """Mirror the areas and places of controllers and criteria."""
    for node in scenario.iter("Property"):
        if node.get("name") == "conflict_area":
            x0, x1, y0, y1 = map(float, node.get("value", "").strip("[]").split(","))
            node.set("value", f"{[x0, x1, -y1, -y0]}")
    for node in scenario.iter("CustomCommandAction"):
        if node.get("type") == "eidrive.criterion":
            node.text = re.sub(rf"\by: ({NUMBER})", lambda found: f"y: {-float(found[1])}", node.text or "")


def write_mirrored(source: Path, folder: Path) -> Path:
    """Write a scenario of the library and its map, mirrored at the x axis; return the scenario."""
    scenario = etree.parse(source)
    (logic,) = scenario.getroot().iter("LogicFile")
    roads = etree.parse(source.parent / logic.get("filepath", ""))
    mirror_road(roads.getroot())
    roads.write(folder / "mirrored.xodr", xml_declaration=True, encoding="UTF-8")
    logic.set("filepath", "mirrored.xodr")
    for node in scenario.getroot().iter("Directory"):
        node.set("path", str((source.parent / node.get("path", "")).resolve()))
    mirror_positions(scenario.getroot())
    mirror_areas(scenario.getroot())
    path = folder / "mirrored.xosc"
    scenario.write(path, xml_declaration=True, encoding="UTF-8")
    return path


def _negated(value: str) -> str:
    """Return the negative of a number or of an expression."""
    if value.startswith("${"):
        return f"${{0 - ({value[2:-1]})}}"
    if value.startswith("$"):
        return f"${{0 - {value}}}"
    return str(-int(value)) if re.fullmatch(r"[-+]?\d+", value) else repr(-float(value))
