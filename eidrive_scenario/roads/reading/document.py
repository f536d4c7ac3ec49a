"""Reader of a whole OpenDRIVE file: safe parsing, elements, references."""

from __future__ import annotations

from dataclasses import replace
from operator import attrgetter
from pathlib import Path
from typing import Literal, cast

from lxml import etree

from eidrive_scenario.errors import Diagnostic, RoadError, suggestion
from eidrive_scenario.files.bounded import MIB, read_regular_file, reason_of
from eidrive_scenario.files.untrusted_xml import XmlLimits, line_of, parse_untrusted
from eidrive_scenario.roads.model.map_warnings import MapRule, MapWarning
from eidrive_scenario.roads.model.polynomials import Polynomials
from eidrive_scenario.roads.model.road_map import (
    Connection,
    Header,
    Junction,
    LaneSection,
    Road,
    RoadLink,
    RoadMap,
    RoadObject,
    RoadType,
)
from eidrive_scenario.roads.reading.attribute_reader import AttributeReader
from eidrive_scenario.roads.reading.lanes import read_sections, read_speed
from eidrive_scenario.roads.reading.objects_and_signals import read_controllers, read_object, read_signals
from eidrive_scenario.roads.reading.plan_view import LONGEST, check_extent, read_reference_line

LIMITS = XmlLimits(max_bytes=256 * MIB, max_nodes=4_000_000)
"""Limits of an OpenDRIVE file."""


def read_road_text(path: Path) -> bytes:
    """Return the content of an OpenDRIVE file. Raise RoadError if it is unreadable."""
    try:
        return read_regular_file(path, LIMITS.max_bytes)
    except OSError as error:
        diagnostic = Diagnostic(f"cannot read: {reason_of(error)}", "give the path of an OpenDRIVE file", str(path))
        raise RoadError(diagnostic) from error


def parse_road_map(text: bytes, source: str) -> RoadMap:
    """Parse OpenDRIVE; `source` is the file name in errors. Raise RoadError with all diagnostics, lines and hints."""
    root = _parse(text, source)
    collector = AttributeReader(source)
    elements = [(collector.text(element, "id"), element) for element in root.iterfind("road")]
    roads: dict[str, Road] = {}
    objects: list[RoadObject] = []
    for number, element in elements:
        if number in roads:
            collector.report_error(element, f"road {number!r} occurs twice", "give each road a unique id")
        roads[number] = _read_road(number, element, collector)
        objects.extend(read_object(roads[number], child, collector) for child in element.iterfind("objects/object"))
    if not elements:
        collector.report_error(root, "<OpenDRIVE> has no <road>", "add at least one")
    junctions = {}
    for element in root.iterfind("junction"):
        junction = _read_junction(element, roads, collector)
        if junction.id in junctions:
            collector.report_error(element, f"junction {junction.id!r} occurs twice", "give each junction a unique id")
        junctions[junction.id] = junction
    roads = {number: _with_valid_links(road, roads, junctions, collector) for number, road in roads.items()}
    signals = read_signals(elements, roads, collector)
    controllers = read_controllers(root, signals, collector)
    header = _read_header(root, collector)
    if not collector.errors:
        check_extent(roads, collector)
    if collector.errors:
        raise RoadError(sorted(collector.errors, key=lambda diagnostic: diagnostic.line or 0))
    return RoadMap(
        source, header, roads, junctions, signals, controllers, tuple(objects), tuple(collector.map_warnings)
    )


def _parse(text: bytes, source: str) -> etree._Element:
    """Parse XML and return the root element without namespaces."""
    root = parse_untrusted(text, source, LIMITS, RoadError, remove_comments=True)
    if root.tag.startswith("{"):
        for element in root.iter():
            element.tag = etree.QName(element).localname
    if root.tag != "OpenDRIVE":
        what = "the root element is not <OpenDRIVE>"
        raise RoadError(Diagnostic(what, "is this another kind of file?", source, line_of(root)))
    return root


def _read_header(root: etree._Element, collector: AttributeReader) -> Header:
    header = root.find("header")
    if header is None:
        return Header()
    reference, offset = header.find("geoReference"), header.find("offset")
    x, y, z, turn = (0.0 if offset is None else collector.number(offset, name, 0.0) for name in ("x", "y", "z", "hdg"))
    return Header(
        geo_reference=((reference.text if reference is not None else None) or "").strip(),
        geo_reference_line=line_of(reference) if reference is not None else None,
        offset=(x, y, z, turn),
    )


def _read_road(number: str, element: etree._Element, collector: AttributeReader) -> Road:
    length = collector.number(element, "length")
    if length <= 0.0 and element.get("length") is not None:
        collector.report_error(element, f"road {number!r} has length {length:g} m", "give a positive length")
    if length > LONGEST:
        collector.report_error(element, f"road {number!r} has length {length:g} m", f"at most {LONGEST:g} m are read")
        length = 1.0
    rule = element.get("rule", "RHT")
    if rule not in ("RHT", "LHT"):
        collector.report_error(element, f"road {number!r} has rule={rule!r}", suggestion(rule, ("RHT", "LHT")))
    reference = read_reference_line(element, length, collector)
    length = reference.length
    lanes = _permanent_lanes(number, element, collector)
    lane_offset = Polynomials()
    sections: tuple[LaneSection, ...] = ()
    if lanes is None:
        collector.report_error(element, f"road {number!r} has no <lanes>", "add its lanes")
    else:
        lane_offset = _profile(lanes, "laneOffset", collector)
        sections = read_sections(lanes, length, lane_offset, collector)
    junction = element.get("junction", "-1")
    for profile in element.iterfind("lateralProfile/*"):
        if profile.tag == "crossSectionSurface" or (
            profile.tag in ("shape", "crossfall") and any([collector.number(profile, name, 0.0) for name in "abcd"])
        ):
            message = f"road {number!r} has <{profile.tag}>, which is ignored: its cross section is straight"
            hint = "specify the slope by <superelevation>"
            collector.report_warning(profile, MapRule.ROAD_SURFACE, "ignored cross sections", message, hint)
    return Road(
        id=number,
        name=element.get("name", ""),
        length=length,
        rule="LHT" if rule == "LHT" else "RHT",
        junction_id=None if junction in ("-1", "") else junction,
        reference=reference,
        elevation=_profile(element, "elevationProfile/elevation", collector),
        superelevation=_profile(element, "lateralProfile/superelevation", collector),
        lane_offset=lane_offset,
        sections=sections,
        predecessor=_read_link(element.find("link/predecessor"), collector),
        successor=_read_link(element.find("link/successor"), collector),
        types=tuple(sorted((_read_type(kind, collector) for kind in element.iterfind("type")), key=attrgetter("s"))),
        line=line_of(element),
        section_starts=tuple(section.s for section in sections),
    )


def _permanent_lanes(number: str, road: etree._Element, collector: AttributeReader) -> etree._Element | None:
    """Return the permanent lanes of a road, the only ones before OpenDRIVE 1.9; None for a road without lanes."""
    layers = road.findall("lanes")
    permanent = next((lanes for lanes in layers if lanes.get("layer") != "temporary"), layers[0] if layers else None)
    for lanes in layers:
        if lanes is not permanent and lanes.get("layer") == "temporary":
            message = f"road {number!r} has a temporary layer of lanes, which is ignored"
            hint = "give a road file with the temporary lanes as its only ones"
            collector.report_warning(lanes, MapRule.LANE_LAYER, "ignored layers of lanes", message, hint)
    return permanent


def _profile(parent: etree._Element, path: str, collector: AttributeReader) -> Polynomials:
    return Polynomials(collector.pieces(parent.iterfind(path), "s"))


def _read_type(element: etree._Element, collector: AttributeReader) -> RoadType:
    speed = element.find("speed")
    limit = None if speed is None else read_speed(speed, collector)
    return RoadType(collector.number(element, "s"), element.get("type", "unknown"), limit)


def _read_link(element: etree._Element | None, collector: AttributeReader) -> RoadLink | None:
    if element is None:
        return None
    kind = collector.text(element, "elementType", "road")
    if kind not in ("road", "junction"):
        hint = suggestion(kind, ("road", "junction"))
        collector.report_error(element, f"<{element.tag}> has elementType={kind!r}", hint)
        return None
    number = collector.text(element, "elementId")
    if kind == "road" and element.get("elementS") is not None:
        # Virtual junctions (1.6 to 1.8) connect roads between their ends.
        message = f"a road is linked to road {number!r} between its ends; the link is ignored"
        hint = "split that road there and connect the parts by a junction"
        collector.report_warning(element, MapRule.ROAD_LINK, "roads linked to others between their ends", message, hint)
        return None
    contact = collector.contact(element, "contactPoint")
    return RoadLink(cast(Literal["road", "junction"], kind), number, contact, line_of(element))


def _read_junction(element: etree._Element, roads: dict[str, Road], collector: AttributeReader) -> Junction:
    read = [_read_connection(connection, roads, collector) for connection in element.iterfind("connection")]
    connections = [connection for connection in read if connection is not None]
    number, kind = collector.text(element, "id"), element.get("type", "default")
    if kind == "virtual":
        connections = [link for link in connections if _ends_at(roads[link.incoming_road], number)]
    return Junction(
        id=number,
        name=element.get("name", ""),
        type=kind,
        connections=tuple(connections),
        controllers=tuple(collector.text(controller, "id") for controller in element.iterfind("controller")),
        priorities=_read_priorities(element, roads, collector),
    )


def _read_priorities(
    junction: etree._Element, roads: dict[str, Road], collector: AttributeReader
) -> tuple[tuple[str, str], ...]:
    """Return the pairs of roads with and without priority; incomplete pairs, optional up to 1.5, have no effect."""
    pairs = []
    for element in junction.iterfind("priority"):
        pair = element.get("high", ""), element.get("low", "")
        if all(road in roads for road in pair):
            pairs.append(pair)
            continue
        message = f"<priority> of junction {junction.get('id')!r} has no effect: high={pair[0]!r}, low={pair[1]!r}"
        hint = "specify the ids of two connecting roads"
        collector.report_warning(element, MapRule.JUNCTION_CONNECTION, "priorities without roads", message, hint)
    return tuple(pairs)


def _ends_at(road: Road, junction: str) -> bool:
    """Return whether an end of the road is at the junction. Virtual junctions without an end are not connected."""
    ends = (road.predecessor, road.successor)
    return any(link is not None and (link.element_type, link.element_id) == ("junction", junction) for link in ends)


def _read_connection(element: etree._Element, roads: dict[str, Road], collector: AttributeReader) -> Connection | None:
    incoming = element.get("incomingRoad")
    connecting = element.get("connectingRoad", element.get("linkedRoad"))
    if incoming is None or connecting is None:
        if element.get("type") != "virtual":
            collector.report_error(element, "<connection> lacks incomingRoad or connectingRoad", "give both")
        return None
    missing = [number for number in (incoming, connecting) if number not in roads]
    for number in missing:
        message = f"<connection> refers to road {number!r}, which does not exist"
        kind, hint = "connections of missing roads", suggestion(number, roads)
        collector.report_warning(element, MapRule.JUNCTION_CONNECTION, kind, message, hint)
    links = tuple(
        (collector.integer(link, "from"), collector.integer(link, "to")) for link in element.iterfind("laneLink")
    )
    contact = collector.contact(element, "contactPoint") or "start"
    if missing:
        return None
    return Connection(element.get("id", ""), incoming, connecting, contact, links, line_of(element))


def _with_valid_links(
    road: Road, roads: dict[str, Road], junctions: dict[str, Junction], collector: AttributeReader
) -> Road:
    """Return the road without links to what does not exist. Parts of maps have such links, and SUMO's dead ends."""

    def valid_link(link: RoadLink | None) -> RoadLink | None:
        targets = {} if link is None else roads if link.element_type == "road" else junctions
        if link is None or link.element_id in targets:
            return link
        message = f"road {road.id!r} links to {link.element_type} {link.element_id!r}, which does not exist"
        hint = f"remove the link or add the {link.element_type}"
        warning = MapWarning(MapRule.ROAD_LINK, "links to missing roads and junctions", message, hint, link.line)
        collector.map_warnings.append(warning)
        return None

    return replace(road, predecessor=valid_link(road.predecessor), successor=valid_link(road.successor))
