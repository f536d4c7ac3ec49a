"""Where a command writes: never over what it reads, and never twice into one file."""

from collections.abc import Callable
from pathlib import Path

import pytest
from typer.testing import Result

from eidrive_scenario.cli.output_paths import check_output_paths
from eidrive_scenario.errors import SettingError

Eidrive = Callable[..., Result]


@pytest.fixture
def own(passing_by: Path, tmp_path: Path) -> Path:
    copy = tmp_path / "own.xosc"
    copy.write_bytes(passing_by.read_bytes())
    return copy


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["run", "{own}", "--csv", "{own}"], "--csv would overwrite what is read"),
        (["run", "{own}", "--log", "{folder}/../{name}/own.xosc"], "--log would overwrite what is read"),
        (["tree", "{own}", "--svg", "{own}"], "--svg would overwrite what is read"),
        (["run", "{own}", "--csv", "{folder}/a", "--log", "{folder}/a"], "--csv and --log name one file"),
    ],
)
def test_an_input_is_not_overwritten(eidrive: Eidrive, own: Path, arguments: list[str], message: str) -> None:
    before = own.read_bytes()
    given = [text.format(own=own, folder=own.parent, name=own.parent.name) for text in arguments]
    result = eidrive(*given)
    assert result.exit_code == 2, result.output
    assert message in result.stderr
    assert own.read_bytes() == before
    assert list(own.parent.iterdir()) == [own]


@pytest.mark.parametrize("option", ["--csv", "--log"])
@pytest.mark.parametrize("place", ["/", ".", "..", ""])
@pytest.mark.parametrize("runs", [1, 2])
def test_folder_as_file_is_refused(eidrive: Eidrive, own: Path, option: str, place: str, runs: int) -> None:
    """`/`, `.` and an empty text have no last part to which the number of a run could be added."""
    result = eidrive("run", own, option, place, "--repeat", runs)
    assert result.exit_code == 2, result.output
    assert f"{place or '.'}: cannot write: Is a directory" in result.stderr
    assert "internal error" not in result.output


def test_device_takes_the_tables_of_all_runs(eidrive: Eidrive, own: Path, tmp_path: Path) -> None:
    """Two runs through a link to /dev/null leave no file beside it."""
    sink = tmp_path / "sink"
    sink.symlink_to("/dev/null")
    before = sorted(tmp_path.iterdir())
    result = eidrive("run", own, "--csv", sink, "--repeat", 2, "--time-limit", 0.2)
    assert result.exit_code == 3, result.output
    assert sorted(tmp_path.iterdir()) == before


def test_a_recording_is_not_overwritten_by_its_page(eidrive: Eidrive, own: Path, tmp_path: Path) -> None:
    eidrive("run", own, "--out", tmp_path / "run")
    (recording,) = (tmp_path / "run").rglob("recording.mcap")
    result = eidrive("view", tmp_path / "run", "--out", recording)
    assert (result.exit_code, recording.read_bytes()[1:5]) == (2, b"MCAP")


def test_devices_take_all(tmp_path: Path) -> None:
    check_output_paths({"--csv": "/dev/null", "--log": "/dev/null"}, ["none"])
    with pytest.raises(SettingError):
        check_output_paths({"--csv": tmp_path / "a", "--log": tmp_path / "a"}, [])
