"""Everything that can be said against a scenario without playing it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from eidrive_scenario.errors import InputError, Problem, ScenarioError, suggestion
from eidrive_scenario.library import library_path
from eidrive_scenario.openscenario import Scenario, load_scenario
from eidrive_scenario.openscenario.model import CustomCommandAction
from eidrive_scenario.openscenario.variation import drawn_parameters
from eidrive_scenario.recording.criteria_text import parse_criteria, stop_trigger_criteria, unbuilt_criteria
from eidrive_scenario.simulation import Simulation
from eidrive_scenario.v2x.profile import load_profile

_OURS = "eidrive."


@dataclass(frozen=True)
class Findings:
    """What keeps a scenario from being played, and what is worth knowing."""

    problems: tuple[Problem, ...]
    warnings: tuple[Problem, ...] = ()


def inspect_scenario(path: Path) -> Findings:
    """Read a scenario with its roads, controllers, channels and criteria; every problem says where and what is right.

    Commands of later events are read too, which a run would only meet on its way.
    """
    try:
        scenario = load_scenario(path)
    except InputError as error:
        return Findings(error.problems)
    problems: list[Problem] = []
    for examine in (_commands, _stop_trigger, _construction):
        problems += examine(scenario)
    unbuilt = [problem for problem in unbuilt_criteria(scenario) if problem not in scenario.warnings]
    return Findings(tuple(dict.fromkeys(problems)), (*scenario.warnings, *unbuilt))


def _commands(scenario: Scenario) -> list[Problem]:
    readers: dict[str, Callable[[CustomCommandAction], object]] = {
        "eidrive.criterion": lambda command: parse_criteria(
            command.content, source=command.source, line=command.line, entities=scenario.entities
        ),
        "eidrive.channel": lambda command: load_profile(
            command.content, (library_path() / "channels",), origin=command.source, line=command.line
        ),
        "eidrive.variation": lambda _: drawn_parameters(scenario, 0),
    }
    problems: list[Problem] = []
    for command in scenario.storyboard.walk():
        if not isinstance(command, CustomCommandAction) or not command.type.startswith(_OURS):
            continue
        try:
            if command.type not in readers:
                message = f"unknown command type {command.type!r}"
                raise ScenarioError(Problem(message, suggestion(command.type, readers), command.source, command.line))
            readers[command.type](command)
        except InputError as error:
            problems += error.problems
    return problems


def _stop_trigger(scenario: Scenario) -> list[Problem]:
    try:
        stop_trigger_criteria(scenario)
    except InputError as error:
        return list(error.problems)
    return []


def _construction(scenario: Scenario) -> list[Problem]:
    """Roads, controllers, first positions: what building the run finds."""
    try:
        Simulation(scenario).close()
    except InputError as error:
        return list(error.problems)
    return []
