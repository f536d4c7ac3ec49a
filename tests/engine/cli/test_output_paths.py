"""Output paths: never an input file, and never one file for two outputs."""

import errno
import re
import shutil
from pathlib import Path

import pytest
from command_fixtures import Eidrive
from opendrive_xml import map_xml, road_xml
from openscenario_xml import road_file_xml

from eidrive_scenario.cli.options import check_output_paths
from eidrive_scenario.errors import SettingError
from eidrive_scenario.files.atomic import atomic_output, write_atomically

CATALOGS = Path(__file__).parents[2] / "data" / "catalogs"
CATALOG_LOCATIONS = """<CatalogLocations>
  <VehicleCatalog><Directory path="catalogs"/></VehicleCatalog>
</CatalogLocations>"""


@pytest.fixture
def own(passing_by: Path, tmp_path: Path) -> Path:
    copy = tmp_path / "own.xosc"
    copy.write_bytes(passing_by.read_bytes())
    return copy


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["run", "{own}", "--csv", "{own}"], "--csv would overwrite an input file"),
        (["run", "{own}", "--log", "{folder}/../{name}/own.xosc"], "--log would overwrite an input file"),
        (["tree", "{own}", "--svg", "{own}"], "--svg would overwrite an input file"),
        (["run", "{own}", "--csv", "{folder}/a", "--log", "{folder}/a"], "--csv and --log name the same file"),
    ],
)
def test_output_path_of_input_file_is_invalid_input(
    eidrive: Eidrive, own: Path, arguments: list[str], message: str
) -> None:
    before = own.read_bytes()
    given = [text.format(own=own, folder=own.parent, name=own.parent.name) for text in arguments]
    result = eidrive(*given)
    assert result.exit_code == 2, result.output
    assert message in result.stderr
    assert own.read_bytes() == before
    assert list(own.parent.iterdir()) == [own]


@pytest.fixture
def inputs(eidrive: Eidrive, own: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, Path]:
    """Return a scenario, its recorded run and a store by name; the current folder is empty."""
    eidrive("run", own, "--out", tmp_path / "run")
    eidrive("sweep", own, "--store", tmp_path / "s.db", "--workers", "1")
    (tmp_path / "empty").mkdir()
    monkeypatch.chdir(tmp_path / "empty")
    return {"own": own, "run": tmp_path / "run", "store": tmp_path / "s.db"}


@pytest.mark.parametrize(
    ("command", "options"),
    [
        ("check {own}", "--sarif"),
        ("compare {store} {store}", "--html"),
        ("dataset {own}", "--out"),
        ("dataset --import {run}", "--out"),
        ("draw {own}", "--out"),
        ("export {run}", "--osi --foxglove --mcap --csv --parquet"),
        ("report {run}", "--out --figures"),
        ("results {store}", "--csv --parquet"),
        ("run {own}", "--csv --out"),
        ("schema stack", "--out"),
        ("sweep {own}", "--store"),
        ("sweep {own} --store new.db", "--out"),
        ("tree {own}", "--svg"),
        ("view {run}", "--out --png --svg --pdf --gif --mp4"),
    ],
)
def test_hyphen_is_no_path_of_an_output(eidrive: Eidrive, inputs: dict[str, Path], command: str, options: str) -> None:
    """Only `run --log -` is standard output."""
    for option in options.split():
        result = eidrive(*(text.format(**inputs) for text in command.split()), option, "-")
        assert (result.exit_code, result.stderr.partition(";")[0]) == (2, f"{option}: - is not a path")
        assert not list(Path().iterdir())


@pytest.mark.parametrize(
    ("command", "options", "name"),
    [
        ("check {run}/..", "--sarif", "own.xosc"),
        ("compare {run} {run}", "--html", "result.json"),
        ("export {run}", "--csv", "recording.mcap"),
        ("results {run}", "--csv --parquet", "result.json"),
        ("view {run}", "--out --gif", "result.json"),
    ],
)
def test_output_path_of_file_that_is_read_in_folder_is_invalid_input(
    eidrive: Eidrive, inputs: dict[str, Path], command: str, options: str, name: str
) -> None:
    (path,) = inputs["run"].parent.rglob(name)
    before = path.read_bytes()
    for option in options.split():
        result = eidrive(*(text.format(**inputs) for text in command.split()), option, path)
        assert (result.exit_code, f"{path}: {option} would overwrite an input file" in result.stderr) == (2, True)
        assert path.read_bytes() == before


@pytest.mark.parametrize(("command", "option"), [("run", "--csv"), ("run", "--log"), ("tree", "--svg")])
@pytest.mark.parametrize("name", ["road.xodr", "Vehicles.xosc"])
def test_output_path_of_file_to_which_scenario_refers_is_invalid_input(
    eidrive: Eidrive, own: Path, command: str, option: str, name: str
) -> None:
    """The parked car is an entry of a catalog."""
    shutil.copytree(CATALOGS, own.with_name("catalogs"))
    own.with_name("road.xodr").write_text(map_xml(road_xml(length=200.0)))
    entry = '<CatalogReference catalogName="Vehicles" entryName="red_van"/>'
    text = own.read_text().replace("<RoadNetwork/>", f"<RoadNetwork>{road_file_xml('road.xodr')}</RoadNetwork>")
    text = text.replace("<CatalogLocations/>", CATALOG_LOCATIONS)
    own.write_text(re.sub(r'(name="Parked">\s*)<Vehicle.*?</Vehicle>', rf"\1{entry}", text, flags=re.DOTALL))
    (path,) = own.parent.rglob(name)
    before = path.read_bytes()
    result = eidrive(command, own, option, path)
    assert (result.exit_code, "would overwrite an input file" in result.stderr) == (2, True), result.output
    assert path.read_bytes() == before


@pytest.mark.parametrize("option", ["--csv", "--log"])
@pytest.mark.parametrize("place", ["/", ".", "..", ""])
@pytest.mark.parametrize("runs", [1, 2])
def test_output_path_of_folder_is_invalid_input(
    eidrive: Eidrive, own: Path, option: str, place: str, runs: int
) -> None:
    """`/`, `.` and an empty text have no file name to which the number of a run could be appended."""
    result = eidrive("run", own, option, place, "--repeat", runs)
    assert result.exit_code == 2, result.output
    assert f"{place or '.'}: cannot write: Is a directory" in result.stderr
    assert "internal error" not in result.output


@pytest.mark.parametrize(
    "command", ["results {long}", "report {long}", "sweep {own} --store {long}", "run {own} --repeat 2 --csv {long}"]
)
def test_path_longer_than_file_names_is_invalid_input(eidrive: Eidrive, own: Path, command: str) -> None:
    """Python raises OSError for the question whether such a path exists."""
    result = eidrive(*command.format(own=own, long="x" * 300).split())
    assert (result.exit_code, "aborted" in result.stderr) == (2, False), result.output


def test_csv_of_two_runs_to_device_creates_no_file(eidrive: Eidrive, own: Path, tmp_path: Path) -> None:
    """The path is a link to /dev/null."""
    sink = tmp_path / "sink"
    sink.symlink_to("/dev/null")
    before = sorted(tmp_path.iterdir())
    result = eidrive("run", own, "--csv", sink, "--repeat", 2, "--time-limit", 0.2)
    assert result.exit_code == 3, result.output
    assert sorted(tmp_path.iterdir()) == before


def test_view_does_not_overwrite_its_recording(eidrive: Eidrive, own: Path, tmp_path: Path) -> None:
    eidrive("run", own, "--out", tmp_path / "run")
    (recording,) = (tmp_path / "run").rglob("recording.mcap")
    result = eidrive("view", tmp_path / "run", "--out", recording)
    assert (result.exit_code, recording.read_bytes()[1:5]) == (2, b"MCAP")


def test_check_output_paths_allows_device_twice(tmp_path: Path) -> None:
    check_output_paths({"--csv": "/dev/null", "--log": "/dev/null"}, ["none"])
    with pytest.raises(SettingError):
        check_output_paths({"--csv": tmp_path / "a", "--log": tmp_path / "a"}, [])


@pytest.mark.parametrize("command", ["run {own} --out=", "report {folder} --out=", "report {folder} --figures="])
def test_empty_folder_of_output_is_invalid_input(
    eidrive: Eidrive, own: Path, command: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(own.parent)
    before = sorted(own.parent.iterdir())
    result = eidrive(*command.format(own=own, folder=own.parent).split())
    assert (result.exit_code, "is an empty path; give . for the current folder" in result.stderr) == (2, True)
    assert sorted(own.parent.iterdir()) == before


def test_error_of_a_file_that_is_written_states_its_final_name(eidrive: Eidrive, own: Path, tmp_path: Path) -> None:
    """The file has a partial name until it is complete."""
    (tmp_path / "a.partial.csv").mkdir()
    result = eidrive("run", own, "--csv", tmp_path / "a.csv")
    assert (result.exit_code, f"{tmp_path / 'a.csv'}: cannot write: Is a directory" in result.stderr) == (2, True)
    with pytest.raises(OSError, match="full") as caught, atomic_output(tmp_path / "b.csv") as unfinished:
        raise OSError(errno.ENOSPC, "full", str(unfinished))
    assert caught.value.filename == str(tmp_path / "b.csv")


def test_aborted_file_behind_a_link_is_unchanged(tmp_path: Path) -> None:
    target, link = tmp_path / "kept" / "page.html", tmp_path / "page.html"
    target.parent.mkdir()
    target.write_bytes(b"before")
    link.symlink_to(target)
    with pytest.raises(TypeError), write_atomically(link) as stream:
        stream.writelines([b"half", None])  # type: ignore[list-item]
    assert (target.read_bytes(), [*target.parent.iterdir()]) == (b"before", [target])
    with write_atomically(link) as stream:
        stream.write(b"after")
    assert (target.read_bytes(), link.is_symlink()) == (b"after", True)
