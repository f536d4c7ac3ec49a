"""Commands of the storyboard to the engine: channel, criteria and end of the run; their checks and their execution."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from functools import cache
from pathlib import Path

import msgspec

from eidrive_scenario.driving.stack import DrivingStack, StackInputs
from eidrive_scenario.driving.traffic_stations import COMMAND as TRAFFIC_STATIONS
from eidrive_scenario.driving.traffic_stations import parse_traffic_stations
from eidrive_scenario.errors import Diagnostic, ErrorCollector, ScenarioError, SettingError, quoted, suggestion
from eidrive_scenario.evaluation.criteria_parser import (
    CRITERION,
    EXITS,
    CriteriaContext,
    CriterionDeclaration,
    build_criteria,
    declaration_text,
    declare_criteria,
    exit_verdict,
    parse_criteria,
)
from eidrive_scenario.evaluation.criterion import Criterion, Verdict, bind_roads
from eidrive_scenario.extensions.registry import registry
from eidrive_scenario.files.yaml_text import read_yaml_source
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
from eidrive_scenario.recording.frame import ExecutedCommand
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.storyboard.state.commands import Commands, CustomCommand
from eidrive_scenario.v2x.profile import ChannelProfile, load_profile, profile_file
from eidrive_scenario.world import World
from eidrive_scenario.world.environment import Environment, weather_from_environment
from eidrive_scenario.world.specs import actor_spec
from eidrive_scenario.world.view import WorldView

PREFIX = "eidrive."
CHANNEL = "eidrive.channel"
CRITERION_OPTION = "RunSettings.criteria"
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
    return load_profile(command.content, origin=command.source, line=command.line, scope=command.scope)


def _read_traffic_stations(command: CustomCommandAction) -> None:
    parse_traffic_stations(command.content, source=command.source, line=command.line, scope=command.scope)


def profile_files(scenario: Scenario) -> Iterator[Path]:
    """Yield the files of the channel profiles that a scenario selects."""
    for command in scenario.custom_commands:
        if command.type == CHANNEL:
            with suppress(SettingError):  # of an invalid reference, which `check_commands` reports
                path = profile_file(command.content, origin=command.source, scope=command.scope)
                yield from () if path is None else (path,)


def check_commands(scenario: Scenario) -> DeclaredCriteria:
    """Parse all commands of this project and return the declared criteria. Raise ScenarioError with all diagnostics."""
    criteria: dict[CommandKey, tuple[CriterionDeclaration, ...]] = {}
    context = cache(lambda: criteria_context(scenario))

    def read_criteria(command: CustomCommandAction) -> None:
        criteria[command_key(command)] = parse_criteria(
            command.content, context(), source=command.source, line=command.line, scope=command.scope
        )

    readers: Mapping[str, Callable[[CustomCommandAction], object]] = {
        CHANNEL: channel_profile,
        TRAFFIC_STATIONS: _read_traffic_stations,
        CRITERION: read_criteria,
        VARIATION: lambda _: variations(scenario),
    }
    errors = ErrorCollector(ScenarioError)
    for command in scenario.custom_commands:
        with errors:
            if command.type in readers:
                readers[command.type](command)
            elif command.type.startswith(PREFIX) and command.type not in registry("actions"):
                message = f"unknown command type {command.type!r}"
                raise ScenarioError(Diagnostic.at(command, message, suggestion(command.type, readers)))
    errors.raise_if_any()
    return criteria


def check_added_criteria(scenario: Scenario, sources: Iterable[str | Path]) -> tuple[CriterionDeclaration, ...]:
    """Parse the criteria that the settings of a run add, YAML texts and files.

    Raise SettingError with all diagnostics.
    """
    if not (sources := tuple(sources)):
        return ()
    return parse_added_criteria(sources, criteria_context(scenario), scope=scenario.scope)


def criteria_context(scenario: Scenario) -> CriteriaContext:
    """Return the content of a scenario to which criteria refer."""
    declared = scenario.document.monitor_declarations
    monitors = () if declared is None else tuple(monitor.name for monitor in declared.monitor_declaration)
    roads = scenario.road_file is not None
    return CriteriaContext(tuple(scenario.entities), monitors, roads, _requests_routes(scenario))


def parse_added_criteria(
    sources: Iterable[str | Path], context: CriteriaContext, scope: Scope | None = None
) -> tuple[CriterionDeclaration, ...]:
    """Parse criteria, given as YAML texts and files. Raise SettingError with all diagnostics.

    scope  parameters to which settings refer
    """
    declarations: list[CriterionDeclaration] = []
    errors = ErrorCollector(SettingError)
    for source in sources:
        with errors:
            content = read_yaml_source(source, option=CRITERION_OPTION)
            declarations += declare_criteria(
                content.data,
                content.lines,
                context,
                source=content.source,
                scope=scope,
                shown=quoted(content.data),
            )
    errors.raise_if_any()
    return tuple(declarations)


def _requests_routes(scenario: Scenario) -> bool:
    """Whether an action of the scenario, or of an extension, may request a route."""
    own = registry("actions")
    return any(
        isinstance(element, ROUTING) or (isinstance(element, CustomCommandAction) and element.type in own)
        for tree in (scenario.document, *scenario.entries.values())
        for element in tree.walk()
    )


SUN_PERIOD = 60.0
"""Time between two positions of the sun under a running clock [s], in which it moves by half its diameter."""


class RunState(msgspec.Struct):
    """Objects of a run that commands change.

    weather_fixed  True if an option of the run overrides the weather of the scenario
    declared       criteria that the commands of the scenario declare, parsed before the run
    inputs         requests and signal states for the next step of the stack
    criteria       of the run; commands add to them
    warnings       of the run; commands without effect add to them
    exit           verdict of the command that ends the run; None before it
    executed       custom commands since the last frame
    trailers       trailer of each towing vehicle since the last step of the world, by name
    environment    of the last EnvironmentAction; weather_since  time at which the weather was set [s]
    """

    scenario: Scenario
    roads: RoadNetwork | None
    world: World
    stack: DrivingStack
    weather_fixed: bool
    declared: DeclaredCriteria
    criteria: list[Criterion]
    warnings: list[str]
    inputs: StackInputs = msgspec.field(default_factory=StackInputs)
    exit: Verdict | None = None
    executed: list[ExecutedCommand] = msgspec.field(default_factory=list)
    trailers: Mapping[str, str] = msgspec.field(default_factory=dict)
    environment: Environment | None = None
    weather_since: float = 0.0

    def take_executed(self) -> tuple[ExecutedCommand, ...]:
        """Return the commands since the last call."""
        executed, self.executed = self.executed, []
        return tuple(executed)

    def trailers_in(self, view: WorldView) -> Mapping[str, str]:
        """Return the trailer of each towing vehicle of which both are present."""
        return {front: back for front, back in self.trailers.items() if front in view and back in view}

    def record(self, kind: str, content: str) -> None:
        """Add an executed command."""
        self.executed.append(ExecutedCommand(kind, content, self.world.time))


def execute(commands: Commands, run: RunState) -> None:
    """Execute all commands of one tick but the placements, which are an argument of `World.step`."""
    world, stack = run.world, run.stack
    for name in sorted(commands.removals):
        world.remove(name)
        stack.remove(name)
    if commands.trailers is not run.trailers:  # connected before a trailer enters the world
        run.trailers = commands.trailers
        world.set_trailers([frozenset(pair) for pair in commands.trailers.items()])
    for name, placement in commands.spawns.items():
        spec = commands.actor_specs.get(name) or actor_spec(name, run.scenario.entities[name])
        world.add(spec, placement)
        stack.add(spec)
    for name in sorted(stack.drivers):
        world.set_driven(name, name in commands.driven)
    run.inputs = StackInputs(commands.goals, commands.signals)
    world.set_display_state(commands.signals, commands.appearances)
    _set_weather(commands.environment, run)
    for command in commands.custom:
        _execute_custom(command, run)


def _set_weather(environment: Environment | None, run: RunState) -> None:
    """Set the weather of an EnvironmentAction, unless an option overrides it. The sun follows a running clock."""
    if run.weather_fixed:
        return
    if environment is not None:
        run.environment = environment
    elif run.environment is None or not run.environment.moves_sun or run.world.time < run.weather_since + SUN_PERIOD:
        return
    run.weather_since = run.world.time
    run.world.set_weather(weather_from_environment(run.environment, run.world.time))


def _execute_custom(command: CustomCommand, run: RunState) -> None:
    """Execute a CustomCommandAction. No command starts a program; one of another tool is a warning without effect."""
    if command.type == CRITERION:  # `add_criteria` records criteria with all their settings
        add_criteria(_declared_by(command, run), run)
        return
    run.record(command.type, command.content)
    requests = {CHANNEL: run.stack.request_channel, TRAFFIC_STATIONS: run.stack.request_traffic_stations}
    if command.type in requests:
        scope, line = command.scope, command.line
        warnings = requests[command.type](command.content, source=command.source, line=line, scope=scope)
        run.warnings += map(str, warnings)
    elif command.type in EXITS:
        run.exit = exit_verdict(command, run.world.time)
    elif not command.type.startswith(PREFIX):
        message = f"command of type {command.type!r} is recorded, not executed"
        run.warnings.append(f"{command.source}:{command.line}: {message}")


def _declared_by(command: CustomCommand, run: RunState) -> tuple[CriterionDeclaration, ...]:
    """Return the criteria of a command `eidrive.criterion`."""
    declarations = run.declared.get(command_key(command))
    if declarations is not None:
        return declarations
    # A command that an action of an extension has created
    context = CriteriaContext(tuple(run.scenario.entities), has_roads=run.roads is not None)
    return parse_criteria(command.content, context, source=command.source, line=command.line, scope=command.scope)


def add_criteria(declarations: Iterable[CriterionDeclaration], run: RunState) -> None:
    """Add new criteria. The name of another criterion is not used again."""
    declarations = list(declarations)
    added = build_criteria(declarations, [criterion.name for criterion in run.criteria])
    for declaration, criterion in zip(declarations, added, strict=True):
        bind_roads(criterion, run.roads)
        run.record(CRITERION, declaration_text(declaration, criterion.name))
    run.criteria += added
