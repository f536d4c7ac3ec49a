"""Network and routes of SUMO: checks of the files, as SUMO would write files or read further ones for some of them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from lxml import etree
from pydantic import Field

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.errors import Diagnostic, ErrorCollector, SettingError, quoted
from eidrive_scenario.extensions.library import resolve_path
from eidrive_scenario.extensions.settings import Settings, parse_settings
from eidrive_scenario.files.bounded import MIB, read_regular_file, reason_of
from eidrive_scenario.files.encodable import printable
from eidrive_scenario.files.untrusted_xml import XmlLimits, line_of, parse_untrusted
from eidrive_scenario.files.yaml_text import load_mapping
from eidrive_scenario.openscenario.model import CustomCommandAction
from eidrive_scenario.openscenario.values.parameters import resolve_references
from eidrive_scenario.roads import RoadNetwork

COMMAND = "eidrive.sumo"
LIMITS = XmlLimits(max_bytes=256 * MIB, max_nodes=4_000_000)
"""Limits of a file of SUMO."""
LANES = 400
"""Maximum number of lanes whose position is compared with the roads of the scenario."""
MATCHING = 0.5
"""Minimum share of them on the roads."""
MAX_DISTANCE = 0.5
"""Maximum mean distance of these from the centers of lanes [m]; up to 0.25 m for lanes of varying width."""
OFF_ROAD = 10.0
"""Distance of lanes off the roads where offsets of the network are compared [m]."""
_UNITS = (1.0, 60.0, 3600.0, 86400.0)
"""Units of the parts of a time such as D:H:M:S, from the last one [s]."""
_WRITING = ("has.", "device.", "file")
"""Starts of the keys of parameters by which SUMO writes files."""


class SumoSettings(Settings):
    """Content of a command `eidrive.sumo`; paths are relative to the scenario.

    network  file of `netconvert`
    routes   files of routes, trips and flows
    """

    network: str
    routes: list[str] = Field(min_length=1)


@dataclass(frozen=True)
class SumoFiles:
    """Contents of the checked files.

    name    name of the network file
    offset  of the coordinates of the network from those of the roads: x, y [m]
    """

    name: str
    network: bytes
    routes: tuple[bytes, ...]
    offset: tuple[float, float]


def sumo_files(command: CustomCommandAction, roads: RoadNetwork) -> SumoFiles:
    """Return the files that a command `eidrive.sumo` states. Raise SettingError with all diagnostics."""
    source, line = command.source, command.line
    hint = "write {network: town.net.xml, routes: [town.rou.xml]}"
    data, lines = load_mapping(command.content, COMMAND, hint, source=source, line=line)
    data = resolve_references(data, command.scope, source=source, line=line, lines=lines)
    settings = parse_settings(SumoSettings, data, source=source, line=line, lines=lines)
    folder = Path(source).parent
    network = resolve_path(settings.network, folder)
    routes: list[bytes] = []
    content, offset = b"", (0.0, 0.0)
    errors = ErrorCollector(SettingError)
    with errors:
        content, root = _read(network, "net")
        offset = _check_network(root, str(network), roads)
    for path in settings.routes:
        with errors:
            file = resolve_path(path, folder)
            route, root = _read(file, "routes")
            routes.append(route)
            _check_order(root, str(file))
    errors.raise_if_any()
    return SumoFiles(network.name, content, tuple(routes), offset)


def _read(path: Path, kind: str) -> tuple[bytes, etree._Element]:
    """Return content and root of a file, which must have the tag `kind`, and no effect but on the traffic."""
    try:
        content = read_regular_file(path, LIMITS.max_bytes)
    except OSError as error:
        hint = f"give the path of a file with the root <{kind}>"
        raise SettingError(Diagnostic(f"cannot read {quoted(str(path))}: {reason_of(error)}", hint)) from error
    root = parse_untrusted(content, str(path), LIMITS, SettingError, remove_comments=True)
    if root.tag != kind:
        message = f"the root element is {root.tag} (expected {kind})"
        raise SettingError(Diagnostic(message, "check the kind of the file", str(path), line_of(root)))
    errors = ErrorCollector(SettingError)
    for element in root.iter("*"):
        with errors:
            name, key = element.get("id", ""), element.get("key", "")
            if element.tag == "include":
                raise SettingError(Diagnostic("<include> is not read", "copy it", str(path), line_of(element)))
            if element.tag == "param" and key.startswith(_WRITING):
                message = f"SUMO writes files by the parameter {quoted(key)}"
                raise SettingError(Diagnostic(message, "remove it", str(path), line_of(element)))
            if printable(name) != name:
                message = f"the id {quoted(name)} has control characters"
                raise SettingError(Diagnostic(message, "remove them", str(path), line_of(element)))
    errors.raise_if_any()
    return content, root


def _check_order(root: etree._Element, source: str) -> None:
    """Require the order of departures, as SUMO ignores all others."""
    latest = 0.0
    for element in root:
        stated = element.get("depart", element.get("begin", ""))
        with suppress(ValueError):  # such as "triggered"
            parts = map(float, reversed(stated.split(":")))
            time = sum(unit * part for unit, part in zip(_UNITS, parts, strict=False))
            if time < latest:
                message = f"the departure at {time:g} s is after one at {latest:g} s; SUMO would ignore it"
                raise SettingError(Diagnostic(message, "sort the file by departure", source, line_of(element)))
            latest = time


def _check_network(root: etree._Element, source: str, roads: RoadNetwork) -> tuple[float, float]:
    """Return the offset of a network, whose lanes must be on the roads."""
    for lane in root.iter("lane"):  # SUMO ends the process at lanes without a length
        for name in ("length", "speed"):
            _point(f"{lane.get(name, '')},0", f"{name} of a lane", source, lane)
    location = root.find("location")
    x, y = _point("" if location is None else location.get("netOffset", ""), "netOffset", source, location)
    points = np.array(list(_lane_points(root, source)), dtype=np.float64).reshape(-1, 2)
    points = points[:: len(points) // LANES + 1]
    # Roads are imported with the offset of their header, and exported in coordinates of the network
    dx, dy, *_ = roads.header.offset
    distances = {offset: _lane_distances(points - offset, roads) for offset in ((x + dx, y + dy), (0.0, 0.0))}
    offset = min(distances, key=lambda offset: float(np.minimum(distances[offset], OFF_ROAD).sum()))
    on_roads = distances[offset][np.isfinite(distances[offset])]
    share = len(on_roads) / max(len(points), 1)
    message = ""
    if share < MATCHING:
        message = f"only {share:.0%} of the lanes of the network are on the roads of the scenario"
    elif (distance := float(on_roads.mean())) > MAX_DISTANCE:
        message = f"the lanes of the network are {distance:.1f} m beside those of the scenario"
    if message:
        hint = "create the network from the road file: netconvert --opendrive-files ROADS.xodr -o NETWORK.net.xml"
        raise SettingError(Diagnostic(message, hint, source))
    return offset


def _lane_distances(points: Array, roads: RoadNetwork) -> Array:
    """Return the distance of points (N, 2) from the centers of their lanes [m]; infinite off the roads."""
    located = roads.locate(points[:, 0], points[:, 1])
    return np.where(located.found & (located.outside <= 0.0), np.abs(located.offset), np.inf)


def _lane_points(root: etree._Element, source: str) -> Iterator[tuple[float, float]]:
    """Yield the middle of the central segment of each lane outside of junctions."""
    for edge in root.iterfind("edge"):
        if edge.get("function", "normal") == "normal":
            for lane in edge.iterfind("lane"):
                points = lane.get("shape", "").split() or [""]
                center = len(points) // 2
                ends = [_point(point, "shape of a lane", source, lane) for point in points[center - 1 : center + 1]]
                (x, y), (next_x, next_y) = ends[0], ends[-1]
                yield 0.5 * (x + next_x), 0.5 * (y + next_y)


def _point(text: str, name: str, source: str, element: etree._Element | None) -> tuple[float, float]:
    """Return the plane coordinates of a point as in files of SUMO. Raise SettingError if they are not finite."""
    with suppress(ValueError):
        x, y, *_ = (float(part) for part in text.split(","))
        if math.isfinite(x) and math.isfinite(y):
            return x, y
    diagnostic = Diagnostic(f"the network has no valid {name}", "create it by netconvert", source, line_of(element))
    raise SettingError(diagnostic)
