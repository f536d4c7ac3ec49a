"""Command lines that repeat runs.

Paths in a command are absolute, so that it is valid in any folder. With a project (see
`eidrive_scenario.extensions.project`) they are relative to its folder, which the command names once: after a copy of
the project only this name changes.
"""

from __future__ import annotations

import os
import shlex
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from eidrive_scenario.base.randomness import checked_seed
from eidrive_scenario.extensions.library import library_path, name_of, resolve_scenario
from eidrive_scenario.extensions.project import portable_path, selected_project
from eidrive_scenario.openscenario import ConcreteRun, Scenario, Source
from eidrive_scenario.openscenario.values.parameters import Assignment
from eidrive_scenario.run_options import OPTIONS, RunSettings, checked_settings
from eidrive_scenario.simulation.result import RunResult


def command_of(scenario: str | os.PathLike[str], seed: int, settings: RunSettings) -> str:
    """Return the `eidrive run` command that repeats a run, quoted for a shell.

    scenario  path or library name

    Raise SettingError if there is no such scenario, and for a seed or settings of another type.
    """
    seed, settings = checked_seed(seed), checked_settings(settings)
    path = resolve_scenario(scenario)
    project = selected_project()
    words = ["eidrive", *([] if project is None else ["--project", str(project)]), "run", _scenario(path)]
    for options in ([], ["--seed", str(seed)]):
        words += options
        for option in OPTIONS:
            if option.form.follows_seed is bool(options):
                words += option.words(getattr(settings, option.name))
    return shlex.join(words)


def command_of_source(source: Scenario | Source | ConcreteRun, seed: int, settings: RunSettings) -> str:
    """Return the command line that repeats the run; empty for a scenario without a file."""
    given: Mapping[str, str | Assignment] = {}
    path: Any = source
    if isinstance(source, ConcreteRun):
        path, given = source.scenario, source.assignments
    elif isinstance(source, Scenario):
        path, given = source.path, source.assigned
    if not isinstance(path, str | os.PathLike):
        return ""
    return command_of(path, seed, replace(settings, parameters={**given, **settings.parameters}))


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
    return portable_path(path)
