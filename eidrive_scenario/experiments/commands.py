"""Command lines that repeat runs.

Paths in a command are absolute, so that it is valid in any folder. With a project (see `eidrive_scenario.project`) they
are relative to its folder, which the command names once: after a copy of the project only this name changes.
"""

from __future__ import annotations

import json
import os
import shlex
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from eidrive_scenario.library import library_path, name_of, resolve_scenario
from eidrive_scenario.openscenario import ConcreteRun, Scenario, Source
from eidrive_scenario.openscenario.values.parameters import Assignment
from eidrive_scenario.project import selected_project
from eidrive_scenario.simulation.added_settings import criteria_sources, drive_sources
from eidrive_scenario.simulation.run import RunResult, RunSettings
from eidrive_scenario.v2x.profile import SUFFIXES


def command_of(scenario: Path, seed: int, settings: RunSettings) -> str:
    """Return the `eidrive run` command that repeats a run, quoted for a shell."""
    defaults = RunSettings()
    project = selected_project()
    words = ["eidrive", *([] if project is None else ["--project", str(project)]), "run", _scenario(scenario)]
    for option, value in (
        ("--channel", _channel(settings.channel)),
        ("--detector", settings.detector),
        ("--planner", settings.planner),
        ("--weather", _file_or_name(settings.weather)),
        ("--cooperate", None if settings.cooperate is None else ",".join(settings.cooperate) or "none"),
    ):
        if value is not None:
            words += _option(option, value)
    for option, values in (
        ("--param", settings.parameters),
        ("--user-value", settings.user_values),
        ("--controller", settings.controllers),
    ):
        words += _assignments(option, values)
    for name, stack in drive_sources(settings.drive).items():
        words += _option("--drive", name if stack is None else f"{name}={_file_or_name(stack)}")
    for criterion in criteria_sources(settings.criteria):
        words += _option("--criterion", str(_file_or_name(criterion)))
    words += ["--seed", str(seed)]
    for option, number, default in (
        ("--dt", settings.dt, defaults.dt),
        ("--time-limit", settings.time_limit, defaults.time_limit),
    ):
        words += [] if number == default else [option, repr(float(number))]
    words += ["--allow-torchscript"] if settings.allow_torchscript else []
    words += ["--no-criteria"] if settings.no_criteria else []
    return shlex.join(words)


def command_of_source(source: Scenario | Source | ConcreteRun, seed: int, settings: RunSettings) -> str:
    """Return the command line that repeats the run; empty for a scenario without a file."""
    given: Mapping[str, str | Assignment] = {}
    path: Any = source
    if isinstance(source, ConcreteRun):
        path, given = source.scenario, source.assignments
    elif isinstance(source, Scenario):
        path, given = source.path, source.assigned
    if not isinstance(path, str | Path):
        return ""
    return command_of(resolve_scenario(path), seed, replace(settings, parameters={**given, **settings.parameters}))


def reproduction_lines(result: RunResult) -> list[str]:
    """Return the command that repeats a run and the path of its recording; empty for a passed run."""
    if result.passed:
        return []
    command = [f"reproduce: {result.command}"] if result.command else []
    return [*command, *([] if result.recording is None else [f"recording: {result.recording}"])]


def _scenario(path: Path) -> str:
    name = name_of(path)
    in_library = path.resolve() == (library_path() / f"{name}.xosc").resolve()
    if in_library and not os.path.exists(os.path.join(selected_project() or "", name)):
        return name
    return _path(path)


def _path(path: str | Path) -> str:
    """Return the absolute path, or the path from the folder of the project for a file below it."""
    full, project = Path(os.path.abspath(path)), selected_project()
    if project is None or not full.is_relative_to(project):
        return str(full)
    relative = full.relative_to(project).as_posix()
    return f"./{relative}" if relative.startswith("-") else relative


def _channel(value: Any) -> str | None:
    """Return an inline profile as JSON, the name of a profile, or the path of its file."""
    if isinstance(value, Mapping):
        return json.dumps(value)
    return _file_or_name(value) if value is None or Path(value).suffix in SUFFIXES else str(value)


def _file_or_name(value: str | Path | None) -> str | None:
    if value is None:
        return None
    return _path(value) if os.path.isfile(value) else str(value)


def _assignments(option: str, values: Mapping[str, str | Assignment]) -> list[str]:
    words = []
    for name, value in values.items():
        words += _option(option, f"{name}={value.text if isinstance(value, Assignment) else value}")
    return words


def _option(option: str, value: str) -> list[str]:
    return [f"{option}={value}"] if value.startswith("-") else [option, value]
