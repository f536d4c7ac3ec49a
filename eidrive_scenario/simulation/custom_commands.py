"""Execution of the CustomCommandActions that this project defines; none of them starts a program."""

from __future__ import annotations

from eidrive_scenario.driving.stations import Stations
from eidrive_scenario.driving.step_checks import short_channel_delay
from eidrive_scenario.evaluation.criteria_parser import EXITS, build_criteria, exit_verdict, parse_criteria
from eidrive_scenario.evaluation.criterion import Criterion, Verdict
from eidrive_scenario.openscenario import Scenario
from eidrive_scenario.simulation.commands import CHANNEL, CRITERION, PREFIX, DeclaredCriteria, command_key
from eidrive_scenario.simulation.run import RunSettings
from eidrive_scenario.storyboard.state.commands import CustomCommand


class CustomCommands:
    """Executor of the commands of one run.

    declared  criteria that the commands of the scenario declare, parsed before the run
    criteria  criteria of the run, extended by commands
    warnings  warnings of the run, extended by commands without effect
    exit      verdict of the command that ends the run; None before it
    """

    def __init__(
        self,
        scenario: Scenario,
        stations: Stations,
        settings: RunSettings,
        declared: DeclaredCriteria,
        criteria: list[Criterion],
        warnings: list[str],
    ) -> None:
        self._scenario = scenario
        self._stations = stations
        self._settings = settings
        self._declared = declared
        self._criteria = criteria
        self._warnings = warnings
        self.exit: Verdict | None = None

    def execute(self, command: CustomCommand, time: float) -> None:
        """Execute a command at `time` [s]. A command of another tool is recorded, has no effect and adds a warning."""
        if command.type == CHANNEL:
            self._select_channel(command)
        elif command.type == CRITERION:
            self._add_criteria(command)
        elif command.type in EXITS:
            self.exit = exit_verdict(command, time)
        elif not command.type.startswith(PREFIX):
            self._warnings.append(
                f"{command.source}:{command.line}: command of type {command.type!r} is recorded, not executed"
            )

    def _select_channel(self, command: CustomCommand) -> None:
        self._stations.request_channel(command.content, source=command.source, line=command.line, scope=command.scope)
        if self._settings.channel is None:
            profile, dt = self._stations.channel_profile, self._settings.dt
            self._warnings += map(str, short_channel_delay(profile, dt, command.source, command.line))

    def _add_criteria(self, command: CustomCommand) -> None:
        declarations = self._declared.get(command_key(command))
        if declarations is None:  # a command that an action of an extension has created
            declarations = parse_criteria(
                command.content,
                source=command.source,
                line=command.line,
                entities=self._scenario.entities,
                scope=command.scope,
            )
        self._criteria += build_criteria(declarations, [criterion.name for criterion in self._criteria])
