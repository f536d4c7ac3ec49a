"""Reader of <lanes>: lane offset, lane sections, widths or borders, lane links, road marks, heights, speeds."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from copy import deepcopy
from dataclasses import replace
from typing import Any, Literal

import msgspec
from lxml import etree

from eidrive_scenario.files.untrusted_xml import line_of
from eidrive_scenario.roads.model.map_warnings import MapRule
from eidrive_scenario.roads.model.polynomials import Polynomials, combine
from eidrive_scenario.roads.model.road_map import Lane, LaneHeight, LaneSection, RoadMark, RoadMarkLine
from eidrive_scenario.roads.reading.attribute_reader import AttributeReader

UNITS = {"": 1.0, "m/s": 1.0, "km/h": 1.0 / 3.6, "mph": 0.44704}
MARK_WIDTHS = {"standard": 0.12, "bold": 0.25}
ORIGIN = "{eidrive-scenario}origin"
"""Attribute for the start of the original section of a lane, relative to the section that contains it now [m]."""
ZERO = Polynomials()
CENTER = Lane(id=0, type="none", width=ZERO, inner=ZERO, outer=ZERO, center=ZERO)


def read_speed(element: etree._Element, collector: AttributeReader) -> float | None:
    """Return the limit of a <speed> [m/s]; inf for 'no limit', None for 'undefined'."""
    text = collector.text(element, "max")
    if text in ("no limit", "undefined"):
        return math.inf if text == "no limit" else None
    unit = element.get("unit", "m/s")
    if unit not in UNITS:
        collector.report_error(element, f"<speed> has unit={unit!r}", "give m/s, km/h or mph")
    return collector.number(element, "max") * UNITS.get(unit, 1.0)


def read_sections(
    lanes: etree._Element, length: float, lane_offset: Polynomials, collector: AttributeReader
) -> tuple[LaneSection, ...]:
    """Return the lane sections of a road in the order of s, without sections of length 0."""
    elements = sorted(
        ((min(max(collector.number(element, "s"), 0.0), length), element) for element in lanes.iterfind("laneSection")),
        key=lambda pair: pair[0],
    )
    if not elements:
        collector.report_error(lanes, "<lanes> has no <laneSection>", "add at least one")
        return ()
    if any(collector.flag(element, "singleSide") for _, element in elements):
        elements = _join_sides(elements)
    first, element = elements[0]
    if first > 1e-6 and lanes.get("layer") != "temporary":
        message = f"the first <laneSection> of its road begins at s = {first:g} m"
        kind = "lane sections that begin late"
        collector.report_warning(element, MapRule.GEOMETRY_GAP, kind, message, "start it at s=0")
    ends = [*(s for s, _ in elements[1:]), length]
    sections: list[LaneSection] = []
    left_out: list[Mapping[int, Lane]] = []
    for (s, element), end in zip(elements, ends, strict=True):
        start = s if sections else 0.0
        read = _read_section(element, start, lane_offset, collector)
        if end - s <= 1e-6 and (sections or len(elements) > 1):
            if sections:
                linked = _redirect_links(sections[-1].lanes, read, "successors")
                sections[-1] = msgspec.structs.replace(sections[-1], lanes=linked)
            left_out.append(read)
            continue
        for between in reversed(left_out):
            read = _redirect_links(read, between, "predecessors")
        left_out.clear()
        sections.append(LaneSection(len(sections), start, max(end - start, 0.0), read))
    if not sections:
        collector.report_error(lanes, "<lanes> has no <laneSection> on the road", "start the first at s=0")
    return tuple(sections)


def _redirect_links(
    lanes: Mapping[int, Lane], between: Mapping[int, Lane], way: Literal["predecessors", "successors"]
) -> dict[int, Lane]:
    """Return the lanes with links in one direction redirected past an omitted section.

    If the omitted section has no links, its lanes are linked to those of the same id.
    """
    if not any(lane.predecessors or lane.successors for lane in between.values()):
        return dict(lanes)
    redirected = {}
    for number, lane in lanes.items():
        passed = [between[n] for n in getattr(lane, way) if n in between]
        beyond: dict[str, Any] = {way: tuple(dict.fromkeys(n for other in passed for n in getattr(other, way)))}
        redirected[number] = replace(lane, **beyond)
    return redirected


def _join_sides(elements: list[tuple[float, etree._Element]]) -> list[tuple[float, etree._Element]]:
    """Return sections with singleSide as sections with both sides. The other side is continued."""
    joined: list[tuple[float, etree._Element]] = []
    current: dict[str, tuple[float, etree._Element]] = {}
    for s in sorted({s for s, _ in elements}):
        started = [element for start, element in elements if start == s]
        merged = etree.Element("laneSection")
        for element in started:
            sides = [side for side in ("left", "right") if element.find(side) is not None]
            for side in sides if element.get("singleSide", "").lower() in ("true", "1") else ("left", "right"):
                current[side] = (s, element)
            current["center"] = (s, element)
        for side, (start, element) in current.items():
            part = element.find(side)
            if part is not None:
                copy = deepcopy(part)
                for lane in copy.iterfind("lane"):
                    lane.set(ORIGIN, repr(start - s))
                    if start < s:
                        _continue_link(lane, "predecessor")
                        for before in joined[-1][1].iterfind(f"{side}/lane"):
                            if before.get("id") == lane.get("id"):
                                _continue_link(before, "successor")
                merged.append(copy)
        joined.append((s, merged))
    return joined


def _continue_link(lane: etree._Element, name: str) -> None:
    """Link a lane to the lane of the same id."""
    link = lane.find("link")
    if link is None:
        link = etree.SubElement(lane, "link")
    for old in link.findall(name):
        link.remove(old)
    etree.SubElement(link, name, id=lane.get("id", "0"))


def _read_section(
    section: etree._Element, s: float, lane_offset: Polynomials, collector: AttributeReader
) -> dict[int, Lane]:
    elements: dict[int, etree._Element] = {}
    for side, sign in (("left", 1), ("center", 0), ("right", -1)):
        for element in section.iterfind(f"{side}/lane"):
            number = collector.integer(element, "id")
            is_misplaced = (number > 0) - (number < 0) != sign
            message = f"lane {number} is listed under <{side}>"
            hint = "left lanes have ids above 0, the center lane 0, right lanes ids below 0"
            if is_misplaced and number and sign:
                # Links and positions refer to the id.
                kind, message = "lanes under the wrong side", f"{message}; its id determines the side"
                collector.report_warning(element, MapRule.LANE_SIDE, kind, message, hint)
            elif is_misplaced:
                collector.report_error(element, message, hint)
                continue
            if number in elements:
                message, hint = f"lane {number} occurs twice in its section", "give each lane a unique id"
                collector.report_error(element, message, hint)
            else:
                elements[number] = element
    center = elements.get(0)
    lanes = {0: CENTER if center is None else _lane(center, 0, ZERO, ZERO, collector)}
    offset = lane_offset.shifted(s)
    for sign in (1, -1):
        edge = ZERO
        for number in sorted((n for n in elements if n * sign > 0), key=abs):
            lane = _lane(elements[number], number, edge, offset, collector)
            lanes[number] = lane
            edge = lane.outer
    if not any(lanes):
        # RoadRunner exports the georeference as such a road. OpenDRIVE requires a lane on a side since 1.6.
        collector.report_warning(
            section,
            MapRule.EMPTY_LANE_SECTION,
            "lane sections with only the center lane",
            "<laneSection> has no lane except the center lane, so vehicles cannot drive there",
            "add a lane under <left> or <right>",
        )
    return {number: lanes[number] for number in sorted(lanes, reverse=True)}


def _lane(
    element: etree._Element, number: int, inner: Polynomials, lane_offset: Polynomials, collector: AttributeReader
) -> Lane:
    begin = float(element.get(ORIGIN, "0"))
    width, width_from, outer, center = ZERO, 0.0, inner, inner
    if number:
        width, width_from = _read_width(element, number, inner, lane_offset, collector)
        outer, center = (combine([(1.0, inner), (share, width)]) for share in (1.0, 0.5))
    link = element.find("link")
    speeds = ((collector.number(e, "sOffset") + begin, read_speed(e, collector)) for e in element.iterfind("speed"))
    return Lane(
        id=number,
        type=element.get("type", "none"),
        width=width,
        inner=inner,
        outer=outer,
        center=center,
        predecessors=_linked(link, "predecessor", collector),
        successors=_linked(link, "successor", collector),
        direction=element.get("direction", "standard"),
        road_marks=tuple(sorted(_read_marks(element, begin, collector), key=lambda mark: mark.s_offset)),
        heights=tuple(
            sorted((_read_height(e, begin, collector) for e in element.iterfind("height")), key=lambda h: h.s_offset)
        ),
        speeds=tuple(sorted((s, limit) for s, limit in speeds if limit is not None)),
        width_from=width_from,
        line=line_of(element),
    )


def _read_width(
    element: etree._Element, number: int, inner: Polynomials, lane_offset: Polynomials, collector: AttributeReader
) -> tuple[Polynomials, float]:
    """Return the width over ds, and the first ds with a specified width.

    A <border> counts from the reference line. <width> has priority if both are given (clause 11.7).
    """
    begin = float(element.get(ORIGIN, "0"))
    widths = collector.pieces(element.iterfind("width"), "sOffset")
    borders = collector.pieces(element.iterfind("border"), "sOffset")
    given = Polynomials(widths or borders)
    width_from = min((start for start, *_ in widths or borders), default=math.inf) + begin
    if begin:
        given = given.shifted(-begin)
    if widths or not borders:
        return given, width_from
    side = 1.0 if number > 0 else -1.0
    return combine([(side, given), (-side, lane_offset), (-1.0, inner)]), width_from


def _linked(link: etree._Element | None, name: str, collector: AttributeReader) -> tuple[int, ...]:
    return () if link is None else tuple(collector.integer(element, "id") for element in link.iterfind(name))


def _read_height(element: etree._Element, begin: float, collector: AttributeReader) -> LaneHeight:
    # Maps of OpenDRIVE 1.1, such as the samples of VIRES, have other names.
    names = ("heightInner", "heightOuter") if "heightInner" in element.attrib else ("inner", "outer")
    inner, outer = (collector.number(element, name) for name in names)
    return LaneHeight(collector.number(element, "sOffset") + begin, inner, outer)


def _read_marks(element: etree._Element, begin: float, collector: AttributeReader) -> Iterable[RoadMark]:
    for mark in element.iterfind("roadMark"):
        usual = MARK_WIDTHS.get(mark.get("weight", "standard"), 0.12)
        width = collector.mark_number(mark, "width", None) or usual
        lines = [_read_line(line, width, collector) for line in mark.iterfind("type/line")]
        lines += [_read_line(line, width, collector, ("length",)) for line in mark.iterfind("explicit/line")]
        if mark.get("type") is None:
            collector.report_mark_warning(mark, "<roadMark> lacks the attribute 'type'")
        yield RoadMark(
            s_offset=(collector.mark_number(mark, "sOffset", 0.0) or 0.0) + begin,
            type=mark.get("type", "none"),
            color=mark.get("color", "standard"),
            width=width,
            lane_change=mark.get("laneChange", "both"),
            lines=tuple(line for line in lines if line is not None),
        )


def _read_line(
    line: etree._Element, usual: float, collector: AttributeReader, dashes: tuple[str, ...] = ("length", "space")
) -> RoadMarkLine | None:
    """Return a line of a road mark, or None if its dashes are missing, as then the type of the mark defines the
    pattern.

    usual   width if the line has none [m]
    dashes  attributes of its dashes; without `space` there is only one
    """
    missing = [name for name in dashes if line.get(name) is None]
    length = collector.mark_number(line, "length", None)
    space = collector.mark_number(line, "space", None) if "space" in dashes else math.inf
    if missing:
        names = " and ".join(repr(name) for name in missing)
        collector.report_mark_warning(line, f"<line> lacks the attribute {names}")
    if length is None or space is None:
        return None
    return RoadMarkLine(
        length=length,
        space=space,
        t_offset=collector.mark_number(line, "tOffset", 0.0) or 0.0,
        s_offset=collector.mark_number(line, "sOffset", 0.0) or 0.0,
        width=collector.mark_number(line, "width", 0.0) or usual,
    )
