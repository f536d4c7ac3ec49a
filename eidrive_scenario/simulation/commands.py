"""Check of this project's CustomCommandActions and of added criteria before a run.

Errors in late events are thus reported at once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from eidrive_scenario.errors import Diagnostic, InputError, ScenarioError, SettingError, quoted, suggestion
from eidrive_scenario.evaluation.criteria_parser import (
    CRITERION,
    CriterionDeclaration,
    declare_criteria,
    parse_criteria,
)
from eidrive_scenario.files.yaml_text import read_yaml_source
from eidrive_scenario.library import library_path
from eidrive_scenario.openscenario import Scenario
from eidrive_scenario.openscenario.model import (
    AcquirePositionAction,
    AssignRouteAction,
    CustomCommandAction,
    RandomRouteAction,
)
from eidrive_scenario.openscenario.values.parameters import Scope
from eidrive_scenario.openscenario.variation import COMMAND as VARIATION
from eidrive_scenario.openscenario.variation import variations
from eidrive_scenario.registry import registry
from eidrive_scenario.storyboard.state.commands import CustomCommand
from eidrive_scenario.v2x.profile import ChannelProfile, load_profile, profile_file

PREFIX = "eidrive."
CHANNEL = "eidrive.channel"
CRITERION_OPTION = "--criterion"
ROUTING = (AcquirePositionAction, AssignRouteAction, RandomRouteAction)
"""Actions that request a route."""

CommandKey = tuple[str, str, int | None, int]
DeclaredCriteria = Mapping[CommandKey, tuple[CriterionDeclaration, ...]]
"""Parsed criteria by the command that declares them."""


def command_key(command: CustomCommandAction | CustomCommand) -> CommandKey:
    """Return the identity of a command. The parameters in scope may differ for equal texts on one line."""
    return command.content, command.source, command.line, id(command.scope)


def channel_profile(command: CustomCommandAction) -> ChannelProfile | None:
    """Return the profile of a command `eidrive.channel`, None for no cooperation. Raise SettingError."""
    folders = (library_path() / "channels",)
    return load_profile(command.content, folders, origin=command.source, line=command.line, scope=command.scope)


def profile_files(scenario: Scenario) -> Iterator[Path]:
    """Yield the files of the channel profiles that a scenario selects."""
    for command in scenario.custom_commands:
        if command.type == CHANNEL:
            folders = (library_path() / "channels",)
            with suppress(SettingError):  # of an invalid reference, which `check_commands` reports
                path = profile_file(command.content, folders, origin=command.source, scope=command.scope)
                yield from () if path is None else (path,)


def check_commands(scenario: Scenario) -> DeclaredCriteria:
    """Parse all commands of this project and return the declared criteria. Raise ScenarioError with all diagnostics."""
    criteria: dict[CommandKey, tuple[CriterionDeclaration, ...]] = {}
    has_routes = cache(lambda: _requests_routes(scenario))

    def read_criteria(command: CustomCommandAction) -> None:
        criteria[command_key(command)] = parse_criteria(
            command.content,
            source=command.source,
            line=command.line,
            entities=scenario.entities,
            monitors=_monitors(scenario),
            scope=command.scope,
            has_roads=scenario.road_file is not None,
            has_routes=has_routes(),
        )

    readers: Mapping[str, Callable[[CustomCommandAction], object]] = {
        CHANNEL: channel_profile,
        CRITERION: read_criteria,
        VARIATION: lambda _: variations(scenario),
    }
    diagnostics: list[Diagnostic] = []
    for command in scenario.custom_commands:
        if not command.type.startswith(PREFIX):
            continue
        reader = readers.get(command.type)
        if reader is None:
            message = f"unknown command type {command.type!r}"
            diagnostics.append(Diagnostic(message, suggestion(command.type, readers), command.source, command.line))
            continue
        try:
            reader(command)
        except InputError as error:
            diagnostics += error.diagnostics
    if diagnostics:
        raise ScenarioError(list(dict.fromkeys(diagnostics)))
    return criteria


def check_added_criteria(scenario: Scenario, sources: Iterable[str | Path]) -> tuple[CriterionDeclaration, ...]:
    """Parse the criteria that the settings of a run add, YAML texts and files.

    Raise SettingError with all diagnostics.
    """
    if not (sources := tuple(sources)):
        return ()
    return parse_added_criteria(sources, criteria_context(scenario), scope=scenario.scope)


@dataclass(frozen=True)
class CriteriaContext:
    """Content of a scenario to which criteria refer; None for names that are unknown and therefore not checked.

    entities, monitors  their names
    has_roads           whether the scenario has roads
    has_routes          whether the scenario, or an action of an extension, may request a route
    """

    entities: tuple[str, ...] | None = None
    monitors: tuple[str, ...] | None = None
    has_roads: bool = True
    has_routes: bool = True


def criteria_context(scenario: Scenario) -> CriteriaContext:
    """Return the content of a scenario to which criteria refer."""
    roads = scenario.road_file is not None
    return CriteriaContext(tuple(scenario.entities), tuple(_monitors(scenario)), roads, _requests_routes(scenario))


def parse_added_criteria(
    sources: Iterable[str | Path], context: CriteriaContext, scope: Scope | None = None
) -> tuple[CriterionDeclaration, ...]:
    """Parse criteria, given as YAML texts and files. Raise SettingError with all diagnostics.

    scope  parameters to which settings refer
    """
    found: list[CriterionDeclaration] = []
    diagnostics: list[Diagnostic] = []
    for source in sources:
        try:
            content = read_yaml_source(source, option=CRITERION_OPTION)
            found += declare_criteria(
                content.data,
                content.lines,
                source=content.source,
                entities=context.entities,
                monitors=context.monitors,
                scope=scope,
                has_roads=context.has_roads,
                has_routes=context.has_routes,
                shown=quoted(content.data),
            )
        except InputError as error:
            diagnostics += error.diagnostics
    if diagnostics:
        raise SettingError(list(dict.fromkeys(diagnostics)))
    return tuple(found)


def _requests_routes(scenario: Scenario) -> bool:
    """Whether an action of the scenario, or of an extension, may request a route."""
    own = registry("actions")
    return any(
        isinstance(element, ROUTING) or (isinstance(element, CustomCommandAction) and element.type in own)
        for tree in (scenario.document, *scenario.entries.values())
        for element in tree.walk()
    )


def _monitors(scenario: Scenario) -> list[str]:
    declared = scenario.document.monitor_declarations
    return [one.name for one in declared.monitor_declaration] if declared is not None else []
