"""`eidrive init`: a project whose tests pass at once."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from command_fixtures import Eidrive

from eidrive_scenario.checks.scenario_checks import check_scenario
from eidrive_scenario.errors import RegistryError
from eidrive_scenario.registry import register, registry


@pytest.mark.timeout(300)
def test_new_project_passes_its_tests(eidrive: Eidrive, tmp_path: Path) -> None:
    """The scenario as a test item, three gaps, and a success rate; another process, as a user has it."""
    folder = tmp_path / "my-demo"
    done = eidrive("init", folder)
    assert done.exit_code == 0
    written = {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}
    assert written == set(done.stdout.split())
    assert {"my_demo_criteria.py", ".github/workflows/scenarios.yml", ".gitignore"} <= written
    assert tomllib.loads((folder / "pyproject.toml").read_text())["project"]["name"] == "my-demo"
    assert not any("@package@" in path.read_text() for path in folder.rglob("*.py"))
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider"]
    tests = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert tests.returncode == 0, tests.stdout
    assert "5 passed" in tests.stdout


def test_template_scenario_has_no_diagnostics(
    eidrive: Eidrive, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "gap"
    eidrive("init", folder)
    monkeypatch.syspath_prepend(folder)
    register("criteria", "keep_gap", "gap_criteria:KeepGap")
    try:
        report = check_scenario(folder / "scenarios" / "cut_in.xosc")
        assert (report.errors, report.warnings) == ((), ())
    finally:
        registry("criteria")._points.pop("keep_gap")


@pytest.mark.parametrize(
    ("name", "package"), [("Demo 2", "demo_2"), ("2nd", "project_2nd"), ("überholen", "berholen"), ("__", "project")]
)
def test_names_of_folders_become_packages(eidrive: Eidrive, tmp_path: Path, name: str, package: str) -> None:
    assert eidrive("init", tmp_path / name).exit_code == 0
    assert (tmp_path / name / f"{package}_criteria.py").is_file()


def test_folder_with_files_is_refused(eidrive: Eidrive, tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    done = eidrive("init", tmp_path)
    assert done.exit_code == 2
    assert "not empty" in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]
    assert eidrive("init", tmp_path / "notes.txt").exit_code == 2


@pytest.mark.parametrize(
    ("kind", "name", "value", "expected"),
    [
        ("criterion", "gap", "a:B", "unknown kind"),
        ("criteria", "gap", "no object", "expected package.module:Object"),
        ("criteria", "collision", "a:B", "registered twice"),
    ],
)
def test_invalid_registration_raises(kind: str, name: str, value: str, expected: str) -> None:
    with pytest.raises(RegistryError, match=expected):
        register(kind, name, value)
