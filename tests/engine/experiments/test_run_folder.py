"""Run folders: never shared by different settings, never mixed, never incomplete."""

from __future__ import annotations

import json
import multiprocessing
import os
import shlex
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from lxml import html

from eidrive_scenario.errors import SettingError
from eidrive_scenario.experiments.run_folder import folder_name, run_folder
from eidrive_scenario.experiments.single_run import run_and_save
from eidrive_scenario.files.atomic import FileLock
from eidrive_scenario.openscenario import load_scenario
from eidrive_scenario.recording.recording import read_recording
from eidrive_scenario.recording.trace_hash import TraceHash
from eidrive_scenario.simulation import RunResult, RunSettings
from eidrive_scenario.simulation.resolved_settings import ResolvedSettings

PASSING_BY = Path(__file__).parents[2] / "data" / "passing_by.xosc"
SHORT: dict[str, Any] = {"time_limit": 0.3}
MAIN = [sys.executable, "-m", "eidrive_scenario"]


def run(below: Path, source: Any = PASSING_BY, seed: int = 1, **settings: Any) -> RunResult:
    return run_and_save(source, seed=seed, settings=RunSettings(**{**SHORT, **settings}), below=below)


def trace_of(recording: Path) -> str:
    trace = TraceHash()
    for frame in read_recording(recording).frames():
        trace.observe(frame)
    return trace.hexdigest()


def results(below: Path) -> list[dict[str, Any]]:
    return [json.loads(path.read_text(encoding="utf-8")) for path in sorted(below.rglob("result.json"))]


@pytest.mark.parametrize(
    "changes",
    [
        {"parameters": {"OtherY": "6"}},
        {"channel": "{delay: {kind: constant, seconds: 0.1}}"},
        {"detector": "lidar"},
        {"dt": 0.1},
        {"time_limit": 0.4},
        {"weather": "storm"},
        {"user_values": {"mood": "1"}},
        {"controllers": {"A": "alks"}},
        {"seed": 2},
    ],
)
def test_run_folder_differs_for_each_setting(tmp_path: Path, changes: dict[str, Any]) -> None:
    usual, changed = run(tmp_path), run(tmp_path, **changes)
    assert usual.folder != changed.folder
    assert len(results(tmp_path)) == 2


def test_folder_name_of_special_characters_is_a_short_file_name() -> None:
    odd = ResolvedSettings(scenario="a/../" + "ä b\n/" * 100, channel="../x", seed=-3, parameters={"P": "a/b\0"})
    name = folder_name(odd)
    assert len(name.encode()) <= 120
    assert "/" not in name
    assert not name.startswith((".", "-"))
    assert folder_name(ResolvedSettings(scenario="")).endswith(ResolvedSettings().short_digest)
    assert folder_name(replace(odd, seed=-4)) != name


def test_run_folders_of_special_parameter_values_differ(tmp_path: Path) -> None:
    text = PASSING_BY.read_text(encoding="utf-8").replace(
        "</ParameterDeclarations>",
        '<ParameterDeclaration name="Note" parameterType="string" value=""/></ParameterDeclarations>',
    )
    scenario = tmp_path / "a b'c.xosc"
    scenario.write_text(text, encoding="utf-8")
    values = ["../../x", "a/b", "a_b", "=1+1", "-x", "ü" * 300, "$(rm -rf)", 'it\'s "quoted"', "a\nb", " "]
    folders = {run(tmp_path / "out", scenario, parameters={"Note": value}).folder for value in values}
    assert len(folders) == len(values)
    assert {path.parent for path in folders if path} == {tmp_path / "out"}
    assert sorted(result["parameters"]["Note"] for result in results(tmp_path / "out")) == sorted(values)


def test_second_run_with_equal_settings_replaces_first(tmp_path: Path) -> None:
    first, second = run(tmp_path), run(tmp_path)
    assert first.folder == second.folder
    assert second.warnings == first.warnings
    assert len(results(tmp_path)) == 1


def test_different_result_of_equal_settings_is_reported(tmp_path: Path) -> None:
    first = run(tmp_path)
    assert first.folder is not None
    kept = first.folder / "result.json"
    kept.write_text(kept.read_text(encoding="utf-8").replace(first.trace_hash, "0" * 64), encoding="utf-8")
    assert "the former result is replaced" in run(tmp_path).warnings[-1]
    assert "the former result is replaced" not in "".join(run(tmp_path).warnings)


def test_folder_with_other_content_is_not_overwritten(tmp_path: Path) -> None:
    first = run(tmp_path)
    assert first.folder is not None
    (first.folder / "result.json").write_text("{", encoding="utf-8")
    second = run(tmp_path)
    assert second.folder == first.folder.with_name(f"{first.folder.name}-2")
    assert (first.folder / "result.json").read_text(encoding="utf-8") == "{"


def test_explicit_folder_with_other_settings_raises_setting_error(tmp_path: Path) -> None:
    run_and_save(PASSING_BY, settings=RunSettings(**SHORT), out=tmp_path)
    run_and_save(PASSING_BY, settings=RunSettings(**SHORT), out=tmp_path)
    with pytest.raises(SettingError, match="contains the result of a run with other settings"):
        run_and_save(PASSING_BY, seed=2, settings=RunSettings(**SHORT), out=tmp_path)


def test_locked_folder_causes_numbered_folder(tmp_path: Path) -> None:
    settings = ResolvedSettings(scenario="x")
    with run_folder(tmp_path, settings, own=True) as first, run_folder(tmp_path, settings, own=True) as second:
        assert second.path.name == f"{first.path.name}-2"
        with (
            pytest.raises(SettingError, match="another run writes to this folder"),
            run_folder(first.path, settings, own=False),
        ):
            pass
    assert not list(tmp_path.rglob(".lock"))


def _hold(path: Path, ready: Any) -> None:
    assert FileLock.acquire(path) is not None
    ready.set()
    time.sleep(60)


def test_lock_of_killed_process_is_released(tmp_path: Path) -> None:
    path = tmp_path / ".lock"
    context = multiprocessing.get_context("spawn")
    ready = context.Event()
    holder = context.Process(target=_hold, args=(path, ready))
    holder.start()
    try:
        assert ready.wait(60)
        assert FileLock.acquire(path) is None
    finally:
        holder.kill()
        holder.join()
    assert path.exists()
    lock = FileLock.acquire(path)
    assert lock is not None
    lock.release()
    assert not path.exists()


def test_run_without_recording_removes_earlier_recording(tmp_path: Path) -> None:
    folder = run(tmp_path).folder
    assert folder is not None
    run_and_save(PASSING_BY, settings=RunSettings(**SHORT), below=tmp_path, record=False)
    assert sorted(path.name for path in folder.iterdir()) == ["result.json"]


@pytest.mark.process
def test_concurrent_runs_write_consistent_results_and_recordings(tmp_path: Path) -> None:
    def start(late: float) -> subprocess.Popen[str]:
        channel = f"{{delay: {{kind: constant, seconds: {late}}}}}"
        command = [*MAIN, "run", "coop/scenario_1", "--out", str(tmp_path), "--channel", channel, "--time-limit", "2"]
        return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)

    running = [start(0.1)]
    outputs = [running[0].communicate(timeout=100)]
    (first,) = tmp_path.rglob("result.json")
    lock = FileLock.acquire(first.with_name(".lock"))
    assert lock is not None
    running += [start(late) for late in (0.2, 0.1, 0.1)]
    outputs += [process.communicate(timeout=100) for process in running[1:]]
    lock.release()
    assert [process.returncode for process in running] == [1] * 4, outputs  # 2 s are too short for the goal
    folders = {path.parent for path in tmp_path.rglob("result.json")}
    assert {
        Path(line.split(": ", 1)[1]) for out, _ in outputs for line in out.splitlines() if "files: " in line
    } == folders
    for folder in folders:
        kept = json.loads((folder / "result.json").read_text(encoding="utf-8"))
        assert trace_of(folder) == kept["trace_hash"]
        recorded = json.loads(read_recording(folder).metadata["settings"])
        assert recorded == kept["settings"]
    delays = [result["settings"]["channel_profile"]["delay"]["seconds"] for result in results(tmp_path)]
    assert set(delays) == {0.1, 0.2}
    assert not list(tmp_path.rglob("*.lock"))
    assert not list(tmp_path.rglob("*.partial*"))
    report = subprocess.run(
        [*MAIN, "report", str(tmp_path), "-o", str(tmp_path)], capture_output=True, text=True, check=True
    )
    text = str(html.fromstring(Path(report.stdout.strip()).read_text(encoding="utf-8")).xpath("string()"))
    for late in (0.1, 0.2):
        assert f"delay: {{kind: constant, seconds: {late}}}" in text
    different = {json.dumps(result["settings"], sort_keys=True) for result in results(tmp_path)}
    assert len(different) < len(folders)
    assert f"{len(different)} runs" in text
    assert "a copy of another" in text or "copies of others" in text


@pytest.mark.process
@pytest.mark.parametrize(
    ("source", "options"),
    [
        (PASSING_BY, ["--param", "OtherY=0", "--seed", "7", "--dt", "0.1"]),
        (
            PASSING_BY,
            ["--param", "OtherY=0", "--user-value", "it's=a b", "--controller", "X=alks", "--weather", "storm"],
        ),
        ("coop/scenario_1", ["--channel", "{delay: {kind: constant, seconds: 0.3}}", "--cooperate", "none"]),
        ("coop/scenario_1", ["--channel", "late.yaml", "--time-limit", "1.5"]),
    ],
)
def test_printed_command_reproduces_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, source: str | Path, options: list[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "late.yaml").write_text("delay: {kind: constant, seconds: 0.4}\n", encoding="utf-8")
    done = subprocess.run(
        [*MAIN, "run", str(source), "--out", "out", *options], capture_output=True, text=True, check=False
    )
    assert done.returncode in (1, 3), done.stdout + done.stderr
    (command,) = (line for line in done.stdout.splitlines() if line.startswith("reproduce: "))
    (recording,) = (line for line in done.stdout.splitlines() if line.startswith("recording: "))
    (kept,) = results(tmp_path / "out")
    assert trace_of(Path(recording.removeprefix("recording: "))) == kept["trace_hash"]
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    words = shlex.split(command.removeprefix("reproduce: "))
    again = subprocess.run([*MAIN, *words[1:], "--json"], capture_output=True, text=True, check=False)
    printed = json.loads(again.stdout)
    assert printed["trace_hash"] == kept["trace_hash"]
    assert printed["settings"] == kept["settings"]


def test_unwritable_folder_raises_setting_error(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(SettingError, match="cannot write"):
        run(tmp_path / "file")
    with pytest.raises(SettingError, match="cannot write"):
        run(Path("/proc/eidrive"))


def test_full_disk_aborts_run_with_partial_recording(tmp_path: Path) -> None:
    """A limit of the file size replaces the full disk."""
    code = (
        "import resource, signal, sys; signal.signal(signal.SIGXFSZ, signal.SIG_IGN);"
        "sys.dont_write_bytecode = True;"  # truncated bytecode would break later imports
        "resource.setrlimit(resource.RLIMIT_FSIZE, (20000, 20000));"
        "from eidrive_scenario.cli import main; main()"
    )
    command = [sys.executable, "-c", code, "run", "coop/scenario_1", "--out", str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 3, done.stderr
    assert "aborted: File too large" in done.stderr
    assert "Traceback" not in done.stderr
    assert "internal error" not in done.stderr
    assert not list(tmp_path.rglob("result.json"))
    assert [path.name for path in tmp_path.rglob("*.mcap")] == ["recording.partial.mcap"]
    assert not list(tmp_path.rglob("*.lock"))


def test_error_of_run_has_notes_with_command_and_recording(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise ZeroDivisionError("physics")

    monkeypatch.setattr("eidrive_scenario.simulation.simulation.end_reason", fail)
    with pytest.raises(ZeroDivisionError) as raised:
        run(tmp_path)
    *state, command, recording = raised.value.__notes__
    assert state[0].startswith("storyboard: ")
    assert command == f"reproduce: eidrive run {PASSING_BY} --seed 1 --time-limit 0.3"
    assert os.path.exists(recording.removeprefix("recording: "))


def test_page_of_replaced_recording_is_removed(tmp_path: Path) -> None:
    folder = run(tmp_path).folder
    assert folder is not None
    (folder / "recording.html").touch()
    run(tmp_path)
    assert not (folder / "recording.html").exists()


def test_page_of_partial_recording_is_removed_by_next_run(tmp_path: Path) -> None:
    folder = run_and_save(PASSING_BY, below=tmp_path).folder
    assert folder is not None
    for name in ("recording.partial.mcap", "recording.partial.html"):
        (folder / name).touch()
    run_and_save(PASSING_BY, below=tmp_path)
    assert sorted(path.name for path in folder.iterdir()) == ["recording.mcap", "result.json"]


def test_run_of_loaded_scenario_equals_run_of_file(tmp_path: Path) -> None:
    loaded = load_scenario(PASSING_BY, {"OtherY": "6"})
    first = run(tmp_path, loaded)
    second = run(tmp_path, parameters={"OtherY": "6"})
    assert (first.folder, first.trace_hash, first.command) == (second.folder, second.trace_hash, second.command)
