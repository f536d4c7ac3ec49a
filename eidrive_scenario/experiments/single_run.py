"""Single run with output files: recording, camera images, result and CSV table."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from eidrive_scenario.base.randomness import checked_seed
from eidrive_scenario.base.wall_limit import limit_wall_time
from eidrive_scenario.errors import Diagnostic, InputError, OutputError, SettingError
from eidrive_scenario.experiments.commands import command_of_source
from eidrive_scenario.experiments.run_folder import RunFolder, run_folder
from eidrive_scenario.extensions.library import resolve_scenario
from eidrive_scenario.extensions.registry import third_party_files
from eidrive_scenario.files.atomic import atomic_output, exclusive
from eidrive_scenario.files.bounded import path_argument
from eidrive_scenario.openscenario import ConcreteRun, Scenario, Source, text_of
from eidrive_scenario.recording.run_files import RECORDING, ROAD_FILE, SCENARIO_FILE, RecordMode
from eidrive_scenario.recording.text.csv_writer import CsvWriter
from eidrive_scenario.recording.text.run_log import STANDARD_OUTPUT, RunLog
from eidrive_scenario.roads.reading.document import read_road_text
from eidrive_scenario.run_options import DEFAULT_SEED, OPTIONS, RunSettings, checked_settings
from eidrive_scenario.simulation import Observer, RunResult, Simulation
from eidrive_scenario.simulation.observers import checked_observers

if TYPE_CHECKING:
    from eidrive_scenario.experiments.judgement import FailedJudgement, Judgement
    from eidrive_scenario.recording.text.explanation import Explanation


def record_mode(value: bool | str) -> RecordMode:
    """Return the mode of a setting; True for always, False for never. Raise SettingError for another value."""
    if isinstance(value, bool):
        return RecordMode.ALWAYS if value else RecordMode.NEVER
    try:
        return RecordMode(value)
    except ValueError:
        modes = ", ".join(mode.value for mode in RecordMode)
        raise SettingError(Diagnostic(f"record is {value!r}", f"give one of {modes}")) from None


def run_and_save(
    source: Scenario | Source | ConcreteRun,
    *,
    seed: int = DEFAULT_SEED,
    settings: RunSettings | None = None,
    out: str | os.PathLike[str] | None = None,
    below: str | os.PathLike[str] | None = None,
    record: bool | str = True,
    csv: str | os.PathLike[str] | None = None,
    log: str | os.PathLike[str] | None = None,
    explanations: Sequence[Explanation] = (),
    observers: Sequence[Observer] = (),
    wall_limit: float | None = None,
    command: str = "",
) -> RunResult:
    """Run a scenario, given as any source of load_scenario, or one run of a parameter value distribution.

    out           folder of `result.json` and, by `record`, of `recording.mcap` and `images`
    below         parent of such a folder, whose name contains the hash of all settings; see `run_folder`
    record        `always` (True), `never` (False), or `on-failure`: a run that passes keeps no recording and no
                  images
    csv           file for one row per actor and tick
    log           file for one line per storyboard transition with its reason; `-` is standard output
    explanations  explanations that observe the run
    observers     further observers of the run
    command       command line that repeats the run; by default that of `eidrive run` for a scenario with a file
    wall_limit    limit of the wall time of loading and run [s]

    An aborted or interrupted run leaves `recording.partial.mcap` and a `.partial` table. Its exception has notes with
    the path of the recording and the command that repeats the run.

    Parameters in `settings` override those of the distribution. Raise InputError for an invalid scenario, setting or
    output path, ConstraintError for a run that violates constraints of parameters, and WallLimitError at the limit.
    """
    settings = checked_settings(settings)
    seed, observers = checked_seed(seed), checked_observers(observers)
    kept = record_mode(record)
    command = command or command_of_source(source, seed, settings)
    recording: Path | None = None
    simulation: Simulation | None = None
    try:
        with limit_wall_time(wall_limit) as limit, ExitStack() as stack:
            if limit is not None and command:
                limit.add_note(f"reproduce: {command}")
            simulation = stack.enter_context(
                Simulation(source, seed=seed, settings=settings, observers=(*explanations, *observers))
            )
            for explanation in explanations:
                explanation.watch(simulation.storyboard)
            parent, name = (out, "out") if out is not None else (below, "below")
            folder = None
            if parent is not None:
                location = path_argument(parent, name)
                folder = stack.enter_context(run_folder(location, simulation.resolved, own=out is None))
            if log is not None:
                if str(log) != STANDARD_OUTPUT:
                    stack.enter_context(exclusive(_output(log, "log", simulation.storyboard.scenario)))
                simulation.add_observer(RunLog(log))
            if csv is not None:
                table = _output(csv, "csv", simulation.storyboard.scenario)
                simulation.add_observer(CsvWriter(stack.enter_context(atomic_output(table))))
            if folder is not None and kept is not RecordMode.NEVER:
                recording = folder.recording
                if limit is not None:
                    limit.add_note(f"recording: {recording}")
                at_once = bool(observers) or bool(third_party_files())
                _record(simulation, folder, source, settings, command, at_once=at_once)
            result = replace(simulation.run(), command=command)
            return result if folder is None else _keep(result, folder, kept)
    except InputError:
        raise
    except BaseException as error:
        # The state of the run says nothing about a file that cannot be written
        for line in () if simulation is None or isinstance(error, OSError) else simulation.describe_state():
            error.add_note(line)
        if command:
            error.add_note(f"reproduce: {command}")
        if recording is not None and recording.exists():
            error.add_note(f"recording: {recording}")
        raise


def _output(path: str | os.PathLike[str], name: str, scenario: Scenario) -> Path:
    """Return an output path of this name. Raise OutputError for a file that the scenario refers to."""
    output = path_argument(path, name)
    read = (scenario.road_file, *scenario.catalogs)
    if os.path.realpath(output) in {os.path.realpath(file) for file in read if file is not None}:
        raise OutputError(Diagnostic("the run would overwrite an input file", "choose another path", str(output)))
    return output


def _record(
    simulation: Simulation,
    folder: RunFolder,
    source: Scenario | Source | ConcreteRun,
    settings: RunSettings,
    command: str,
    *,
    at_once: bool,
) -> None:
    """Add a recorder and a writer of camera images to the observers."""
    # Runs without a recording start faster without these
    from eidrive_scenario.recording.camera_images import CameraImageWriter
    from eidrive_scenario.simulation.recorded_outcome import RunRecorder, scenario_metadata

    simulation.add_observer(CameraImageWriter(folder.images, simulation.stack))
    scenario, resolved = simulation.scenario, simulation.resolved
    # Settings of the caller as texts, without those that use the value of the file
    given = {option.name: option.form.recorded(getattr(settings, option.name)) for option in OPTIONS}
    given["run"] = None if resolved.run is None else str(resolved.run)
    metadata = {
        "scenario": resolved.scenario,
        "seed": str(resolved.seed),
        **{name: text for name, text in given.items() if text is not None},
        "parameters": json.dumps(scenario.parameters),
        "settings": resolved.canonical,
        "command": command,
        **scenario_metadata(scenario),
    }
    text = scenario.text if scenario.text is not None else _text(source)
    # The text of the scenario and its road, so that a replay needs no other files
    attachments = {SCENARIO_FILE: text}
    if scenario.road_file is not None:
        attachments[ROAD_FILE] = read_road_text(scenario.road_file)
    simulation.add_observer(RunRecorder(folder.recording, metadata=metadata, attachments=attachments, at_once=at_once))


def _text(source: Scenario | Source | ConcreteRun) -> bytes:
    if isinstance(source, ConcreteRun):
        return text_of(source.scenario)
    if isinstance(source, Scenario):
        return _text(source.source)
    return text_of(resolve_scenario(source) if isinstance(source, str | os.PathLike) else source)


def _keep(result: RunResult, folder: RunFolder, record: RecordMode) -> RunResult:
    """Write the result and rename the partial files of the run, or remove those that are not to be kept."""
    earlier = folder.earlier_trace()
    is_kept = record is RecordMode.ALWAYS or (record is RecordMode.ON_FAILURE and not result.passed)
    if not is_kept:
        folder.prepare()
    folder.commit(as_json_text(result, indent=2).encode() + b"\n")
    warnings = result.warnings
    if earlier not in (None, result.trace_hash):
        cause = f"an earlier run with equal settings had another trace hash ({earlier})"
        warnings = (*warnings, f"{folder.path}: the former result is replaced: {cause}")
    recording = folder.path / RECORDING if is_kept else None
    return replace(result, warnings=warnings, folder=folder.path, recording=recording)


def as_json_text(
    result: RunResult | Judgement | FailedJudgement, indent: int | None = None, *, ascii_only: bool = False
) -> str:
    """Return a result or judgement as JSON, with null for non-finite numbers.

    ascii_only  whether other letters are escaped: `\\u00e4`
    """
    return json.dumps(_finite(result.as_json()), indent=indent, ensure_ascii=ascii_only, allow_nan=False)


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
