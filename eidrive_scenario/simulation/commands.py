"""Our CustomCommandActions, read once before the run, so that a mistake in a late event is told at once."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from eidrive_scenario.errors import Diagnostic, InputError, ScenarioError, suggestion
from eidrive_scenario.evaluation.criteria_parser import parse_criteria
from eidrive_scenario.library import library_path
from eidrive_scenario.openscenario import Scenario
from eidrive_scenario.openscenario.model import CustomCommandAction
from eidrive_scenario.openscenario.variation import COMMAND as VARIATION
from eidrive_scenario.openscenario.variation import drawn_parameters
from eidrive_scenario.v2x.profile import load_profile

PREFIX = "eidrive."
CHANNEL = "eidrive.channel"
CRITERION = "eidrive.criterion"


def check_commands(scenario: Scenario) -> None:
    """Read every command of ours in the scenario. Raises ScenarioError with all that is wrong in them."""
    declared = scenario.document.monitor_declarations
    monitors = [one.name for one in declared.monitor_declaration] if declared is not None else []
    readers: Mapping[str, Callable[[CustomCommandAction], object]] = {
        CHANNEL: lambda command: load_profile(
            command.content,
            (library_path() / "channels",),
            origin=command.source,
            line=command.line,
            scope=command.scope,
        ),
        CRITERION: lambda command: parse_criteria(
            command.content,
            source=command.source,
            line=command.line,
            entities=scenario.entities,
            monitors=monitors,
            scope=command.scope,
        ),
        VARIATION: lambda _: drawn_parameters(scenario, 0),
    }
    diagnostics: list[Diagnostic] = []
    for command in scenario.custom_commands:
        if not command.type.startswith(PREFIX):
            continue
        reader = readers.get(command.type)
        if reader is None:
            what = f"unknown command type {command.type!r}"
            diagnostics.append(Diagnostic(what, suggestion(command.type, readers), command.source, command.line))
            continue
        try:
            reader(command)
        except InputError as error:
            diagnostics += error.diagnostics
    if diagnostics:
        raise ScenarioError(list(dict.fromkeys(diagnostics)))
