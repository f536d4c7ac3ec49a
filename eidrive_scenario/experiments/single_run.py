"""One run that leaves files behind: its recording, its pictures, its result, its table of motions."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from eidrive_scenario.errors import InputError, Problem
from eidrive_scenario.library import resolve_scenario
from eidrive_scenario.openscenario import ConcreteRun, Scenario, Source, text_of
from eidrive_scenario.recording import CameraPictures, CsvWriter, Explanation, Recorder, RunLog
from eidrive_scenario.recording.output import create, partial, whole
from eidrive_scenario.simulation import Observer, RunResult, RunSettings, Simulation, load_for_seed

RECORDING, RESULT, PICTURES = "recording.mcap", "result.json", "pictures"
"""Names of the files in a run's folder."""


def play(
    source: Source | ConcreteRun,
    *,
    seed: int = 1,
    settings: RunSettings | None = None,
    out: Path | None = None,
    record: bool = True,
    csv: Path | None = None,
    log: str | Path | None = None,
    explanations: Sequence[Explanation] = (),
) -> RunResult:
    """Run a scenario, given by path, library name or as all else that load_scenario takes, or one run out of a
    parameter value distribution.

    out     folder for `result.json` and, unless `record` is False, `recording.mcap` and the cameras' `pictures`
    csv     file for one row per actor and tick
    log     file for one line per change of the storyboard, with what fired and why; `-` is standard output
    explanations  what shall be explained afterwards; they look on

    A run that breaks or is interrupted leaves `recording.partial.mcap` and a `.partial` table: what there is of them.

    Parameters in `settings` win over those of the distribution. Raises InputError for a wrong scenario, setting or
    place to write; ConstraintError for a run that the constraints of parameters rule out.
    """
    settings = settings or RunSettings()
    number = None
    if isinstance(source, ConcreteRun):
        number = source.number
        settings = replace(settings, parameters={**source.assignments, **settings.parameters})
        source = source.scenario
    elif isinstance(source, str | Path):
        source = resolve_scenario(source)
    scenario = load_for_seed(source, seed, settings.parameters)
    observers: list[Observer] = [*explanations]
    pictures = CameraPictures(out / PICTURES) if out is not None and record else None
    if pictures is not None:
        observers.append(pictures)
    with ExitStack() as stack:
        if log is not None:
            observers.append(RunLog(log))
            stack.callback(observers[-1].close)
        if csv is not None:
            observers.append(CsvWriter(stack.enter_context(whole(csv))))
            stack.callback(observers[-1].close)
        if out is not None and record:
            told, attachments = _told(scenario, seed, number, settings), _attachments(source, scenario)
            recording = stack.enter_context(whole(out / RECORDING))
            observers.append(Recorder(recording, metadata=told, attachments=attachments))
            stack.callback(observers[-1].close)
        simulation = Simulation(scenario, seed=seed, settings=settings, observers=observers)
        with simulation:
            for explanation in explanations:
                explanation.watch(simulation.storyboard)
            if pictures is not None:
                pictures.watch(simulation.stations)
            result = simulation.run()
    result = replace(result, run=number)
    if out is not None:
        with create(out / RESULT) as stream:
            stream.write(as_json_text(result, indent=2).encode() + b"\n")
    return result


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


def _attachments(source: Source, scenario: Scenario) -> dict[str, bytes]:
    """The scenario's own text and its road, so that a recording can be shown without the files."""
    texts = {"scenario.xosc": text_of(source)}
    if scenario.road_file is not None:
        texts["road.xodr"] = scenario.road_file.read_bytes()
    return texts


def recording_in(place: Path) -> Path:
    """The recording in a run's folder, or what there is of one whose run did not end; a file as it is.

    Raises InputError for a folder without one.
    """
    if not os.path.isdir(place):
        return place
    for path in (place / RECORDING, partial(place / RECORDING)):
        if path.exists():
            return path
    below = sorted(place.rglob(RECORDING))
    remedy = f"there is one in {below[0].parent}" if below else "eidrive run … --out DIR records"
    raise InputError(Problem(f"no {RECORDING} in this folder", remedy, str(place)))


def result_of(recording: Path) -> dict[str, Any] | None:
    """What the run came to whose recording this is, or None where nobody wrote that down beside it.

    Raises InputError for a file that is no result.
    """
    beside = recording.with_name(RESULT)
    return read_results([beside])[0] if recording.name == RECORDING and beside.is_file() else None


def read_results(places: Sequence[Path]) -> list[dict[str, Any]]:
    """The results in these files and folders, and in folders below, in order of their paths; each file once.

    Raises InputError for a file that is no result.
    """
    results, taken = [], set()
    for place in places:
        for path in sorted(place.rglob(RESULT)) if os.path.isdir(place) else [place]:
            if (real := os.path.realpath(path)) in taken:
                continue
            taken.add(real)
            try:
                result = json.loads(path.read_text(encoding="utf-8"))
            except OSError as error:
                raise InputError(Problem(f"cannot read: {error.strerror}", f"give a {RESULT}", str(path))) from error
            except ValueError as error:
                raise InputError(Problem(f"not JSON: {error}", f"give a {RESULT}", str(path))) from error
            if not isinstance(result, dict) or "trace_hash" not in result:
                raise InputError(
                    Problem("not the result of a run", "give a file that eidrive run --out wrote", str(path))
                )
            results.append(result)
    return results
