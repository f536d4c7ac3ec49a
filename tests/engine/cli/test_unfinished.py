"""Interrupted and aborted runs, and readers that close their pipe."""

import os
import resource
import subprocess
import sys
from pathlib import Path

import pytest
from command_fixtures import Eidrive
from msgspec.structs import replace
from sweep_runs import RUN, opened

from eidrive_scenario.experiments.single_run import run_and_save
from eidrive_scenario.files.atomic import exclusive
from eidrive_scenario.recording.recording import read_recording
from eidrive_scenario.simulation import RunSettings
from eidrive_scenario.simulation.commands import RunState
from eidrive_scenario.simulation.run_outcome import end_reason
from eidrive_scenario.storyboard.storyboard import Storyboard


def break_at(monkeypatch: pytest.MonkeyPatch, instant: float, error: BaseException) -> None:
    def end(state: RunState, storyboard: Storyboard, time: float, time_limit: float) -> str | None:
        if time >= instant - 1e-9:
            raise error
        return end_reason(state, storyboard, time, time_limit)

    monkeypatch.setattr("eidrive_scenario.simulation.simulation.end_reason", end)


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.rglob("*") if path.is_file())


@pytest.mark.parametrize(("error", "code"), [(KeyboardInterrupt(), 130), (ZeroDivisionError("physics"), 3)])
def test_files_of_unfinished_run_have_partial_names(
    eidrive: Eidrive,
    passing_by: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    error: BaseException,
    code: int,
) -> None:
    with monkeypatch.context() as patch:
        break_at(patch, 1.0, error)
        arguments = ("run", passing_by, "--out", tmp_path, "--csv", tmp_path / "motion.csv")
        assert eidrive(*arguments).exit_code == code
    assert names(tmp_path) == ["motion.partial.csv", "recording.partial.mcap"]
    (partial,) = tmp_path.rglob("recording.partial.mcap")
    assert read_recording(partial).frame_count == 21
    shown = eidrive("view", tmp_path)
    assert shown.exit_code == 0
    assert shown.stdout.strip() == str(partial.with_suffix(".html"))
    assert "the run did not end" in shown.stderr
    report = eidrive("report", tmp_path, "-o", tmp_path / "report")
    assert report.exit_code == 2, "there is no result"
    assert f"warning: {partial}: the run did not end, the report omits it" in report.stderr

    assert eidrive(*arguments).exit_code == 0
    assert names(tmp_path) == ["motion.csv", "recording.mcap", "result.json"]
    assert "did not end" not in eidrive("view", tmp_path).stderr


def test_interrupted_run_keeps_files_of_earlier_run(
    eidrive: Eidrive, passing_by: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    eidrive("run", passing_by, "--out", tmp_path)
    (recording,) = tmp_path.rglob("recording.mcap")
    before = recording.read_bytes()
    break_at(monkeypatch, 1.0, KeyboardInterrupt())
    interrupted = eidrive("run", passing_by, "--out", tmp_path)
    assert recording.read_bytes() == before
    assert names(tmp_path) == ["recording.mcap", "recording.partial.mcap", "result.json"]
    assert f"recording: {recording.with_name('recording.partial.mcap')}" in interrupted.stderr
    assert f"reproduce: eidrive run {passing_by} --seed 1" in interrupted.stderr


def test_invalid_input_writes_no_files(eidrive: Eidrive, passing_by: Path, tmp_path: Path) -> None:
    result = eidrive("run", passing_by, "--out", tmp_path, "--csv", tmp_path / "motion.csv", "--channel", "idael")
    assert result.exit_code == 2
    assert names(tmp_path) == []
    (tmp_path / "file").touch()
    result = eidrive("run", passing_by, "--out", tmp_path / "file" / "run")
    assert (result.exit_code, result.stderr.count("\n")) == (2, 1)
    assert "cannot write" in result.stderr


@pytest.mark.process
@pytest.mark.parametrize("arguments", [["list", "conditions"], ["run", "{file}"], ["tree", "{file}"]])
def test_closed_pipe_of_reader_prints_no_error(passing_by: Path, arguments: list[str]) -> None:
    reading, writing = os.pipe()
    os.close(reading)
    try:
        done = subprocess.run(
            [sys.executable, "-m", "eidrive_scenario", *(part.format(file=passing_by) for part in arguments)],
            stdout=writing,
            stderr=subprocess.PIPE,
            text=True,
            timeout=60,
            check=False,
        )
    finally:
        os.close(writing)
    assert (done.returncode, done.stderr) == (141, "")


def test_csv_to_link_or_device_keeps_it(eidrive: Eidrive, passing_by: Path, tmp_path: Path) -> None:
    table, link, null = tmp_path / "table.csv", tmp_path / "link.csv", Path(os.devnull)
    table.touch()
    link.symlink_to(table)
    assert eidrive("run", passing_by, "--csv", link).exit_code == 0
    assert link.is_symlink()
    assert table.read_text(encoding="utf-8").startswith("time,name,x")
    assert eidrive("run", passing_by, "--csv", null).exit_code == 0
    assert null.is_char_device()


@pytest.mark.parametrize("option", ["--csv", "--log"])
def test_output_file_locked_by_other_run_is_invalid_input(
    eidrive: Eidrive, passing_by: Path, tmp_path: Path, option: str
) -> None:
    table = tmp_path / "table"
    with exclusive(table):
        result = eidrive("run", passing_by, option, table)
    assert result.exit_code == 2
    assert f"{table}: another run writes this file; choose another file" in result.stderr
    assert eidrive("run", passing_by, option, table).exit_code == 0
    assert [path.name for path in tmp_path.iterdir()] == ["table"]


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a recorded run, and of a store beside it."""
    folder = tmp_path_factory.mktemp("recorded")
    run_and_save("coop/scenario_1", settings=RunSettings(time_limit=3.0), out=folder / "run")
    with opened(folder / "s.db") as store:
        store.add(*(replace(RUN, key=f"{number:064}", number=number) for number in range(100)))
    return folder


@pytest.mark.process
@pytest.mark.parametrize(
    ("arguments", "name"),
    [
        (("view", "run", "--out"), "a.html"),
        (("view", "run", "--png"), "a.png"),
        (("view", "run", "--gif"), "a.gif"),
        (("view", "run", "--mp4"), "a.mp4"),
        (("report", "run", "--no-replays", "--out"), "a.html"),
        (("export", "run", "--osi"), "a.mcap"),
        (("export", "run", "--foxglove"), "a.mcap"),
        (("export", "run", "--mcap"), "a.mcap"),
        (("export", "run", "--csv"), "a.csv"),
        (("export", "run", "--parquet"), "a.parquet"),
        (("results", "s.db", "--csv"), "a.csv"),
        (("results", "s.db", "--parquet"), "a.parquet"),
        (("tree", "coop/scenario_1", "--svg"), "a.svg"),
        (("run", "coop/scenario_1", "--csv"), "a.csv"),
    ],
    ids=lambda value: "-".join(value) if isinstance(value, tuple) else value,
)
def test_file_that_cannot_be_written_whole_keeps_its_former_content(
    recorded: Path, tmp_path: Path, arguments: tuple[str, ...], name: str
) -> None:
    """The limit of the size of files has the effect of a full disk. Only parquet needs less than 1 kB."""
    out = tmp_path / name
    out.write_text("former content")
    size = 300 if "parquet" in name else 1000
    done = subprocess.run(
        [sys.executable, "-m", "eidrive_scenario", *arguments, out],
        capture_output=True,
        check=False,
        cwd=recorded,
        env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1"},  # truncated bytecode would break later imports
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size)),
    )
    error = done.stderr.decode()
    assert done.returncode in (2, 3), error
    assert "internal error" not in error
    assert out.stem in error
    assert out.read_text() == "former content"
