"""Reader of <signals>, <objects> and <controller>."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Literal

from lxml import etree
from msgspec.structs import replace

from eidrive_scenario.base.tolerances import EPSILON
from eidrive_scenario.roads.geometry.poses import BEYOND
from eidrive_scenario.roads.model.map_warnings import MapRule
from eidrive_scenario.roads.model.road_map import (
    Corner,
    Repeat,
    Road,
    RoadObject,
    Signal,
    SignalController,
    SignalPlace,
)
from eidrive_scenario.roads.reading.attribute_reader import AttributeReader

_CATALOG_NUMBER = re.compile(r"^(1)\.(0\d\d)\.(\d{3})$")
"""Type of the OpenDRIVE signal catalog as its documents print it, for example 1.000.001 for 1000001."""
MAX_REPETITIONS = 100_000
"""Maximum number of repetitions of an object."""
MAX_OBJECTS = 200_000
"""Maximum number of all objects including repetitions."""
MAX_OBJECT_SIZE = 1e5
"""Maximum length, width, height or radius of an object [m]."""
MAX_OBJECT_DISTANCE = 1e6
"""Maximum distance of an object or its outline from its position on the road [m]."""


def read_signals(
    elements: list[tuple[str, etree._Element]], roads: Mapping[str, Road], collector: AttributeReader
) -> dict[str, Signal]:
    """Return the signals of all roads by id, with the references of other roads to them.

    Some maps use one id for several signals; the second one is stored as 'id#2', and so on.
    """
    signals: dict[str, Signal] = {}
    same_id: dict[str, int] = {}
    references: list[tuple[str, SignalPlace, etree._Element]] = []
    for number, element in elements:
        road = roads[number]
        for signal in element.iterfind("signals/signal"):
            read = _read_signal(road, signal, collector)
            same = same_id[read.id] = same_id.get(read.id, 0) + 1
            key = read.id
            while key in signals:
                key, same = f"{read.id}#{same}", same + 1
            signals[key] = read
        for reference in element.iterfind("signals/signalReference"):
            references.append((collector.text(reference, "id"), _read_place(road, reference, collector), reference))
    for number, position, reference in references:
        if number in signals:
            signals[number] = replace(signals[number], references=(*signals[number].references, position))
        else:
            message = f"<signalReference> refers to signal {number!r}, which does not exist"
            collector.report_error(reference, message, "correct the id")
    return signals


def _read_place(road: Road, element: etree._Element, collector: AttributeReader) -> SignalPlace:
    orientation = element.get("orientation", "none")
    s = _s_on_road(road, element, collector, "signal", MapRule.SIGNAL_OFF_ROAD)
    return SignalPlace(
        road=road.id,
        s=s,
        t=collector.number(element, "t"),
        orientation=orientation if orientation in ("+", "-") else "none",
        validity=tuple(_read_validity(road, s, v, collector) for v in element.iterfind("validity")),
    )


def _read_validity(road: Road, s: float, element: etree._Element, collector: AttributeReader) -> tuple[int, int]:
    """Return the first and the last lane for which a signal is valid. Lane 0 alone stands for no lane."""
    first, last = (collector.integer(element, name) for name in ("fromLane", "toLane"))
    lanes = road.section_at(s).lanes if road.sections else {}
    if lanes and not any(min(first, last) <= number <= max(first, last) for number in lanes):
        which = f"lane {first}, which does" if first == last else f"lanes {first} to {last}, which do"
        message = f"a signal at s = {s:g} m of road {road.id!r} is valid for {which} not exist there"
        hint = "known: " + ", ".join(map(str, sorted(lanes)))
        kind = "signals for lanes that do not exist"
        collector.report_warning(element, MapRule.SIGNAL_OFF_ROAD, kind, message, hint)
    return first, last


def _s_on_road(
    road: Road,
    element: etree._Element,
    collector: AttributeReader,
    noun: Literal["signal", "object"],
    rule: MapRule,
) -> float:
    """Return the s coordinate of an element [m], that of the nearest end of the road if it is beyond it."""
    s = collector.number(element, "s")
    held = min(max(s, 0.0), road.length)
    if abs(s - held) > BEYOND:
        article = "an" if noun == "object" else "a"
        message = f"{article} {noun} is at s = {s:g} m of road {road.id!r}; s = {held:g} m is used"
        kind = f"{noun}s beyond the ends of their roads"
        collector.report_warning(element, rule, kind, message, f"the road extends from 0 to {road.length:g} m")
    return held


def _read_signal(road: Road, element: etree._Element, collector: AttributeReader) -> Signal:
    return Signal(
        id=collector.text(element, "id"),
        name=element.get("name", ""),
        type=_CATALOG_NUMBER.sub(r"\1\2\3", collector.text(element, "type")),
        subtype=element.get("subtype", ""),
        country=element.get("country", ""),
        value=collector.number(element, "value", None),
        unit=element.get("unit", ""),
        text=element.get("text", ""),
        dynamic=collector.flag(element, "dynamic"),
        place=_read_place(road, element, collector),
        z_offset=collector.number(element, "zOffset", 0.0),
        h_offset=collector.number(element, "hOffset", 0.0),
        width=collector.number(element, "width", 0.0),
        height=collector.number(element, "height", 0.0),
    )


def read_controllers(
    root: etree._Element, signals: dict[str, Signal], collector: AttributeReader
) -> dict[str, SignalController]:
    """Return groups of signals by id."""
    controllers = {}
    for element in root.iterfind("controller"):
        members = []
        for control in element.iterfind("control"):
            number = collector.text(control, "signalId")
            if number not in signals:
                message = f"<control> refers to signal {number!r}, which does not exist"
                collector.report_error(control, message, "correct the id")
            members.append(number)
        number = collector.text(element, "id")
        if number in controllers:
            collector.report_error(element, f"controller {number!r} occurs twice", "give each controller a unique id")
        controllers[number] = SignalController(number, element.get("name", ""), tuple(members))
    return controllers


def read_object(road: Road, element: etree._Element, collector: AttributeReader) -> RoadObject:
    """Return an object of a road."""

    def number(name: str) -> float:
        return collector.number(element, name, 0.0)

    sizes, distances = ("length", "width", "height", "radius"), ("t", "zOffset")
    limits = {name: (MAX_OBJECT_SIZE, "give at most") for name in sizes}
    limits |= {name: (MAX_OBJECT_DISTANCE, "give a number within") for name in distances}
    for name, (limit, hint) in limits.items():
        if abs(number(name)) > limit:
            collector.report_error(element, f"<object> has {name}={number(name):g}", f"{hint} {limit:g}")
    collector.spend(element, "objects", 1, MAX_OBJECTS)
    repeats = tuple(_read_repeat(road, repeat, element, collector) for repeat in element.iterfind("repeat"))
    s = collector.number(element, "s")
    if not repeats:
        s = _s_on_road(road, element, collector, "object", MapRule.OBJECT_OFF_ROAD)
    areas: list[tuple[Corner, ...]] = []
    lines: list[tuple[Corner, ...]] = []
    for outline in (*element.iterfind("outline"), *element.iterfind("outlines/outline")):
        is_line = outline.get("closed") is not None and not collector.flag(outline, "closed")
        corners = tuple(_read_corners(outline, collector))
        if len(corners) >= (2 if is_line else 3):
            (lines if is_line else areas).append(corners)
    return RoadObject(
        id=element.get("id", ""),
        name=element.get("name", ""),
        type=element.get("type", "none"),
        subtype=element.get("subtype", ""),
        road=road.id,
        s=s,
        t=collector.number(element, "t"),
        z_offset=number("zOffset"),
        heading=number("hdg"),
        pitch=number("pitch"),
        roll=number("roll"),
        length=_read_size(element, "length", collector),
        width=_read_size(element, "width", collector),
        height=_read_size(element, "height", collector),
        radius=_read_size(element, "radius", collector),
        outlines=tuple(areas),
        lines=tuple(lines),
        repeats=repeats,
    )


def _read_size(element: etree._Element, name: str, collector: AttributeReader, default: float = 0.0) -> float:
    """Return a size of an object [m]; 0, as of an omitted one, if it is negative."""
    size = collector.number(element, name, default)
    if size < 0.0:
        message = f"<{element.tag}> has {name}={size:g}, which counts as omitted"
        hint = "give a size of at least 0"
        collector.report_warning(element, MapRule.OBJECT_SIZE, "negative sizes of objects", message, hint)
    return max(size, 0.0)


def _read_corners(outline: etree._Element, collector: AttributeReader) -> list[Corner]:
    coordinates = {"cornerRoad": ("s", "t", "dz"), "cornerLocal": ("u", "v", "z")}
    corners = []
    for corner in outline:
        if corner.tag not in coordinates:
            continue
        *names, up = coordinates[corner.tag]
        x, y, z = *(collector.number(corner, name) for name in names), collector.number(corner, up, 0.0)
        if max(abs(x), abs(y), abs(z)) > MAX_OBJECT_DISTANCE:
            message = f"<{corner.tag}> is further away than {MAX_OBJECT_DISTANCE:g} m"
            collector.report_error(corner, message, "correct its position")
            continue
        corners.append(Corner(corner.tag == "cornerRoad", x, y, z, collector.number(corner, "height", 0.0)))
    return corners


def _read_repeat(road: Road, repeat: etree._Element, element: etree._Element, collector: AttributeReader) -> Repeat:
    def pair(name: str) -> tuple[float, float]:
        fallback = collector.number(element, name, 0.0)
        if name in ("t", "zOffset"):
            start = collector.number(repeat, f"{name}Start", fallback)
            end = collector.number(repeat, f"{name}End", start)
        else:
            start = _read_size(repeat, f"{name}Start", collector, max(fallback, 0.0))
            end = _read_size(repeat, f"{name}End", collector, start)
        begins, ends = (end if share == 1.0 else start + (end - start) * share for share in on_road)
        return begins, ends

    on_road = 0.0, 1.0  # shares of the length between which it is on the road
    length, distance = collector.number(repeat, "length"), collector.number(repeat, "distance", 0.0)
    step = distance if distance > 0.0 else 1.0
    if length > MAX_REPETITIONS * step:
        message = f"<repeat> has length={length:g} and distance={distance:g}: too many repetitions"
        collector.report_error(repeat, message, f"at most {MAX_REPETITIONS} repetitions are read")
        length = 0.0
    collector.spend(repeat, "positions of objects", max(length, 0.0) / step, MAX_OBJECTS)
    s = collector.number(repeat, "s", collector.number(element, "s", 0.0))
    last = s + (distance * math.floor(length / distance + EPSILON) if distance > 0.0 else length)
    before, after = s < -BEYOND, last > road.length + BEYOND
    if (before or after) and distance > 0.0:
        place, end = (f"from s = {s:g} m", "starts") if before else (f"to s = {last:g} m", "ends")
        message = f"an object is repeated {place} of road {road.id!r}; the repetition {end} with the road"
        hint = f"the road {end} at {0.0 if before else road.length:g} m"
        collector.report_warning(
            repeat, MapRule.OBJECT_OFF_ROAD, "repetitions beyond the ends of their roads", message, hint
        )
    if s > road.length + BEYOND or last < -BEYOND:
        length = distance = 0.0
    elif (before or after) and length > 0.0:
        skipped = distance * math.ceil(-s / distance - EPSILON) if distance > 0.0 else -s
        on_road = max(skipped, 0.0) / length, min(max(road.length - s, 0.0) / length, 1.0)
        s, length = s + on_road[0] * length, (on_road[1] - on_road[0]) * length
    pairs = {name: pair(name) for name in ("width", "height", "length", "radius", "t", "zOffset")}
    for name, values in pairs.items():
        if max(map(abs, values)) > MAX_OBJECT_SIZE:
            collector.report_error(repeat, f"<repeat> has a {name} beyond {MAX_OBJECT_SIZE:g} m", "correct it")
    return Repeat(
        s=s,
        length=length,
        distance=distance,
        t=pairs["t"],
        width=pairs["width"],
        height=pairs["height"],
        z_offset=pairs["zOffset"],
        size=pairs["length"],
        radius=pairs["radius"],
        detached=collector.flag(repeat, "detachFromReferenceLine"),
    )
