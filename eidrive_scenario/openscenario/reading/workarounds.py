"""Slips of programs that write scenarios: what the schema refuses, and what can mean one thing only.

Their users cannot mend them, so that such a file is read as it is meant, with a warning. All of these are written by
scenariogeneration 0.16.
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import dataclass

from lxml import etree

from eidrive_scenario.openscenario.diagnostics import DiagnosticCollector
from eidrive_scenario.openscenario.reading.parsing import line_of
from eidrive_scenario.openscenario.values.scalars import Version


@dataclass(frozen=True)
class Workaround:
    """One of them, in elements of one name.

    since, before  the versions of the standard in which it is one
    found          whether an element has it
    mend           puts it right
    """

    element: str
    message: str
    hint: str
    found: Callable[[etree._Element], bool]
    repair: Callable[[etree._Element], None]
    since: Version = (1, 0)
    before: Version = (2, 0)


def apply_workarounds(
    root: etree._Element, name: str, version: Version, collector: DiagnosticCollector
) -> etree._Element:
    """The tree as it is meant: itself, or a copy where something had to be put right, with a warning for each."""
    slips = {slip.element: slip for slip in WORKAROUNDS if slip.since <= version < slip.before}
    wrong = [node for node in root.iter(*slips) if slips[str(node.tag)].found(node)]
    if not wrong:
        return root
    for node in wrong:
        slip = slips[str(node.tag)]
        collector.warning(slip.message, slip.hint, source=name, line=line_of(node))
    meant = copy.deepcopy(root)
    for node in list(meant.iter(*slips)):
        slip = slips[str(node.tag)]
        if slip.found(node):
            slip.repair(node)
    return meant


def _light_type_second(node: etree._Element) -> bool:
    return [child.tag for child in node.iterchildren(etree.Element)] == ["LightState", "LightType"]


def _light_type_first(node: etree._Element) -> None:
    node.append(node[node.index(next(node.iterchildren("LightState")))])


def _old_group_state(node: etree._Element) -> bool:
    return node.find("TrafficeSignalGroupState") is not None


def _new_group_state(node: etree._Element) -> None:
    for child in node.iterchildren("TrafficeSignalGroupState"):
        child.tag = "TrafficSignalGroupState"


def _illuminance_alone(node: etree._Element) -> bool:
    return "illuminance" in node.attrib and "intensity" not in node.attrib


def _intensity(node: etree._Element) -> None:
    node.set("intensity", str(node.attrib.pop("illuminance")))


def _maneuver_first(node: etree._Element) -> bool:
    tags = [child.tag for child in node.iterchildren("Maneuver", "CatalogReference")]
    return tags != sorted(tags)


def _catalog_references_first(node: etree._Element) -> None:
    first = next(node.iterchildren("Maneuver"))
    for reference in list(node.iterchildren("CatalogReference")):
        first.addprevious(reference)


def _graffic(node: etree._Element) -> bool:
    return node.get("miscObjectCategory") == "grafficIsland"


def _traffic(node: etree._Element) -> None:
    node.set("miscObjectCategory", "trafficIsland")


def _bare_command(node: etree._Element) -> bool:
    return node.find("CustomCommandAction") is not None


def _wrapped_command(node: etree._Element) -> None:
    for command in list(node.iterchildren("CustomCommandAction")):
        around = etree.Element("UserDefinedAction")
        around.sourceline = command.sourceline
        node.replace(command, around)
        around.append(command)


WORKAROUNDS = (
    *(
        Workaround(
            holder,
            f"a CustomCommandAction stands in {holder} by itself",
            "put it into a UserDefinedAction; other tools may refuse it",
            _bare_command,
            _wrapped_command,
        )
        for holder in ("Actions", "Action")
    ),
    Workaround(
        "MiscObject",
        "the category of a MiscObject is written 'grafficIsland'",
        "write trafficIsland; other tools may refuse it",
        _graffic,
        _traffic,
    ),
    Workaround(
        "ManeuverGroup",
        "a CatalogReference stands behind a Maneuver in ManeuverGroup",
        "put CatalogReferences first; other tools may refuse it",
        _maneuver_first,
        _catalog_references_first,
    ),
    Workaround(
        "LightStateAction",
        "LightState stands before LightType in LightStateAction",
        "put LightType first; other tools may refuse it",
        _light_type_second,
        _light_type_first,
    ),
    Workaround(
        "Phase",
        "TrafficeSignalGroupState is the spelling of OpenSCENARIO up to 1.2",
        "write TrafficSignalGroupState; other tools may refuse it",
        _old_group_state,
        _new_group_state,
        since=(1, 3),
    ),
    Workaround(
        "Sun",
        "Sun has the illuminance of OpenSCENARIO 1.3 in place of intensity",
        "write intensity, or raise revMinor to 3; other tools may refuse it",
        _illuminance_alone,
        _intensity,
        before=(1, 3),
    ),
)
