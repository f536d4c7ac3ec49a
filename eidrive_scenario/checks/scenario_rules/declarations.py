"""Rules about unused declarations: parameters, variables, monitors, selections and catalogs."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import cast

from lxml import etree

from eidrive_scenario.checks.rule import at
from eidrive_scenario.checks.scenario_rules.context import LintContext
from eidrive_scenario.checks.scenario_rules.outline import WORD
from eidrive_scenario.errors import Diagnostic
from eidrive_scenario.extensions.library import resolve_path
from eidrive_scenario.files.bounded import absolute
from eidrive_scenario.files.untrusted_xml import line_of
from eidrive_scenario.openscenario import model
from eidrive_scenario.openscenario.conventions import is_agent_controller, property_entries
from eidrive_scenario.openscenario.values.expressions import REFERENCE
from eidrive_scenario.simulation.commands import profile_files


def unused_parameters(context: LintContext) -> Iterator[Diagnostic]:
    """Yield declared parameters without a reference in their scope."""
    if not context.files:
        return
    scenario, *catalogs = context.files
    texts = context.texts_of([*profile_files(context.scenario), *context.added])
    outside = {name for text in texts for name in REFERENCE.findall(text)}
    for declarations in scenario.iter("ParameterDeclarations"):
        scope = declarations.getparent()
        if scope is None:
            continue
        roots = [scope, *catalogs] if scope is scenario else [scope]
        used = {name for root in roots for name in _used(root)} | outside
        for declaration in declarations.iter("ParameterDeclaration"):
            name = declaration.get("name", "").removeprefix("$")
            if name not in used:
                yield Diagnostic(
                    f"parameter {name!r} is never used",
                    f"remove it, or use its value as ${name}",
                    context.scenario.document.source,
                    line_of(declaration),
                )


def _used(root: etree._Element) -> set[str]:
    """Return the parameters that are used below an element; each word of a text counts, as commands are texts."""
    used: set[str] = set()
    for node in root.iter(etree.Element):
        for key, value in cast(list[tuple[str, str]], node.items()):
            if key == "parameterRef" and node.tag != "ParameterAssignment":
                used.add(value.removeprefix("$"))
            if "$" in value:
                used.update(REFERENCE.findall(value))
    for text in cast(list[str], root.xpath("descendant-or-self::text()")):
        used.update(WORD.findall(text))
    return used


def ineffective_parameter_actions(context: LintContext) -> Iterator[Diagnostic]:
    """Yield ParameterActions whose parameter no condition reads; `$name` is replaced when the file is read."""
    read = {condition.parameter_ref for condition in context.of(model.ParameterCondition)}
    for action in context.of(model.ParameterAction):
        if action.parameter_ref not in read:
            yield at(
                action,
                f"ParameterAction has no effect: no condition reads parameter {action.parameter_ref!r}",
                f"${action.parameter_ref} keeps the value from the start of the run",
            )


def unused_variables(context: LintContext) -> Iterator[Diagnostic]:
    """Yield variables without a reference."""
    referenced = context.referenced.get("variable", set()) | context.command_words
    for variable in context.of(model.VariableDeclaration):
        if variable.name not in referenced:
            yield at(variable, f"variable {variable.name!r} is never used", "remove it")


def unused_monitors(context: LintContext) -> Iterator[Diagnostic]:
    """Yield monitors that no action sets."""
    referenced = context.referenced.get("monitor", set())
    for monitor in context.of(model.MonitorDeclaration):
        if monitor.name not in referenced:
            yield at(monitor, f"monitor {monitor.name!r} is set by no SetMonitorAction", "set it or remove it")


def unused_selections(context: LintContext) -> Iterator[Diagnostic]:
    """Yield entity selections without a reference.

    A station may cooperate with the stations of a selection whose name is the value of a parameter.
    """
    referenced = context.referenced.get("entity", set()) | context.command_words
    stations = _stations_with_senders(context)
    for selection in context.of(model.EntitySelection):
        if selection.name not in referenced and stations.isdisjoint(context.members(selection.name)):
            yield at(selection, f"selection {selection.name!r} is never used", "remove it")


def _stations_with_senders(context: LintContext) -> set[str]:
    """Return all stations if one of them selects its senders."""
    stations = {
        name: controller
        for name, assigned in context.scenario.controllers.items()
        for controller in assigned
        if is_agent_controller(controller)
    }
    names = (declared.name for controller in stations.values() for declared in property_entries(controller))
    return set(stations) if "cooperates_with" in names else set()


def unused_catalogs(context: LintContext) -> Iterator[Diagnostic]:
    """Yield catalog locations of which no entry is used."""
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
        location_path = absolute(resolve_path(directory.path, folder))
        if not any(file == location_path or file.parent == location_path for file in used):
            missing = "" if os.path.exists(location_path) else ", which does not exist"
            yield at(location, f"no entry of the {kind} {directory.path!r} is used{missing}", "remove it")
