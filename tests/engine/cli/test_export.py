"""Command `eidrive export`."""

from __future__ import annotations

from pathlib import Path

import pytest
from command_fixtures import Eidrive
from mcap.reader import make_reader
from osi3trace.osi_trace import OSITrace

from eidrive_scenario.recording.recording import read_recording


@pytest.fixture
def recorded(eidrive: Eidrive, passing_by: Path, tmp_path: Path) -> Path:
    assert eidrive("run", passing_by, "--out", tmp_path / "run").exit_code == 0
    return tmp_path / "run"


def test_export_writes_osi_trace_and_prints_its_path(eidrive: Eidrive, recorded: Path, tmp_path: Path) -> None:
    result = eidrive("export", recorded, "--osi", tmp_path / "new" / "trace.osi")
    assert (result.exit_code, result.stdout) == (0, f"{tmp_path / 'new' / 'trace.osi'}\n")
    trace = OSITrace(str(tmp_path / "new" / "trace.osi"), "GroundTruth")
    assert len(list(trace)) == 61
    trace.close()


def test_export_replaces_existing_file(eidrive: Eidrive, recorded: Path, tmp_path: Path) -> None:
    (tmp_path / "trace.mcap").write_text("former content")
    assert eidrive("export", recorded, "--osi", tmp_path / "trace.mcap").exit_code == 0
    assert (tmp_path / "trace.mcap").read_bytes().startswith(b"\x89MCAP0")


def test_export_over_its_recording_is_invalid_input(eidrive: Eidrive, recorded: Path) -> None:
    (path,) = recorded.glob("*/recording.mcap")
    before = path.read_bytes()
    result = eidrive("export", path, "--osi", path)
    assert result.exit_code == 2
    assert "--osi would overwrite an input file" in result.stderr
    assert path.read_bytes() == before


def test_export_without_output_is_invalid_input(eidrive: Eidrive, recorded: Path) -> None:
    result = eidrive("export", recorded)
    assert result.exit_code == 2
    assert "no output is given; give one or several of --osi" in result.stderr


def test_export_of_a_table_without_its_file_is_invalid_input(eidrive: Eidrive, recorded: Path, tmp_path: Path) -> None:
    result = eidrive("export", recorded, "--osi", tmp_path / "run.mcap", "--table", "objects")
    assert (result.exit_code, "--table without a table has no effect" in result.stderr) == (2, True)


def test_export_of_truncated_recording_warns(eidrive: Eidrive, recorded: Path, tmp_path: Path) -> None:
    (path,) = recorded.glob("*/recording.mcap")
    (tmp_path / "cut.mcap").write_bytes(path.read_bytes()[:-6000])
    result = eidrive("export", tmp_path / "cut.mcap", "--osi", tmp_path / "trace.osi")
    assert result.exit_code == 0
    assert "warning: the recording is damaged" in result.stderr


def test_export_writes_several_files_at_once(eidrive: Eidrive, recorded: Path, tmp_path: Path) -> None:
    osi, foxglove = tmp_path / "osi.mcap", tmp_path / "foxglove.mcap"
    result = eidrive("export", recorded, "--osi", osi, "--foxglove", foxglove)
    assert result.stdout.splitlines() == [str(osi), str(foxglove)]
    assert osi.read_bytes() != foxglove.read_bytes()
    same = eidrive("export", recorded, "--osi", osi, "--foxglove", osi)
    assert same.exit_code == 2
    assert "--osi and --foxglove name the same file" in same.stderr


def test_run_with_topics_records_them_for_other_tools(eidrive: Eidrive, passing_by: Path, tmp_path: Path) -> None:
    result = eidrive("run", passing_by, "--out", tmp_path / "run", "--topics", "osi, foxglove")
    assert result.exit_code == 0
    assert eidrive("export", tmp_path / "run", "--mcap", tmp_path / "copy.mcap").exit_code == 0
    (path,) = (tmp_path / "run").glob("*/recording.mcap")
    assert read_recording(path).damage == ()
    for file in (path, tmp_path / "copy.mcap"):
        with file.open("rb") as stream:
            summary = make_reader(stream).get_summary()
        assert summary is not None
        assert {channel.topic for channel in summary.channels.values()} >= {"/frame", "/tf", "ground_truth"}


@pytest.mark.parametrize(
    ("options", "error"),
    [
        (("--topics", "osi"), "no run is recorded; give --out DIR"),
        (("--topics", "osi", "--out", "run", "--no-record"), "no run is recorded; give --out DIR"),
        (("--topics", "", "--out", "run"), "there are no topics ''; give foxglove or osi"),
        (("--topics", "osi,rviz", "--out", "run"), "there are no topics 'rviz'; give foxglove or osi"),
    ],
)
def test_invalid_topics_are_reported_before_the_run(
    eidrive: Eidrive, passing_by: Path, tmp_path: Path, options: tuple[str, ...], error: str
) -> None:
    result = eidrive("run", passing_by, *options)
    assert result.exit_code == 2
    assert error in result.stderr
    assert not (tmp_path / "run").exists()
