"""One run that leaves files behind: its recording, its pictures, its result, its table of motions."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from eidrive_scenario.errors import InputError
from eidrive_scenario.experiments.reproduction import command_of
from eidrive_scenario.experiments.run_folder import RunFolder, run_folder
from eidrive_scenario.files.atomic import atomic_output, exclusive
from eidrive_scenario.library import resolve_scenario
from eidrive_scenario.openscenario import ConcreteRun, Scenario, Source, text_of
from eidrive_scenario.openscenario.values.parameters import Assignment
from eidrive_scenario.recording import CameraImageWriter, CsvWriter, Explanation, Recorder, RunLog
from eidrive_scenario.recording.run_files import (
    IMAGES,
    RECORDING,
    RESULT,
    read_results,
    recording_in,
    result_of,
)
from eidrive_scenario.recording.text.run_log import STANDARD_OUTPUT
from eidrive_scenario.roads.reading.document import read_road_text
from eidrive_scenario.simulation import DEFAULT_SEED, RunResult, RunSettings, Simulation
from eidrive_scenario.simulation.run import checked_seed
from eidrive_scenario.wall_limit import limit_wall_time

__all__ = [
    "IMAGES",
    "RECORDING",
    "RESULT",
    "as_json_text",
    "read_results",
    "recording_in",
    "result_of",
    "run_and_save",
]


def run_and_save(
    source: Scenario | Source | ConcreteRun,
    *,
    seed: int = DEFAULT_SEED,
    settings: RunSettings | None = None,
    out: str | Path | None = None,
    below: str | Path | None = None,
    record: bool = True,
    csv: str | Path | None = None,
    log: str | Path | None = None,
    explanations: Sequence[Explanation] = (),
    wall_limit: float | None = None,
    command: str = "",
) -> RunResult:
    """Run a scenario, given by path, library name or as all else that load_scenario takes, or one run out of a
    parameter value distribution.

    out     folder for `result.json` and, unless `record` is False, `recording.mcap` and the cameras' `pictures`
    below   folder in which the run gets such a folder of its own, named after all its settings: see `run_folder`
    csv     file for one row per actor and tick
    log     file for one line per change of the storyboard, with what fired and why; `-` is standard output
    explanations  what shall be explained afterwards; they look on
    command     command line that repeats the run, where the scenario has no file; else it is made of the settings
    wall_limit  of loading and run together, in wall time [s]; WallLimitError is raised when it is reached

    A run that breaks or is interrupted leaves `recording.partial.mcap` and a `.partial` table: what there is of them.
    Its exception has notes with that recording and with the command that repeats the run.

    Parameters in `settings` win over those of the distribution. Raise InputError for a wrong scenario, setting or
    place to write; ConstraintError for a run that the constraints of parameters rule out.
    """
    settings = settings or RunSettings()
    seed = checked_seed(seed)
    command = _command(source, seed, settings) or command
    recording: Path | None = None
    try:
        with limit_wall_time(wall_limit) as limit, ExitStack() as stack:
            if limit is not None and command:
                limit.add_note(f"reproduce: {command}")
            simulation = stack.enter_context(
                Simulation(source, seed=seed, settings=settings, observers=tuple(explanations))
            )
            for explanation in explanations:
                explanation.watch(simulation.storyboard)
            place = out if out is not None else below
            folder = None
            if place is not None:
                folder = stack.enter_context(run_folder(Path(place), simulation.resolved, own=out is None))
            if log is not None:
                if str(log) != STANDARD_OUTPUT:
                    stack.enter_context(exclusive(Path(log)))
                simulation.add_observer(RunLog(log))
            if csv is not None:
                simulation.add_observer(CsvWriter(stack.enter_context(atomic_output(Path(csv)))))
            if folder is not None and record:
                recording = folder.recording
                if limit is not None:
                    limit.add_note(f"recording: {recording}")
                _record(simulation, folder, source, settings, command)
            result = replace(simulation.run(), command=command)
            return result if folder is None else _keep(result, folder, record)
    except InputError:
        raise
    except BaseException as error:
        if command:
            error.add_note(f"reproduce: {command}")
        if recording is not None and recording.exists():
            error.add_note(f"recording: {recording}")
        raise


def _command(source: Scenario | Source | ConcreteRun, seed: int, settings: RunSettings) -> str:
    """The command line that repeats the run; empty for a scenario without a file."""
    given: Mapping[str, str | Assignment] = {}
    path: Any = source
    if isinstance(source, ConcreteRun):
        path, given = source.scenario, source.assignments
    elif isinstance(source, Scenario):
        path, given = source.path, source.assigned
    if not isinstance(path, str | Path):
        return ""
    return command_of(resolve_scenario(path), seed, replace(settings, parameters={**given, **settings.parameters}))


def _record(
    simulation: Simulation,
    folder: RunFolder,
    source: Scenario | Source | ConcreteRun,
    settings: RunSettings,
    command: str,
) -> None:
    """Let a recorder and a writer of camera images look on."""
    pictures = CameraImageWriter(folder.pictures)
    pictures.watch(simulation.stack)
    simulation.add_observer(pictures)
    scenario, resolved = simulation.scenario, simulation.resolved
    told = _told(scenario, resolved.seed, resolved.run, settings)
    metadata = {**told, "settings": resolved.canonical, "command": command}
    text = scenario.text if scenario.text is not None else _text(source)
    simulation.add_observer(Recorder(folder.recording, metadata=metadata, attachments=_attachments(text, scenario)))


def _text(source: Scenario | Source | ConcreteRun) -> bytes:
    if isinstance(source, ConcreteRun):
        return text_of(source.scenario)
    if isinstance(source, Scenario):
        return _text(source.source)
    return text_of(resolve_scenario(source) if isinstance(source, str | Path) else source)


def _keep(result: RunResult, folder: RunFolder, record: bool) -> RunResult:
    """Write the result and give all files of the run their own names."""
    earlier = folder.earlier_trace()
    folder.commit(as_json_text(result, indent=2).encode() + b"\n")
    warnings = result.warnings
    if earlier not in (None, result.trace_hash):
        what = f"{folder.path}: the result of an earlier run with equal settings was another one, trace {earlier}; "
        warnings = (*warnings, what + "it is replaced")
    recording = folder.path / RECORDING if record else None
    return replace(result, warnings=warnings, folder=folder.path, recording=recording)


def as_json_text(result: RunResult, indent: int | None = None, *, ascii_only: bool = False) -> str:
    """The result as JSON; a number that JSON does not have is null. `ascii_only` writes other letters as `\\u00e4`."""
    return json.dumps(_finite(result.as_json()), indent=indent, ensure_ascii=ascii_only, allow_nan=False)


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _told(scenario: Scenario, seed: int, run: int | None, settings: RunSettings) -> dict[str, str]:
    """What the run was told, as texts; what was left to the file is not there."""
    told = {name: value for name, value in asdict(settings).items() if value is not None and name != "parameters"}
    if run is not None:
        told["run"] = run
    if settings.cooperate is not None:
        told["cooperate"] = ",".join(settings.cooperate) or "none"
    told["controllers"] = json.dumps(settings.controllers) if settings.controllers else None
    told["user_values"] = json.dumps(settings.user_values) if settings.user_values else None
    texts = {name: str(value) for name, value in told.items() if value is not None}
    return {"scenario": scenario.name, "seed": str(seed), **texts, "parameters": json.dumps(scenario.parameters)}


def _attachments(text: bytes, scenario: Scenario) -> dict[str, bytes]:
    """The scenario's own text and its road, so that a recording can be shown without the files."""
    texts = {"scenario.xosc": text}
    if scenario.road_file is not None:
        texts["road.xodr"] = read_road_text(scenario.road_file)
    return texts
