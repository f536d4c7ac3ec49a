"""Command `eidrive export`."""

from __future__ import annotations

from pathlib import Path

import pytest
from command_fixtures import Eidrive
from osi3trace.osi_trace import OSITrace


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
