"""Tolerated schema deviations of authoring tools with a single possible meaning.

Users of the tools cannot correct them. Such a file is read with the intended content, and with a warning.
scenariogeneration 0.16 writes all of them.
"""

from __future__ import annotations

import copy
from collections.abc import Callable

import msgspec
from lxml import etree

from eidrive_scenario.files.untrusted_xml import line_of
from eidrive_scenario.openscenario.diagnostics import DiagnosticCollector, Location
from eidrive_scenario.openscenario.values.scalars import Version


class Workaround(msgspec.Struct, frozen=True):
    """Repair of one deviation in elements of one name.

    since, before  versions of the standard in which it is a deviation
    applies        returns whether an element has the deviation
    repair         corrects an element
    """

    element: str
    message: str
    hint: str
    applies: Callable[[etree._Element], bool]
    repair: Callable[[etree._Element], None]
    since: Version = (1, 0)
    before: Version = (2, 0)


def apply_workarounds(
    root: etree._Element, name: str, version: Version, collector: DiagnosticCollector
) -> etree._Element:
    """Return the tree itself, or a repaired copy with a warning for each deviation."""
    by_tag = {entry.element: entry for entry in WORKAROUNDS if entry.since <= version < entry.before}
    deviating = [node for node in root.iter(*by_tag) if by_tag[str(node.tag)].applies(node)]
    if not deviating:
        return root
    for node in deviating:
        workaround = by_tag[str(node.tag)]
        collector.warning(workaround.message, workaround.hint, at=Location(name, line_of(node)))
    repaired = copy.deepcopy(root)
    for node in list(repaired.iter(*by_tag)):
        workaround = by_tag[str(node.tag)]
        if workaround.applies(node):
            workaround.repair(node)
    return repaired


def _new_group_state(node: etree._Element) -> None:
    for child in node.iterchildren("TrafficeSignalGroupState"):
        child.tag = "TrafficSignalGroupState"


def _maneuver_first(node: etree._Element) -> bool:
    tags = [child.tag for child in node.iterchildren("Maneuver", "CatalogReference")]
    return tags != sorted(tags)


def _catalog_references_first(node: etree._Element) -> None:
    first = next(node.iterchildren("Maneuver"))
    for reference in list(node.iterchildren("CatalogReference")):
        first.addprevious(reference)


def _wrapped_command(node: etree._Element) -> None:
    for command in list(node.iterchildren("CustomCommandAction")):
        parent = etree.Element("UserDefinedAction")
        parent.sourceline = command.sourceline
        node.replace(command, parent)
        parent.append(command)


WORKAROUNDS = (
    *(
        Workaround(
            holder,
            f"{holder} contains a CustomCommandAction without a UserDefinedAction",
            "put it into a UserDefinedAction; other tools may reject it",
            lambda node: node.find("CustomCommandAction") is not None,
            _wrapped_command,
        )
        for holder in ("Actions", "Action")
    ),
    Workaround(
        "MiscObject",
        "MiscObject has the misspelled category 'grafficIsland'",
        "write trafficIsland; other tools may reject it",
        lambda node: node.get("miscObjectCategory") == "grafficIsland",
        lambda node: node.set("miscObjectCategory", "trafficIsland"),
    ),
    Workaround(
        "ManeuverGroup",
        "ManeuverGroup has a CatalogReference after a Maneuver",
        "put CatalogReferences first; other tools may reject it",
        _maneuver_first,
        _catalog_references_first,
    ),
    Workaround(
        "LightStateAction",
        "LightStateAction has LightState before LightType",
        "put LightType first; other tools may reject it",
        lambda node: [child.tag for child in node.iterchildren(etree.Element)] == ["LightState", "LightType"],
        lambda node: node.append(node[node.index(next(node.iterchildren("LightState")))]),
    ),
    Workaround(
        "Phase",
        "TrafficeSignalGroupState is the spelling of OpenSCENARIO up to 1.2",
        "write TrafficSignalGroupState; other tools may reject it",
        lambda node: node.find("TrafficeSignalGroupState") is not None,
        _new_group_state,
        since=(1, 3),
    ),
    Workaround(
        "Sun",
        "Sun has the illuminance of OpenSCENARIO 1.2 instead of intensity",
        "write intensity, or increase revMinor to 2; other tools may reject it",
        lambda node: "illuminance" in node.attrib and "intensity" not in node.attrib,
        lambda node: node.set("intensity", str(node.attrib.pop("illuminance"))),
        before=(1, 2),
    ),
)
