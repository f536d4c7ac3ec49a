"""Datasets of many runs: names, manifest, resumption, equal bytes, and the command."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from command_fixtures import Eidrive, eidrive

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.errors import OutputError
from eidrive_scenario.experiments.sweeps.axes import parse_axes
from eidrive_scenario.export.opv2v.dataset import DatasetJob, ExportedRun, export_dataset, plan_dataset, read_sensors
from eidrive_scenario.files.atomic import FileLock
from eidrive_scenario.perception.oracle import OracleDetector
from eidrive_scenario.sensing.readings import Readings
from eidrive_scenario.simulation import RunSettings, run_file

__all__ = ["eidrive"]
LIDAR = "{lidar: {channels: 4, points_per_second: 4000, rotation: 10, range: 60}}"
SHORT = RunSettings(time_limit=0.2)


def plan(out: Path, seeds: tuple[int, ...] = (1, 2), vary: str = "channel=ideal,none") -> list[DatasetJob]:
    return plan_dataset(
        ["coop/scenario_1"], out, SHORT, axes=parse_axes([vary]), seeds=seeds, sensors=read_sensors(LIDAR)
    )


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a dataset of scenario 1 with two seeds and two channels."""
    folder = tmp_path_factory.mktemp("datasets") / "first"
    runs = export_dataset(plan(folder), workers=1)
    assert [(run.frames, run.stations, run.error) for run in runs] == [(3, 2, "")] * 4
    return folder


def test_folder_contains_a_scenario_folder_per_run_and_nothing_else(dataset: Path) -> None:
    """Readers take each subfolder as a scenario."""
    names = [path.name for path in dataset.iterdir() if path.is_dir()]
    starts = sorted(name.rpartition("-")[0] for name in names)
    assert starts == [f"scenario_1-{channel}-seed{seed}" for channel in ("ideal", "none") for seed in (1, 2)]
    assert [path.name for path in dataset.iterdir() if path.is_file()] == ["manifest.json"]


def test_manifest_states_settings_seed_frames_and_the_command_of_each_run(dataset: Path) -> None:
    manifest = json.loads((dataset / "manifest.json").read_text())
    assert (manifest["format"], manifest["rate"], manifest["own_cameras"]) == ("opv2v", 10.0, False)
    assert manifest["sensors"]["lidar"]["channels"] == 4
    assert manifest["versions"]["eidrive-scenario"]
    assert len(manifest["runs"]) == 4
    for name, run in manifest["runs"].items():
        assert json.loads((dataset / name / "manifest.json").read_text()) == run
        assert (run["scenario"], run["frames"], run["numbers"]) == ("coop/scenario_1", 3, [0, 4])
        settings = RunSettings(time_limit=0.2, channel=run["values"]["channel"])
        result = run_file("coop/scenario_1", seed=run["seed"], settings=settings)
        assert (result.trace_hash, result.settings.digest) == (run["trace_hash"], run["settings_sha256"])
        assert run["command"].startswith(f"eidrive run coop/scenario_1 --channel {run['values']['channel']}")


def test_equal_commands_write_equal_bytes(dataset: Path, tmp_path: Path) -> None:
    export_dataset(list(reversed(plan(tmp_path / "second"))), workers=1)
    assert contents(tmp_path / "second") == contents(dataset)


def test_command_continues_with_incomplete_runs_only(dataset: Path, tmp_path: Path) -> None:
    """A run is complete if its folder has a manifest; remains of a killed command are removed."""
    folder = tmp_path / "continued"
    jobs = plan(folder)
    export_dataset(jobs[:2], workers=1)
    before = {path: path.stat().st_mtime_ns for path in folder.glob("scenario_1*/*/*")}
    (jobs[2].path / "1001").mkdir(parents=True)
    (jobs[2].path / "1001" / "000098.yaml").write_text("remains")
    (folder / ".partial" / jobs[3].name).mkdir(parents=True)
    done = export_dataset(jobs, workers=1)
    assert sorted(run.name for run in done) == sorted(job.name for job in jobs[2:])
    assert {path: path.stat().st_mtime_ns for path in before} == before
    assert contents(folder) == contents(dataset)
    assert not (folder / ".partial").exists()


def test_dataset_with_other_sensors_needs_another_folder(dataset: Path) -> None:
    jobs = plan_dataset(["coop/scenario_1"], dataset, SHORT)
    with pytest.raises(OutputError, match="contains a dataset with other sensors; choose another folder"):
        export_dataset(jobs, workers=1)


def test_folder_in_use_is_an_error(tmp_path: Path) -> None:
    lock = FileLock.acquire(tmp_path / ".lock")
    assert lock is not None
    with lock, pytest.raises(OutputError, match="another command writes to this folder"):
        export_dataset(plan(tmp_path), workers=1)


def test_damaged_manifest_is_an_error_before_the_first_run(dataset: Path, tmp_path: Path) -> None:
    (tmp_path / "manifest.json").write_text("[1]")
    with pytest.raises(OutputError, match=r"manifest\.json: cannot read the manifest: .*choose another folder"):
        export_dataset(plan(tmp_path), workers=1)
    shutil.copytree(dataset, tmp_path / "damaged")
    run = plan(tmp_path / "damaged")[1].path
    (run / "manifest.json").write_text('{"frames": ')
    with pytest.raises(OutputError, match=rf"{run.name}/manifest\.json: cannot read the manifest: .*remove its folder"):
        export_dataset(plan(tmp_path / "damaged", seeds=(3,)), workers=1)
    assert len(list((tmp_path / "damaged").glob("*/manifest.json"))) == 4


def test_killed_command_is_not_continued_with_other_sensors(tmp_path: Path) -> None:
    """The manifest of the dataset exists from the first run on."""

    def read(run: ExportedRun) -> None:
        about = json.loads((tmp_path / "manifest.json").read_text())
        assert (about["sensors"]["lidar"]["channels"], about["runs"]) == (4, {})
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        export_dataset(plan(tmp_path), workers=1, finished=read)
    with pytest.raises(OutputError, match="contains a dataset with other sensors"):
        export_dataset(plan_dataset(["coop/scenario_1"], tmp_path, SHORT), workers=1)


def test_run_that_fails_midway_leaves_no_folder_and_the_others_are_exported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    detect = OracleDetector.detect

    def fail(self: OracleDetector, readings: Readings) -> Detections:
        if readings.time > 0.1:
            raise RuntimeError("the sensor is broken")
        return detect(self, readings)

    first, second = plan(tmp_path, seeds=(1,))
    with monkeypatch.context() as patched:
        patched.setattr(OracleDetector, "detect", fail)
        (failed,) = export_dataset([first], workers=1)
    assert "the sensor is broken" in failed.error
    assert [path.name for path in tmp_path.iterdir()] == ["manifest.json"]
    (complete,) = export_dataset([second], workers=1)
    assert (complete.frames, complete.error) == (3, "")


@pytest.mark.process
def test_processes_write_the_same_bytes(dataset: Path, tmp_path: Path) -> None:
    export_dataset(plan(tmp_path / "parallel"), workers=2)
    assert contents(tmp_path / "parallel") == contents(dataset)


def test_command_prints_runs_and_warnings_once(eidrive: Eidrive, tmp_path: Path) -> None:
    words = ["dataset", "coop/scenario_1", "--seeds", "1-2", "--sensors", LIDAR, "--time-limit", "0.1", "--jobs", "1"]
    first = eidrive(*words, "--out", tmp_path / "new")
    assert first.exit_code == 0
    assert "2 runs, 4 frames; " in first.stdout
    assert first.stderr.count("OpenCOOD omits 'Firetruck' from the truth of some frames") == 1
    assert "0 runs, 0 frames, 2 already complete" in eidrive(*words, "--out", tmp_path / "new").stdout


def test_failed_runs_are_reported_and_the_others_exported(eidrive: Eidrive, tmp_path: Path) -> None:
    station = Path(__file__).parents[2] / "data" / "passing_by.xosc"
    words: list[str | Path] = ["--sensors", LIDAR, "--time-limit", "0.1", "--jobs", "1", "--out", tmp_path]
    result = eidrive("dataset", station, "coop/scenario_1", *words)
    assert result.exit_code == 3
    assert "failed: " in result.stderr
    assert "the scenario has no station; give entities a driving stack by --drive NAME" in result.stderr
    assert "2 runs, 2 frames" in result.stdout
    assert eidrive("dataset", station, *words, "--drive", "Ego").exit_code == 0


def test_command_without_a_source_or_with_two_is_invalid_input(eidrive: Eidrive, tmp_path: Path) -> None:
    assert "give an .xosc file, a library name, or --import DIR" in eidrive("dataset").stderr
    both = eidrive("dataset", "coop/scenario_1", "--sensors", LIDAR, "--import", tmp_path)
    assert (both.exit_code, "--import excludes scenarios, --sensors; " in both.stderr) == (2, True)
    options = eidrive("dataset", "--import", tmp_path, "--channel", "ideal", "--time-limit", "1")
    assert (options.exit_code, "--import excludes options of a run; " in options.stderr) == (2, True)
    jobs = eidrive("dataset", "--import", tmp_path, "--jobs", "2")
    assert (jobs.exit_code, "--import excludes --jobs; " in jobs.stderr) == (2, True)
    assert eidrive("dataset", "coop/scenario_1", "--vary", "wether=sunny", "--out", tmp_path / "x").exit_code == 2
    assert not (tmp_path / "x").exists()
