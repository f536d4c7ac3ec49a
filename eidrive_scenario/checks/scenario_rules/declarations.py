"""Rules on what is declared: parameters, variables, monitors, selections and catalogs that nobody uses."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import cast

from lxml import etree

from eidrive_scenario.checks.rule import at
from eidrive_scenario.checks.scenario_rules.context import LintContext
from eidrive_scenario.errors import Diagnostic
from eidrive_scenario.files.bounded import absolute
from eidrive_scenario.openscenario.catalogs import catalog_place
from eidrive_scenario.openscenario.model import (
    CustomCommandAction,
    EntitySelection,
    MonitorDeclaration,
    ParameterAction,
    ParameterCondition,
    VariableDeclaration,
)
from eidrive_scenario.openscenario.values.parameters import REFERENCE

_WORD = re.compile(r"\w+")


def unused_parameters(context: LintContext) -> Iterator[Diagnostic]:
    """A declared parameter to whose value nothing in its scope refers."""
    if not context.files:
        return
    scenario, *catalogs = context.files
    for declarations in scenario.iter("ParameterDeclarations"):
        scope = declarations.getparent()
        if scope is None:
            continue
        roots = [scope, *catalogs] if scope is scenario else [scope]
        used = {name for root in roots for name in _used(root)}
        for declaration in declarations.iter("ParameterDeclaration"):
            name = declaration.get("name", "").removeprefix("$")
            if name not in used:
                yield Diagnostic(
                    f"the parameter {name!r} is never used",
                    f"take it out, or write ${name} where its value belongs",
                    context.scenario.document.source,
                    cast("int | None", declaration.sourceline),
                )


def _used(root: etree._Element) -> set[str]:
    """The parameters whose value is asked for below an element; every word of a text counts, as commands are texts."""
    used: set[str] = set()
    for node in root.iter(etree.Element):
        for key, value in cast(list[tuple[str, str]], node.items()):
            if key == "parameterRef" and node.tag != "ParameterAssignment":
                used.add(value.removeprefix("$"))
            if "$" in value:
                used.update(REFERENCE.findall(value))
        if node.text and not node.text.isspace():
            used.update(_WORD.findall(node.text))
    return used


def unread_parameters(context: LintContext) -> Iterator[Diagnostic]:
    """A ParameterAction sets what no condition looks at: `$name` has got its value when the file was read."""
    read = {one.parameter_ref for one in context.elements if isinstance(one, ParameterCondition)}
    for element in context.elements:
        if isinstance(element, ParameterAction) and element.parameter_ref not in read:
            yield at(
                element,
                f"no condition looks at the parameter {element.parameter_ref!r} that is set here",
                f"${element.parameter_ref} keeps the value that it had when the file was read",
            )


def unused_variables(context: LintContext) -> Iterator[Diagnostic]:
    """A variable that no condition and no action names."""
    named = context.named.get("variable", set()) | _in_commands(context)
    for element in context.elements:
        if isinstance(element, VariableDeclaration) and element.name not in named:
            yield at(element, f"the variable {element.name!r} is never used", "take it out")


def unused_monitors(context: LintContext) -> Iterator[Diagnostic]:
    """A monitor that no action sets."""
    for element in context.elements:
        if isinstance(element, MonitorDeclaration) and element.name not in context.named.get("monitor", set()):
            yield at(element, f"no SetMonitorAction sets the monitor {element.name!r}", "set it, or take it out")


def unused_selections(context: LintContext) -> Iterator[Diagnostic]:
    """A selection of entities that nothing refers to."""
    named = context.named.get("entity", set()) | _in_commands(context)
    for element in context.elements:
        if isinstance(element, EntitySelection) and element.name not in named:
            yield at(element, f"the selection {element.name!r} is never used", "take it out")


def unused_catalogs(context: LintContext) -> Iterator[Diagnostic]:
    """A place for catalogs from which no entry is taken."""
    locations, path = context.scenario.document.catalog_locations, context.scenario.path
    if locations is None:
        return
    folder = path.parent if path is not None else Path()
    used = {absolute(entry.source) for entry in context.scenario.entries.values()}
    for location in locations.children():
        kind = type(location).__name__.removesuffix("Location")
        directory = getattr(location, "directory", None)
        if directory is None:
            continue
        place = absolute(catalog_place(directory.path, folder))
        if not any(file == place or file.parent == place for file in used):
            gone = "" if os.path.exists(place) else ", which is not there,"
            yield at(location, f"nothing is taken from the {kind} {directory.path!r}{gone}".rstrip(","), "take it out")


def _in_commands(context: LintContext) -> set[str]:
    """All words in custom commands: whoever executes them may look a name up."""
    texts = [one.content for one in context.elements if isinstance(one, CustomCommandAction)]
    return {word for text in texts for word in _WORD.findall(text)}
