"""Limits of the extent of a road map, which determines the memory of derived data."""

from __future__ import annotations

import math
from collections.abc import Mapping

from eidrive_scenario.errors import Diagnostic
from eidrive_scenario.roads.model.curves import Cubic
from eidrive_scenario.roads.model.road_map import Road
from eidrive_scenario.roads.reading.attribute_reader import AttributeReader

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
        _check_geometries(road, collector)
        lanes += sum(section.length * len(section.lanes) for section in road.sections)
        _check_cross_section(road, collector)
    if lanes > MAX_LANE_LENGTH:
        message = f"the lanes are {lanes:g} m long in total"
        collector.append_diagnostic(Diagnostic(message, f"at most {MAX_LANE_LENGTH:g} m are read", collector.source, 1))


def _check_geometries(road: Road, collector: AttributeReader) -> None:
    """Report cubics that lead too far away from their start. Only cubics can exceed their length."""
    farthest: dict[int | None, float] = {}
    for curve in road.reference.curves:
        if not isinstance(curve, Cubic):
            continue
        points = [curve.at(share * curve.length) for share in _SHARES]
        away = max(math.hypot(point.x - curve.x, point.y - curve.y) for point in points)
        if not away <= MAX_SHAPE:
            # One geometry of a file may consist of several curves here.
            line = curve.line or road.line
            farthest[line] = max(away, farthest.get(line, 0.0))
    for line, away in farthest.items():
        message = f"a geometry of road {road.id!r} leads {away:g} m away from its start"
        collector.append_diagnostic(Diagnostic(message, f"at most {MAX_SHAPE:g} m are read", collector.source, line))


def _check_cross_section(road: Road, collector: AttributeReader) -> None:
    for section in road.sections:
        for share in _SHARES:
            ds = share * section.length
            offset = road.lane_offset.value(section.s + ds)
            outermost = (section.lanes[min(section.lanes)], section.lanes[max(section.lanes)])
            edges = [abs(offset + lane.side * lane.outer.value(ds)) for lane in outermost]
            if not max(edges) <= MAX_WIDTH:
                message = f"a lane of road {road.id!r} reaches {max(edges):g} m from the reference line"
                collector.append_diagnostic(
                    Diagnostic(message, f"at most {MAX_WIDTH:g} m are read", collector.source, road.line)
                )
                return
            height = abs(road.elevation.value(section.s + ds))
            if not height <= MAX_HEIGHT:
                message = f"road {road.id!r} is {height:g} m high"
                collector.append_diagnostic(
                    Diagnostic(message, f"at most {MAX_HEIGHT:g} m are read", collector.source, road.line)
                )
                return
