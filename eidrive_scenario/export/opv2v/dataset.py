"""Datasets of many runs: a scenario folder per run, made in parallel, and a manifest.

A run is written below `.partial` and renamed once it is complete, so that a killed command continues: complete runs are
not repeated, others start again. Equal settings give equal bytes.
"""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console

from eidrive_scenario.base.content_digest import canonical_json, package_versions, sha256_of
from eidrive_scenario.driving.settings import parse_station_settings
from eidrive_scenario.errors import ConstraintError, Diagnostic, EidriveError, OutputError
from eidrive_scenario.experiments.commands import command_of_source
from eidrive_scenario.experiments.repetitions import Job, run_jobs
from eidrive_scenario.experiments.run_folder import check_writable, readable_name
from eidrive_scenario.experiments.sweeps.axes import Axis, Point, points_of, text_of_value, with_types
from eidrive_scenario.experiments.sweeps.jobs import SweepJob, plan_of, source_of
from eidrive_scenario.export.opv2v.writer import LIDAR, OPV2V_LIDAR, RATE, Opv2vWriter, check_sensors
from eidrive_scenario.extensions.library import definition, name_of, resolve_scenario
from eidrive_scenario.files.atomic import FileLock, write_atomically
from eidrive_scenario.files.bounded import MIB, load_json, read_regular_file, reason_of
from eidrive_scenario.files.yaml_text import read_yaml_source
from eidrive_scenario.run_options import RunSettings
from eidrive_scenario.sensing.settings import SensorSettings
from eidrive_scenario.simulation import Simulation

FORMAT = "opv2v"
MANIFEST = "manifest.json"
"""Name of the manifest of the dataset, and of that of each run."""
PARTIAL_RUNS = ".partial"
"""Folder of the runs that are not complete."""
_LOCK = ".lock"
_DIGITS = 10
_LARGEST = 64 * MIB
Sensors = Mapping[str, SensorSettings]


@dataclass(frozen=True)
class DatasetJob(Job):
    """Run of a dataset.

    run      run with its settings
    folder   folder of the dataset;  name  name of the scenario folder
    sensors  sensors of all stations; None for the default
    """

    run: SweepJob
    folder: Path
    name: str
    sensors: Sensors | None

    @property
    def path(self) -> Path:
        """Scenario folder of the complete run."""
        return self.folder / self.name


@dataclass(frozen=True)
class ExportedRun:
    """Outcome of a job: number of its frames and stations, warnings, and the error if it was not exported.

    is_excluded  whether constraints of the parameters exclude the run
    """

    name: str
    frames: int = 0
    stations: int = 0
    warnings: tuple[str, ...] = ()
    error: str = ""
    is_excluded: bool = False


def read_sensors(source: str | Path) -> Sensors:
    """Return the sensors of a YAML file or text, as the property `sensors` of a station. Raise SettingError."""
    content = read_yaml_source(source, option="--sensors")
    lines = {f"sensors.{key}": line for key, line in content.lines.items()}
    settings = parse_station_settings({"sensors": content.data}, source=content.source, lines=lines)
    sensors = settings.sensors or {}
    check_sensors(sensors, content.source)
    return sensors


def plan_dataset(
    scenarios: Sequence[str | Path],
    folder: Path,
    settings: RunSettings,
    *,
    axes: Sequence[Axis] = (),
    seeds: Sequence[int] = (1,),
    sensors: Sensors | None = None,
) -> list[DatasetJob]:
    """Return the runs of a dataset: each scenario with each combination of the axes and each seed.

    Raise InputError for an invalid scenario, setting or axis.
    """
    jobs: dict[str, DatasetJob] = {}
    for scenario in scenarios:
        path = resolve_scenario(scenario)
        is_distribution = definition(path) == "distribution"
        points = points_of(with_types(axes, path, is_distribution=is_distribution), "grid", None, seed=1)
        for run in plan_of(path, points, settings, seeds=seeds, is_distribution=is_distribution):
            name = _name(run, sensors)
            jobs.setdefault(name, DatasetJob(str(path), "", run.seed, run.settings, run, folder, name, sensors))
    return list(jobs.values())


def _name(run: SweepJob, sensors: Sensors | None) -> str:
    digest = sha256_of(canonical_json([run.key, FORMAT, _plain(sensors)]).encode())[:_DIGITS]
    return readable_name([run.scenario.stem, *_values(run.point), f"seed{run.seed}"], digest)


def _values(point: Point) -> Iterator[str]:
    for name, value in point.items():
        yield f"{name}{value}" if isinstance(value, int | float) else text_of_value(value)


def _plain(sensors: Sensors | None) -> dict[str, Any] | None:
    return None if sensors is None else {name: sensor.model_dump(mode="json") for name, sensor in sensors.items()}


def export_dataset(
    jobs: Sequence[DatasetJob],
    *,
    workers: int | None = None,
    console: Console | None = None,
    finished: Callable[[ExportedRun], None] = lambda _: None,
) -> list[ExportedRun]:
    """Export the runs that are not complete, and write the manifest.

    workers   number of processes; by default that of the cores
    finished  function that gets the outcome of each run

    Raise OutputError if the folder cannot be written, if another command writes there, if its runs have other
    sensors or versions, or if a manifest is damaged. A run that fails is an outcome.
    """
    (folder,) = {job.folder for job in jobs}
    sensors = jobs[0].sensors
    about = {
        "format": FORMAT,
        "rate": RATE,
        "sensors": _plain({LIDAR: OPV2V_LIDAR} if sensors is None else sensors),
        "own_cameras": sensors is None,
        "versions": dict(package_versions()),
    }
    check_writable(folder)
    lock = FileLock.acquire(folder / _LOCK)
    if lock is None:
        raise OutputError(Diagnostic("another command writes to this folder", "choose another folder", str(folder)))
    with lock:
        complete = dict(_manifests(folder))
        _check_same(folder, about)
        # Before the first run, so that a killed command is continued with the same sensors and versions only.
        _write_json(folder / MANIFEST, {**about, "runs": complete})
        left = [job for job in jobs if job.name not in complete]
        try:
            return list(run_jobs(left, _export, workers=workers, console=console, title="dataset", finished=finished))
        finally:
            shutil.rmtree(folder / PARTIAL_RUNS, ignore_errors=True)
            _write_json(folder / MANIFEST, {**about, "runs": dict(_manifests(folder))})


def _check_same(folder: Path, about: Mapping[str, Any]) -> None:
    """Raise OutputError if a dataset in the folder differs in what all its runs share."""
    path = folder / MANIFEST
    if not path.exists():
        return
    before = _read_json(path, "choose another folder")
    for name, value in about.items():
        if before.get(name) != value:
            message = f"the folder contains a dataset with other {name}"
            raise OutputError(Diagnostic(message, "choose another folder", str(path)))


def _manifests(folder: Path) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield name and manifest of each complete run, sorted by name."""
    for path in sorted(folder.glob(f"*/{MANIFEST}")):
        yield path.parent.name, _read_json(path, "remove its folder, so that the run is repeated")


def _read_json(path: Path, hint: str) -> dict[str, Any]:
    try:
        content = load_json(read_regular_file(path, _LARGEST), max_depth=40)
        if isinstance(content, dict):
            return content
        raise ValueError("no JSON object")
    except (OSError, ValueError) as error:
        message = f"cannot read the manifest: {reason_of(error)}"
        raise OutputError(Diagnostic(message, hint, str(path))) from error


def _write_json(path: Path, content: Mapping[str, Any]) -> None:
    with write_atomically(path) as stream:
        stream.write(json.dumps(content, indent=1, allow_nan=False).encode() + b"\n")


def _export(job: DatasetJob) -> ExportedRun:
    """Execute a run, and write its scenario folder and manifest."""
    partial = job.folder / PARTIAL_RUNS / job.name
    shutil.rmtree(partial, ignore_errors=True)
    writer = Opv2vWriter(partial, job.sensors)
    try:
        source, run = source_of(job.run), job.run
        with Simulation(source, seed=run.seed, settings=run.settings, observers=[writer]) as simulation:
            result = simulation.run()
        manifest = {
            "scenario": name_of(run.scenario),
            "run": run.run,
            "seed": run.seed,
            "values": dict(run.point),
            "frames": len(writer.frames),
            "numbers": [writer.frames[0], writer.frames[-1]],
            "stations": writer.stations,
            "settings_sha256": result.settings.digest,
            "trace_hash": result.trace_hash,
            "command": command_of_source(source, run.seed, run.settings),
            "warnings": writer.warnings,
        }
        _write_json(partial / MANIFEST, manifest)
        shutil.rmtree(job.path, ignore_errors=True)
        os.replace(partial, job.path)
        return ExportedRun(job.name, len(writer.frames), len(writer.stations), tuple(writer.warnings))
    except OutputError:
        raise
    except EidriveError as error:
        shutil.rmtree(partial, ignore_errors=True)
        return ExportedRun(job.name, error=str(error), is_excluded=isinstance(error, ConstraintError))
