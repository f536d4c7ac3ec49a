"""`eidrive init`: a project whose tests pass at once."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest
from command_fixtures import Eidrive

from eidrive_scenario.checks.scenario_checks import check_scenario
from eidrive_scenario.errors import RegistryError
from eidrive_scenario.extensions.registry import register, registry


@pytest.mark.process
@pytest.mark.timeout(300)
def test_scenario_of_new_project_passes_without_installation(eidrive: Eidrive, tmp_path: Path) -> None:
    """Another process, as a user has it; `test_ci_page` runs all tests of the project."""
    folder = tmp_path / "my-demo"
    done = eidrive("init", folder)
    assert done.exit_code == 0
    written = {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}
    assert written == set(done.stdout.split())
    assert {"my_demo_criteria.py", ".github/workflows/scenarios.yml", ".gitignore"} <= written
    assert tomllib.loads((folder / "pyproject.toml").read_text())["project"]["name"] == "my-demo"
    assert not any("@package@" in path.read_text() for path in folder.rglob("*.py"))
    assert "pypi.org" not in (folder / "README.md").read_text(), "the project is on no package index"
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "scenarios"]
    tests = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert tests.returncode == 0, tests.stdout
    assert "1 passed" in tests.stdout


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


def test_loop_of_links_is_no_folder_of_project(eidrive: Eidrive, tmp_path: Path) -> None:
    (tmp_path / "loop").symlink_to("loop")
    done = eidrive("init", tmp_path / "loop")
    assert (done.exit_code, "cannot write" in done.stderr) == (2, True), done.output


def test_folder_with_git_only_becomes_project(eidrive: Eidrive, tmp_path: Path) -> None:
    (tmp_path / ".git").mkdir()
    assert eidrive("init", tmp_path).exit_code == 0
    assert (tmp_path / "pyproject.toml").is_file()


@pytest.mark.parametrize(
    ("name", "command"),
    [
        ("a b", "cd 'a b' && pytest"),
        ("-dash", "cd ./-dash && pytest"),
        ("x" * 255, f"cd {'x' * 255} && pytest"),
        ("con", "cd con && pytest"),
        ("a/b", "cd a/b && pytest"),
        (".", "pytest"),
    ],
    ids=["space", "dash", "long", "reserved", "nested", "current"],
)
def test_next_command_of_init_is_valid_in_shell(
    eidrive: Eidrive, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, command: str
) -> None:
    monkeypatch.chdir(tmp_path)
    done = eidrive("init", "--", name)
    assert done.stderr == f"next: {command}\n"
    shown = subprocess.run(command.replace("pytest", "ls"), shell=True, capture_output=True, text=True, check=True)
    assert "pyproject.toml" in shown.stdout.split()


def test_full_disk_leaves_no_part_of_project(eidrive: Eidrive, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write = Path.write_text

    def fail_later(path: Path, *arguments: Any, **keywords: Any) -> int:
        if path.name == "cut_in.xosc":
            raise OSError(errno.ENOSPC, "No space left on device", str(path))
        return write(path, *arguments, **keywords)

    monkeypatch.setattr(Path, "write_text", fail_later)
    done = eidrive("init", tmp_path / "outer" / "demo")
    assert done.exit_code == 2
    assert "cannot write: No space left on device" in done.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.process
@pytest.mark.timeout(300)
def test_commands_use_criterion_of_project_without_installation(eidrive: Eidrive, tmp_path: Path) -> None:
    folder = tmp_path / "demo"
    assert eidrive("init", folder).exit_code == 0
    environment = {key: value for key, value in os.environ.items() if key != "EIDRIVE_PROJECT"}
    for arguments, place in (
        (["check", "scenarios"], folder),
        (["run", "cut_in.xosc"], folder / "scenarios"),
        (["sweep", "scenarios/cut_in.xosc", "--vary", "Gap=40,50", "--workers", "2", "--store", "s.db"], folder),
    ):
        command = [sys.executable, "-m", "eidrive_scenario", *arguments]
        done = subprocess.run(command, cwd=place, capture_output=True, text=True, check=False, env=environment)
        assert done.returncode == 0, done.stdout + done.stderr
        assert ("keep_gap        passed" in done.stdout) == (arguments[0] == "run")
    for command_name, named in (("check", False), ("run", False), ("check", True)):
        outside = [sys.executable, "-m", "eidrive_scenario", command_name, str(folder / "scenarios" / "cut_in.xosc")]
        given = {**environment, "EIDRIVE_PROJECT": str(folder)} if named else environment
        done = subprocess.run(outside, cwd=tmp_path, capture_output=True, text=True, check=False, env=given)
        assert done.returncode == (0 if named else 2)
        assert ("unknown criterion 'keep_gap'" in done.stdout + done.stderr) is not named
        assert (f"or with eidrive --project {folder}" in done.stderr) is not named


@pytest.mark.process
@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("[tool.eidrive]\npythonpath = 3\n", "tool.eidrive.pythonpath"),
        ('[tool.eidrive]\n[project.entry-points."eidrive_scenario.criteria"]\ngap = "no object"\n', "entry point gap"),
        (
            '[tool.eidrive]\n[project.entry-points."eidrive_scenario.criterion"]\ngap = "a:B"\n',
            "unknown group of entry points 'eidrive_scenario.criterion'; did you mean 'criteria'?",
        ),
        ("[tool.eidrive]\npythonpth = []\n", "unknown setting 'tool.eidrive.pythonpth'; did you mean 'pythonpath'?"),
        ("[tool.eidrive\n", "is not TOML"),
        ("eidrive = " + "[" * 100_000, "is nested too deeply"),
        ("[project]\nname = 3\n", ""),
    ],
    ids=["pythonpath", "entry point", "group", "key", "syntax", "nesting", "other"],
)
def test_invalid_table_of_project_is_reported(tmp_path: Path, text: str, expected: str) -> None:
    (tmp_path / "pyproject.toml").write_text(text)
    environment = {key: value for key, value in os.environ.items() if key != "EIDRIVE_PROJECT"}
    command = [sys.executable, "-m", "eidrive_scenario", "list", "criteria"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False, env=environment)
    assert done.returncode == (2 if expected else 0)
    assert expected in done.stderr


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
