"""Reader of <planView>: curves of a reference line, and limits of the extent of a road map."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from lxml import etree

from eidrive_scenario.errors import suggestion
from eidrive_scenario.files.untrusted_xml import line_of
from eidrive_scenario.roads.model import curves
from eidrive_scenario.roads.model.curves import Arc, Coefficients, Cubic, Curve, ReferenceLine
from eidrive_scenario.roads.model.map_warnings import MapRule
from eidrive_scenario.roads.model.road_map import Road
from eidrive_scenario.roads.reading.attribute_reader import AttributeReader

KINDS = ("line", "arc", "spiral", "poly3", "paramPoly3")
LONGEST = 1e6
"""Maximum length of a road or geometry [m]."""
MAX_CUBICS = 200_000
"""Maximum number of cubics over arc length that replace all poly3 and normalized paramPoly3 of a file, as each takes
memory."""
CUBICS = "parts of poly3 and normalized paramPoly3"
MAX_LENGTH_ERROR, LENGTH_ERROR_SHARE, LENGTH_ROUNDING = 0.1, 0.01, 0.01
"""Maximum difference of the length of a paramPoly3 from that of its curve [m], also as a share of the length, and the
difference that counts as rounding [m]. Maps of netconvert differ by up to 3 cm in 15 m.
"""
SHORTEST = 1e-9
"""Maximum length of a geometry that is omitted [m]. Geometries of length 0 occur in real maps."""


def read_reference_line(road: etree._Element, length: float, collector: AttributeReader) -> ReferenceLine:
    """Return the reference line of a <road>.

    If the length of the road differs from that of the geometry by more than 1 %, the geometry has priority.
    """
    plan = road.find("planView")
    if plan is None:
        collector.report_error(road, f"road {road.get('id')!r} has no <planView>", "add its geometry")
        return ReferenceLine([Arc(0.0, 0.0, 0.0, 0.0, length)], length)
    curves: list[Curve] = []
    for geometry in plan.iterfind("geometry"):
        curves.extend(_read_geometry(geometry, road.get("id", ""), collector))
    if not curves:
        collector.report_error(plan, f"road {road.get('id')!r} has no <geometry>", "add at least one")
        return ReferenceLine([Arc(0.0, 0.0, 0.0, 0.0, length)], length)
    curves.sort(key=lambda curve: curve.s)
    covered = curves[-1].s + curves[-1].length
    if covered <= 0.0:
        what = f"the geometry of road {road.get('id')!r} ends at s = {covered:g} m"
        collector.report_error(plan, what, "start it at s = 0")
        return ReferenceLine(curves, length)
    if abs(covered - length) > max(0.01 * length, 0.1):
        there = f"{abs(covered - length):.3g} m {'after' if covered > length else 'before'} that"
        what = f"road {road.get('id')!r} has length {length:g} m, but its geometry ends {there} and has priority"
        hint = "correct the length or complete the geometry"
        collector.report_warning(road, MapRule.GEOMETRY_GAP, "lengths that differ from the geometry", what, hint)
        length = covered
    return ReferenceLine(curves, length)


def _read_geometry(geometry: etree._Element, road_id: str, collector: AttributeReader) -> Sequence[Curve]:
    s, x, y, h, length = (collector.number(geometry, name) for name in ("s", "x", "y", "hdg", "length"))
    if length <= SHORTEST:
        if length < 0.0:
            collector.report_error(geometry, f"<geometry> has length={length:g}", "give a positive length")
        return []
    if length > LONGEST:
        collector.report_error(geometry, f"<geometry> has length={length:g}", f"at most {LONGEST:g} m are read")
        return []
    shape = next((child for child in geometry if isinstance(child.tag, str) and child.tag != "userData"), None)
    if shape is None:
        hint = "add one of " + ", ".join(f"<{kind}>" for kind in KINDS)
        collector.report_error(geometry, "<geometry> has no shape", hint)
        return []
    start, line = (s, x, y, h, length), line_of(geometry)
    match shape.tag:
        case "line":
            return [Arc(*start, line=line)]
        case "arc":
            return [Arc(*start, collector.number(shape, "curvature"), line=line)]
        case "spiral":
            ends = collector.number(shape, "curvStart"), collector.number(shape, "curvEnd")
            return [curves.spiral(*start, *ends, line=line)]
        case "poly3" | "paramPoly3":
            return _read_cubic(geometry, shape, start, road_id, collector)
    collector.report_error(shape, f"unknown geometry <{shape.tag}>", suggestion(str(shape.tag), KINDS))
    return []


def _read_cubic(
    geometry: etree._Element,
    shape: etree._Element,
    start: tuple[float, float, float, float, float],
    road_id: str,
    collector: AttributeReader,
) -> Sequence[Curve]:
    """Return a <poly3> or <paramPoly3>. A curve that leads too far away is reported and not converted."""
    s, x, y, h, length = start
    if shape.tag == "poly3":
        a, b, c, d = (collector.number(shape, name) for name in "abcd")
        u, v, span = (0.0, 1.0, 0.0, 0.0), (a, b, c, d), "u"
    else:
        u, v, span = _read_param_poly3(shape, collector)
    cubic = Cubic(s, x, y, h, length, u, v, line=line_of(geometry))
    end = 1.0 if span == "normalized" else length
    away = max(math.hypot(point.x - x, point.y - y) for point in (cubic.at(share * end) for share in _SHARES))
    if not away <= MAX_SHAPE:
        message = f"a geometry of road {road_id!r} leads {away:g} m away from its start"
        collector.report_error(geometry, message, f"at most {MAX_SHAPE:g} m are read")
        return [cubic]
    path = length if span == "u" else cubic.path_length(end)
    if abs(path - length) > min(MAX_LENGTH_ERROR, max(LENGTH_ERROR_SHARE * length, LENGTH_ROUNDING)):
        message = f"the curve of a geometry of road {road_id!r} is {path:.6g} m long, but its length is {length:.6g} m"
        hint = "correct the length, or the polynomials"
        collector.report_warning(geometry, MapRule.GEOMETRY_GAP, "curves of another length", message, hint)
    if span == "arcLength" or collector.has_spent(CUBICS, MAX_CUBICS):
        return [cubic]
    converted = curves.over_arc_length(cubic, end, length if span == "u" else None)
    collector.spend(geometry, CUBICS, len(converted), MAX_CUBICS)
    return converted


def _read_param_poly3(shape: etree._Element, collector: AttributeReader) -> tuple[Coefficients, Coefficients, str]:
    """Return the polynomials of u and v, and the range of their parameter."""
    u0, u1, u2, u3 = (collector.number(shape, name) for name in ("aU", "bU", "cU", "dU"))
    v0, v1, v2, v3 = (collector.number(shape, name) for name in ("aV", "bV", "cV", "dV"))
    span = shape.get("pRange", "normalized")
    if span not in ("arcLength", "normalized"):
        hint = suggestion(span, ("arcLength", "normalized"))
        collector.report_error(shape, f"<paramPoly3> has pRange={span!r}", hint)
    if not any((u1, u2, u3, v1, v2, v3)):
        collector.report_error(shape, "<paramPoly3> is a single point", "give polynomials for u and v")
    return (u0, u1, u2, u3), (v0, v1, v2, v3), span


MAX_SHAPE = 1e6
"""Maximum distance of the points of a geometry from its start [m]."""
MAX_WIDTH = 1e7
"""Maximum distance of the edge of a lane from the reference line [m]."""
MAX_HEIGHT = 1e5
"""Maximum height of a road [m]."""
MAX_LANE_LENGTH = 2e7
"""Maximum length of all lanes together [m]."""
_SHARES = (0.0, 0.5, 1.0)


def check_extent(roads: Mapping[str, Road], collector: AttributeReader) -> None:
    """Report roads of excessive extent."""
    lanes = 0.0
    for road in roads.values():
        lanes += sum(section.length * len(section.lanes) for section in road.sections)
        _check_cross_section(road, collector)
    if lanes > MAX_LANE_LENGTH:
        message = f"the lanes are {lanes:g} m long in total"
        collector.report_error(1, message, f"at most {MAX_LANE_LENGTH:g} m are read")


def _check_cross_section(road: Road, collector: AttributeReader) -> None:
    for section in road.sections:
        for share in _SHARES:
            ds = share * section.length
            offset = road.lane_offset.value(section.s + ds)
            outermost = (section.lanes[min(section.lanes)], section.lanes[max(section.lanes)])
            edges = [abs(offset + lane.side * lane.outer.value(ds)) for lane in outermost]
            if not max(edges) <= MAX_WIDTH:
                message = f"a lane of road {road.id!r} reaches {max(edges):g} m from the reference line"
                collector.report_error(road.line, message, f"at most {MAX_WIDTH:g} m are read")
                return
            height = abs(road.elevation.value(section.s + ds))
            if not height <= MAX_HEIGHT:
                message = f"road {road.id!r} is {height:g} m high"
                collector.report_error(road.line, message, f"at most {MAX_HEIGHT:g} m are read")
                return
