"""`eidrive list`, `tree`, `view`, `report` and the help."""

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from typer.testing import Result

Eidrive = Callable[..., Result]


def test_help_names_the_commands_and_imports_no_engine() -> None:
    script = (
        "import sys; from eidrive_scenario.cli import app\n"
        "try:\n    app(['--help'])\nexcept SystemExit as end:\n    assert end.code == 0, end.code\n"
        "heavy = {'numpy', 'pybullet', 'pydantic', 'eidrive_scenario.simulation'} & set(sys.modules)\n"
        "assert not heavy, heavy"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    for command in ("run", "check", "list", "tree", "view", "report"):
        assert f" {command} " in done.stdout


def test_version(eidrive: Eidrive) -> None:
    assert eidrive("--version").stdout.startswith("eidrive-scenario ")


@pytest.mark.parametrize(
    ("what", "expected"),
    [
        ("scenarios", "coop/scenario_1"),
        ("channels", "none"),
        ("weather", "foggy_morning"),
        ("catalogs", "vehicles"),
        ("criteria", "min_distance"),
        ("detectors", "oracle"),
        ("fusion", "average"),
        ("planners", "conflict_area"),
        ("controllers", "alks"),
        ("actions", "SpeedAction"),
        ("conditions", "SimulationTimeCondition"),
        ("rules", "unobserved-edge"),
    ],
)
def test_list(eidrive: Eidrive, what: str, expected: str) -> None:
    result = eidrive("list", what)
    assert result.exit_code == 0
    assert expected in [line.split()[0] for line in result.stdout.splitlines()]


def test_list_is_about_scenarios_by_default(eidrive: Eidrive) -> None:
    assert eidrive("list").stdout == eidrive("list", "scenarios").stdout


def test_tree(eidrive: Eidrive, passing_by: Path) -> None:
    result = eidrive("tree", passing_by)
    assert result.exit_code == 0, result.output
    assert "3" in result.stdout


def test_view_writes_a_page(eidrive: Eidrive, passing_by: Path, tmp_path: Path) -> None:
    eidrive("run", passing_by, "--out", tmp_path)
    result = eidrive("view", tmp_path)
    assert result.exit_code == 0, result.output
    (page,) = tmp_path.rglob("recording.html")
    assert result.stdout.strip() == str(page)
    assert "<html" in page.read_text(encoding="utf-8")


def test_view_of_a_folder_above_those_of_runs(eidrive: Eidrive, passing_by: Path, tmp_path: Path) -> None:
    result = eidrive("view", tmp_path)
    assert result.exit_code == 2
    assert f"{tmp_path}: no recording.mcap in this folder; eidrive run … --out DIR records" in result.stderr
    eidrive("run", passing_by, "--out", tmp_path / "one")
    assert eidrive("view", tmp_path).exit_code == 0, "the only one is meant"
    eidrive("run", passing_by, "--out", tmp_path / "one", "--seed", "2")
    result = eidrive("view", tmp_path)
    assert result.exit_code == 2
    assert f"{tmp_path}: 2 recordings are below this folder; give one of its folders: one/passing_by-" in result.stderr


def test_a_page_that_cannot_be_written(eidrive: Eidrive, passing_by: Path, tmp_path: Path) -> None:
    eidrive("run", passing_by, "--out", tmp_path)
    (tmp_path / "file").touch()
    for arguments in (("view", tmp_path, "-o", tmp_path), ("report", tmp_path, "-o", tmp_path / "file")):
        result = eidrive(*arguments)
        assert result.exit_code == 2, result.output
        assert "cannot write" in result.stderr


def test_view_of_no_recording(eidrive: Eidrive, passing_by: Path) -> None:
    result = eidrive("view", passing_by)
    assert result.exit_code == 2
    assert f"{passing_by}: not an MCAP file" in result.stderr


def test_report_over_runs(eidrive: Eidrive, passing_by: Path, tmp_path: Path) -> None:
    eidrive("run", passing_by, "--out", tmp_path / "runs" / "far", "--no-record", "--repeat", "2")
    eidrive("run", passing_by, "--out", tmp_path / "runs" / "near", "--no-record", "--param", "OtherY=0")
    result = eidrive("report", tmp_path / "runs", "-o", tmp_path / "report")
    assert result.exit_code == 0, result.output
    page = Path(result.stdout.strip())
    assert page.is_relative_to(tmp_path / "report")
    assert "hit each other" in page.read_text(encoding="utf-8")
    beside = Path(eidrive("report", tmp_path / "runs").stdout.strip())
    assert beside == tmp_path / "runs" / "report.html"
    assert beside.read_bytes() == page.read_bytes()


@pytest.mark.parametrize("command", ["report", "view"])
def test_malformed_result_is_named_by_its_file(
    eidrive: Eidrive, passing_by: Path, tmp_path: Path, command: str
) -> None:
    """Among the results of several runs, that one which lacks its seed."""
    eidrive("run", passing_by, "--out", tmp_path, "--repeat", "2")
    _, file = sorted(tmp_path.glob("*/result.json"))
    content = json.loads(file.read_text())
    del content["seed"]
    file.write_text(json.dumps(content))
    result = eidrive(command, tmp_path if command == "report" else file.parent)
    assert result.exit_code == 2
    assert result.stderr == f"{file}: a result's 'seed': field required; give what eidrive run --json prints\n"


def test_report_without_runs(eidrive: Eidrive, tmp_path: Path) -> None:
    result = eidrive("report", tmp_path, "-o", tmp_path / "report")
    assert result.exit_code == 2
    assert "no result.json in" in result.stderr


def test_tree_as_a_picture(eidrive: Eidrive, passing_by: Path, tmp_path: Path) -> None:
    picture = tmp_path / "tree.svg"
    result = eidrive("tree", passing_by, "--svg", picture)
    assert (result.exit_code, result.stdout.strip()) == (0, str(picture))
    assert "simulation time ≥ 3 s" in picture.read_text(encoding="utf-8")


def test_the_page_of_a_recording_has_the_verdicts_beside_it(eidrive: Eidrive, passing_by: Path, tmp_path: Path) -> None:
    eidrive("run", passing_by, "--param", "OtherY=0", "--out", tmp_path)
    eidrive("view", tmp_path)
    (kept,) = tmp_path.rglob("result.json")
    page = kept.with_name("recording.html")
    assert "Ego and Parked hit each other" in page.read_text(encoding="utf-8")
    kept.write_text('{"trace_hash": "00"}')
    wrong = eidrive("view", tmp_path)
    assert (wrong.exit_code, wrong.stderr.startswith(f"{kept}: a result's 'scenario': field required")) == (2, True)
    kept.unlink()
    eidrive("view", tmp_path)
    assert "<h3>Verdict" not in page.read_text(encoding="utf-8")


@pytest.mark.parametrize("arguments", [["view"], ["report", "-o", "page"]])
def test_a_name_that_is_no_path_is_a_wrong_input(eidrive: Eidrive, arguments: list[str]) -> None:
    result = eidrive(*arguments, "x" * 300)
    assert result.exit_code == 2
    assert "cannot read: File name too long" in result.stderr
