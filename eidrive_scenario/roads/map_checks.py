"""Checks of a readable road file: geometry gaps, lanes without width, missing links."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator, Mapping
from functools import cache
from itertools import pairwise

from eidrive_scenario.base.geometry import wrap_angle
from eidrive_scenario.roads.geometry.poses import lateral_axis
from eidrive_scenario.roads.model.location import LaneKey
from eidrive_scenario.roads.model.map_warnings import MapRule, MapWarning
from eidrive_scenario.roads.model.road_map import Connection, Junction, Lane, LaneSection, Road, RoadLink
from eidrive_scenario.roads.routing.graph import LaneWays
from eidrive_scenario.roads.routing.links import LaneEnd, LaneLinks, end_section, side_at

JUMP = 0.01
"""Maximum gap between the end of a geometry and the start of the next one [m]; also in s."""
KINK = 1e-3
"""Maximum difference of the headings of consecutive geometries [rad]."""
CORNER = math.radians(10.0)
"""Minimum angle of an intended corner, which is not reported as a discontinuity [rad]."""
STEEP = 0.5 * math.pi
"""Maximum plausible superelevation [rad]. A larger value was probably given in degrees."""
NARROW = -0.01
"""Minimum width that counts as a rounding error [m]. Lower widths are reported."""
WIDE = 200.0
"""Maximum plausible width of a lane [m]."""
OPEN = 0.5
"""Minimum width of a lane at its end at which a missing successor is reported [m]. Narrower lanes taper off."""


def check_road_map(
    roads: Mapping[str, Road], junctions: Mapping[str, Junction], links: LaneLinks
) -> Iterator[MapWarning]:
    """Yield warnings of the roads of a file."""
    for road in roads.values():
        yield from _jumps(road)
        yield from _tilts(road)
        yield from _turned(road)
        for section in road.sections:
            for lane in section.lanes.values():
                yield from _widths(road, section, lane)
        for before, after in pairwise(road.sections):
            yield from _broken(road, before, 1, after.lanes, f"the next lane section (s = {after.s:g} m)")
            yield from _broken(road, after, -1, before.lanes, f"the lane section before (s = {before.s:g} m)")
        for link, side in ((road.predecessor, -1), (road.successor, 1)):
            yield from _end(roads, road, link, side)
        yield from (warning for _, _, warning in _dead_lanes(road, links))
    yield from _gaps(roads, links)
    for junction in junctions.values():
        for connection in junction.connections:
            yield from _connection(roads, junction, connection)


def _turned(road: Road) -> Iterator[MapWarning]:
    """Yield the lanes for cars whose direction is not read, as it differs from that of their id."""
    for section in road.sections:
        for lane in section.lanes.values():
            if lane.id and lane.drivable and road.own_direction(lane) != road.directions[lane.id]:
                where = f"lane {lane.id} of road {road.id!r} (section at s = {section.s:g} m)"
                message = f"{where} has the direction of lane {lane.id} in an earlier section, not its own"
                hint = "give lanes of opposite directions different ids, or split the road"
                yield MapWarning(MapRule.LANE_DIRECTION, "such lanes", message, hint, lane.line)


def _jumps(road: Road) -> Iterator[MapWarning]:
    curves = road.reference.curves
    name = f"road {road.id!r}"
    spans = "geometries that overlap or leave a gap in s"
    if abs(curves[0].s) > JUMP:
        message = f"{name}: the first geometry begins at s = {curves[0].s:g} m"
        yield MapWarning(MapRule.GEOMETRY_GAP, spans, message, "start it at s=0", curves[0].line)
    for curve, following in pairwise(curves):
        missing = following.s - curve.s - curve.length
        if abs(missing) > JUMP:
            relation = "ends before the next one starts" if missing > 0.0 else "overlaps the next one"
            message = f"{name}: the geometry at s = {curve.s:g} m {relation}, by {abs(missing):.3g} m"
            hint = "set s to the sum of the preceding lengths"
            yield MapWarning(MapRule.GEOMETRY_GAP, spans, message, hint, following.line)
            continue
        end, start = curve.at(curve.length), following.at(0.0)
        apart = math.hypot(start.x - end.x, start.y - end.y)
        turn = abs(wrap_angle(start.h - end.h))
        if apart > JUMP:
            message = f"{name} jumps by {apart:.3g} m at s = {following.s:g} m"
            hint = "start each geometry at the end of its predecessor"
            yield MapWarning(MapRule.GEOMETRY_GAP, "such jumps", message, hint, following.line)
        elif KINK < turn < CORNER:
            message = f"{name} has a kink of {turn:.3g} rad at s = {following.s:g} m"
            hint = "start each geometry with the final heading of its predecessor"
            yield MapWarning(MapRule.HEADING_DISCONTINUITY, "such kinks", message, hint, following.line)
    over = curves[-1].s + curves[-1].length - road.length
    if abs(over) > JUMP:
        there = f"{abs(over):.3g} m {'after' if over > 0 else 'before'} that"
        message = f"{name} has length {road.length:g} m, but its geometry ends {there}"
        hint = "correct the length"
        yield MapWarning(MapRule.GEOMETRY_GAP, "lengths that differ from the geometry", message, hint, road.line)


def _tilts(road: Road) -> Iterator[MapWarning]:
    for start, tilt, *_ in road.superelevation.pieces:
        if abs(tilt) > STEEP:
            message = f"road {road.id!r} is tilted by {tilt:.3g} rad at s = {start:g} m"
            yield MapWarning(MapRule.ROAD_SURFACE, "such tilts", message, "give <superelevation> in radians", road.line)


def _widths(road: Road, section: LaneSection, lane: Lane) -> Iterator[MapWarning]:
    constant = lane.width.constant_value
    is_valid = constant is not None and NARROW <= constant <= WIDE
    if lane.id == 0 or (is_valid and lane.width_from <= JUMP):
        return
    name = f"lane {lane.id} of road {road.id!r} (section at s = {section.s:g} m)"
    if lane.width_from > JUMP:
        until = "" if math.isinf(lane.width_from) else f" before its sOffset {lane.width_from:g}"
        message = f"{name} has no width{until}"
        hint = 'give a <width> at sOffset="0"'
        yield MapWarning(MapRule.LANE_WIDTH, "lanes without a width", message, hint, lane.line)
    widths = list(_extremes(lane, section.length))
    least, most = min(widths), max(widths)
    if least < NARROW:
        message = f"{name} becomes {least:.3g} m wide"
        yield MapWarning(MapRule.LANE_WIDTH, "negative widths", message, "give widths of at least 0", lane.line)
    if most > WIDE:
        message = f"{name} becomes {most:.3g} m wide"
        yield MapWarning(MapRule.LANE_WIDTH, "implausible widths", message, "correct its coefficients", lane.line)


def _extremes(lane: Lane, length: float) -> Iterator[float]:
    """Yield the widths of a lane at the ends and the local extrema of each polynomial piece [m]."""
    pieces = lane.width.pieces
    ends = [*lane.width.starts[1:], length]
    for (start, a, b, c, d), end in zip(pieces, ends, strict=True):
        span = min(end, length) - start
        if span <= 0.0:
            continue
        at = [0.0, span]
        root = c * c - 3.0 * b * d
        if d != 0.0 and root >= 0.0:
            at += [(-c - math.sqrt(root)) / (3.0 * d), (-c + math.sqrt(root)) / (3.0 * d)]
        elif d == 0.0 and c != 0.0:
            at.append(-b / (2.0 * c))
        for ds in at:
            if 0.0 <= ds <= span:
                yield a + ds * (b + ds * (c + ds * d))


def _end(roads: Mapping[str, Road], road: Road, link: RoadLink | None, side: int) -> Iterator[MapWarning]:
    """Yield warnings of links between lanes at an end of a road and another road."""
    if link is None or link.element_type != "road" or not road.sections:
        return
    other = roads[link.element_id]
    if link.contact is None or not other.sections:
        return
    facing = end_section(other, 1 if link.contact == "end" else -1)
    yield from _broken(road, end_section(road, side), side, facing.lanes, f"the {link.contact} of road {other.id!r}")


def _broken(road: Road, section: LaneSection, side: int, lanes: Mapping[int, Lane], where: str) -> Iterator[MapWarning]:
    for lane in section.lanes.values():
        for number in lane.successors if side > 0 else lane.predecessors:
            if number not in lanes:
                word = "successor" if side > 0 else "predecessor"
                message = f"lane {lane.id} of road {road.id!r} has the {word} {number}, which {where} does not have"
                hint = "known: " + ", ".join(map(str, sorted(lanes)))
                yield MapWarning(MapRule.LANE_LINK, "links to lanes that do not exist", message, hint, lane.line)


def missing_lane_link(
    roads: Mapping[str, Road], links: LaneLinks, ways: LaneWays, start: LaneKey, end: LaneKey
) -> MapWarning | None:
    """Return the warning of a lane without a successor whose link would complete a route; None without such a lane."""
    entries: dict[LaneKey, dict[LaneKey, None]] = {}
    for key, exits in ways.successors.items():
        for other in exits:
            entries.setdefault(other, {})[key] = None
    reached, leading = _connected(ways.successors, start), _connected(entries, end)
    for road in dict.fromkeys(key.road for key in reached):
        for key, link, warning in _dead_lanes(roads[road], links):
            if key in reached and not leading.keys().isdisjoint(_continuations(roads, key, link)):
                return warning
    return None


def _connected(edges: Mapping[LaneKey, Mapping[LaneKey, object]], start: LaneKey) -> dict[LaneKey, None]:
    """Return all lanes to which edges lead from `start`, the nearest first."""
    reached, waiting = {start: None}, deque([start])
    while waiting:
        for other in edges.get(waiting.popleft(), ()):
            if other not in reached:
                reached[other] = None
                waiting.append(other)
    return reached


def _continuations(roads: Mapping[str, Road], key: LaneKey, link: RoadLink | None) -> Iterator[LaneKey]:
    """Yield the lanes at the end of a lane by the links of roads only: of the next section, road or junction."""
    road = roads[key.road]
    side = road.directions[key.lane]
    if link is None:
        yield from _lanes_away(road, key.section + side, side)
    elif link.element_type == "road":
        for direction in (1, -1) if link.contact is None else (1 if link.contact == "start" else -1,):
            yield from _lanes_away(roads[link.element_id], 0 if direction > 0 else -1, direction)
    else:
        for other in roads.values():
            for back, direction in ((other.predecessor, 1), (other.successor, -1)):
                is_from_here = back is not None and back.element_type == "road" and back.element_id == road.id
                if other.junction_id == link.element_id and is_from_here:
                    yield from _lanes_away(other, 0 if direction > 0 else -1, direction)


def _lanes_away(road: Road, section: int, direction: int) -> Iterator[LaneKey]:
    """Yield the lanes of a section, -1 for the last one, with a driving direction."""
    if road.sections:
        chosen = road.sections[section]
        yield from (LaneKey(road.id, chosen.index, n) for n in chosen.lanes if n and road.directions[n] == direction)


def _dead_lanes(road: Road, links: LaneLinks) -> Iterator[tuple[LaneKey, RoadLink | None, MapWarning]]:
    """Yield lanes without a successor, with the link by which their road continues, None within it, and the warning.

    Two-way lanes, such as turning lanes in the middle, may end at junctions.
    """
    for section in road.sections:
        for lane in section.lanes.values():
            if not lane.drivable or lane.id == 0 or lane.is_two_way:
                continue
            side = road.directions[lane.id]
            inside = 0 <= section.index + side < len(road.sections)
            link = road.successor if side > 0 else road.predecessor
            if not inside and link is None:
                continue
            if lane.width.value(section.length if side > 0 else 0.0) < OPEN:
                continue
            key = LaneKey(road.id, section.index, lane.id)
            if next(links.beyond(key, side), None) is None:
                ahead = None if inside else link
                yield key, ahead, _dead_end(road, section, lane, ahead)


def _dead_end(road: Road, section: LaneSection, lane: Lane, link: RoadLink | None) -> MapWarning:
    name = f"lane {lane.id} of road {road.id!r} (section at s = {section.s:g} m)"
    message = f"{name} has no successor although the road continues"
    if link is not None:
        message += f" in {link.element_type} {link.element_id!r}"
    if link is not None and link.element_type == "junction":
        hint = "add a <laneLink> from it to a <connection>"
        return MapWarning(MapRule.LANE_LINK, "lanes without a successor at junctions", message, hint, lane.line)
    hint = "link it or reduce its width to 0"
    return MapWarning(MapRule.LANE_LINK, "lanes without a successor", message, hint, lane.line)


def _gaps(roads: Mapping[str, Road], links: LaneLinks) -> Iterator[MapWarning]:
    """Yield warnings of linked lanes whose ends do not meet. The reference lines of two roads need not meet."""

    @cache
    def cross_section(road_id: str, index: int, side: int) -> tuple[float, float, float, float, float]:
        """Return x, y of an end of a lane section [m], their change per meter of t, and the lane offset [m]."""
        road = roads[road_id]
        section = road.sections[index]
        s = section.s + section.length if side > 0 else section.s
        x, y, heading, *_ = road.reference.at(s)
        ahead, left, _ = lateral_axis(road.elevation.value_and_slope(s)[1], road.superelevation.value(s))
        sin, cos = math.sin(heading), math.cos(heading)
        # At the end of a section the offset is that before a step
        offset = road.lane_offset.value(math.nextafter(s, 0.0) if side > 0 else s)
        return x, y, ahead * cos - left * sin, ahead * sin + left * cos, offset

    for ends in links.pairs():
        sections = [roads[end.lane.road].sections[end.lane.section] for end in ends]
        lanes = [section.lanes[end.lane.lane] for section, end in zip(sections, ends, strict=True)]
        if not (lanes[0].drivable and lanes[1].drivable):
            continue
        points, widths = [], []
        for end, section, lane in zip(ends, sections, lanes, strict=True):
            x, y, dx, dy, offset = cross_section(end.lane.road, end.lane.section, end.side)
            ds = section.length if end.side > 0 else 0.0
            t = offset + lane.side * lane.center.value(ds)
            points.append((x + t * dx, y + t * dy))
            widths.append(lane.width.value(ds))
        apart = math.dist(*points)
        if apart <= JUMP:
            continue
        # A lane that divides contains its parts
        is_split = any(len(list(links.beyond(end.lane, end.side))) > 1 for end in ends)
        if apart > JUMP + (0.5 * abs(widths[0] - widths[1]) if is_split else 0.0):
            is_inside = ends[0].lane.road == ends[1].lane.road
            names = " and ".join(_end_name(roads, end, is_inside=is_inside) for end in ends)
            message = f"{names} are linked but their ends are {apart:.3g} m apart"
            kind, hint = "linked lanes that do not meet", "make their ends meet"
            yield MapWarning(MapRule.GEOMETRY_GAP, kind, message, hint, lanes[0].line)


def _end_name(roads: Mapping[str, Road], end: LaneEnd, *, is_inside: bool) -> str:
    road, index, lane = end.lane
    name = f"lane {lane} of road {road!r}"
    return f"{name} (section at s = {roads[road].sections[index].s:g} m)" if is_inside else name


def _connection(roads: Mapping[str, Road], junction: Junction, connection: Connection) -> Iterator[MapWarning]:
    incoming, connecting = roads[connection.incoming_road], roads[connection.connecting_road]
    if not incoming.sections or not connecting.sections:
        return
    name = f"connection {connection.id!r} of junction {junction.id!r}"
    rule = MapRule.JUNCTION_CONNECTION
    ends = [link for link in (incoming.predecessor, incoming.successor) if link is not None]
    touches = any(link.element_type == "junction" and link.element_id == junction.id for link in ends)
    if junction.type == "default" and not touches:
        message = f"{name} comes from road {incoming.id!r}, which does not end at the junction"
        hint = "link that road to the junction, or correct incomingRoad"
        yield MapWarning(rule, "connections from roads that do not end at the junction", message, hint, connection.line)
    if junction.type == "default" and connecting.junction_id != junction.id:
        message = f"{name} uses road {connecting.id!r}, which does not belong to the junction"
        hint = f"give that road junction={junction.id!r}, or correct connectingRoad"
        yield MapWarning(rule, "connections over roads of no or another junction", message, hint, connection.line)
    side = side_at(incoming, junction, connecting, connection.contact)
    other_side = 1 if connection.contact == "end" else -1
    incoming_lanes, connecting_lanes = end_section(incoming, side).lanes, end_section(connecting, other_side).lanes
    driven = [
        (n, m)
        for n, m in connection.lane_links
        if n in incoming_lanes and m in connecting_lanes and incoming_lanes[n].drivable and connecting_lanes[m].drivable
    ]
    if driven and all(
        incoming.directions[n] == -side
        and connecting.directions[m] == other_side
        and not (incoming_lanes[n].is_two_way or connecting_lanes[m].is_two_way)
        for n, m in driven
    ):
        message = f"{name} is opposite to the traffic of roads {incoming.id!r} and {connecting.id!r}"
        hint = 'swap them; for left-hand traffic give the roads rule="LHT"'
        yield MapWarning(rule, "connections opposite to the traffic", message, hint, connection.line)
    for number, target in connection.lane_links:
        for lane, lanes, road in ((number, incoming_lanes, incoming), (target, connecting_lanes, connecting)):
            if lane not in lanes:
                message = f"{name} links lane {lane} of road {road.id!r}, which does not exist there"
                hint = "known: " + ", ".join(map(str, sorted(lanes)))
                yield MapWarning(rule, "links of lanes that do not exist", message, hint, connection.line)
    if not connection.lane_links and not set(incoming_lanes) & set(connecting_lanes) - {0}:
        message = f"{name} links no lane"
        yield MapWarning(rule, "connections without lanes", message, "add a <laneLink>", connection.line)
