"""Commands of runs with an extension that the `conftest.py` of a project registers."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.process

PASSING_BY = Path(__file__).parents[2] / "data" / "passing_by.xosc"
CONFTEST = """\
from eidrive_scenario.api.common import register
from eidrive_scenario.api.criteria import Criterion, CriterionSettings


class Short(Criterion):
    settings_type = CriterionSettings
    name = "short"

    def observe(self, frame):
        self._end = frame.view.time

    def verdict(self):
        return self.conclude(self._end < 2.0, f"the run takes {self._end:.2f} s", value=self._end, limit=2.0)


register("criteria", "short", "conftest:Short")
"""
TABLE = '[tool.eidrive]\npythonpath = ["."]\nmodules = ["conftest"]\n'
REASON = "the run takes 3.00 s"
"""The scenario ends at 3 s."""


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """Return a project whose scenario has a criterion of its `conftest.py`, without a table in `pyproject.toml`."""
    folder = tmp_path / "a project"
    (folder / "scenarios").mkdir(parents=True)
    (folder / "conftest.py").write_text(CONFTEST)
    (folder / "pytest.ini").write_text("[pytest]\neidrive_paths = scenarios\n")
    text = PASSING_BY.read_text().replace("collision: {of: Ego, with: Parked}", "short: {}")
    (folder / "scenarios" / "long.xosc").write_text(text)
    return folder


def execute(words: list[str], folder: Path) -> subprocess.CompletedProcess[str]:
    """Return the output of a command, executed in a folder without a selected project."""
    environment = {key: value for key, value in os.environ.items() if key != "EIDRIVE_PROJECT"}
    module = {"eidrive": "eidrive_scenario", "pytest": "pytest"}[words[0]]
    command = [sys.executable, "-m", module, *words[1:]]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, env=environment)


def reproduction(folder: Path, *arguments: str) -> list[str]:
    """Return the words of the command that a failed session prints."""
    done = execute(["pytest", "-p", "no:cacheprovider", *arguments], folder)
    assert REASON in done.stdout, done.stdout + done.stderr
    (command,) = {line for line in done.stdout.splitlines() if line.startswith("reproduce: ")}
    return shlex.split(command.removeprefix("reproduce: "))


def test_command_of_unnamed_registration_is_that_of_pytest(root: Path, tmp_path: Path) -> None:
    words = reproduction(root, "--eidrive-seeds", "1")
    assert words[:2] == ["pytest", f"{root}/scenarios/long.xosc::scenarios/long[seed=1]"]
    done = execute([*words, "-p", "no:cacheprovider"], tmp_path)
    assert (done.returncode, REASON in done.stdout) == (1, True)
    unknown = execute(["eidrive", "run", "scenarios/long.xosc"], root)
    assert unknown.returncode == 2
    assert f"{root / 'conftest.py'}: only pytest knows extensions that it registers; name the module" in unknown.stderr


@pytest.mark.timeout(300)
def test_command_of_named_module_runs_in_any_folder_and_copy(root: Path, tmp_path: Path) -> None:
    (root / "pyproject.toml").write_text(TABLE)
    (root / "slow.yaml").write_text("max_speed: {of: Ego, at_most: 5}\n")
    words = reproduction(root, "--eidrive-criterion", "slow.yaml", "--eidrive-out", "runs")
    expected = ["--project", str(root), "run", "scenarios/long.xosc", "--criterion", "slow.yaml", "--seed", "1"]
    assert words == ["eidrive", *expected]
    done = execute(words, tmp_path)
    assert (done.returncode, REASON in done.stdout) == (1, True)
    copy = tmp_path / "copy"
    shutil.move(root, copy)
    inside = execute(words, copy / "scenarios")
    assert (inside.returncode, REASON in inside.stdout) == (1, True)
    assert inside.stderr.startswith(f"--project: no folder {root}; the project of the current folder is used: {copy}")
    outside = execute(words, tmp_path)
    assert (outside.returncode, "--project: no such folder" in outside.stderr) == (2, True)
    (recording,) = (copy / "runs").rglob("recording.mcap")
    for arguments in (["judge", str(recording.relative_to(copy))], ["check", "scenarios"]):
        done = execute(["eidrive", "--project", "copy", *arguments], tmp_path)
        assert done.returncode == (1 if arguments[0] == "judge" else 0), done.stdout + done.stderr
        assert (REASON in done.stdout) == (arguments[0] == "judge")


def test_runs_of_sweep_import_named_modules(root: Path, tmp_path: Path) -> None:
    (root / "pyproject.toml").write_text(TABLE)
    sweep = ["sweep", "scenarios/long.xosc", "--vary", "End=1,3", "--workers", "2", "--store", "s.db"]
    done = execute(["eidrive", "--project", str(root), *sweep], tmp_path)
    assert "1 failed, 1 passed" in done.stdout, done.stdout + done.stderr
    listed = execute(["eidrive", "results", str(root / "s.db"), "--failures"], tmp_path)
    (line,) = listed.stdout.splitlines()
    assert execute(shlex.split(line.removeprefix("failed: ")), tmp_path).returncode == 1


def test_scenario_does_not_import_modules_of_its_project(root: Path, tmp_path: Path) -> None:
    """Only the project of the current folder, or a named one, executes code."""
    (root / "pyproject.toml").write_text(TABLE)
    (root / "conftest.py").write_text("open('imported', 'w').close()\n")
    for words in (["run"], ["check"]):
        done = execute(["eidrive", *words, str(root / "scenarios" / "long.xosc")], tmp_path)
        assert "unknown criterion 'short'" in done.stdout + done.stderr
        assert done.returncode == 2
    assert not list(tmp_path.rglob("imported"))


@pytest.mark.parametrize(
    ("modules", "code", "expected"),
    [
        ("3", 2, "tool.eidrive.modules: '3'"),
        ('["no name"]', 2, "'no name' is not the name of a module"),
        ('["absent"]', 3, "module 'absent' of the project"),
        ('["absent"]', 3, "ModuleNotFoundError: No module named 'absent'; name its folder in pythonpath\n"),
        ('["faulty"]', 3, "faulty.py:1"),
    ],
)
def test_invalid_modules_of_project_are_reported(tmp_path: Path, modules: str, code: int, expected: str) -> None:
    (tmp_path / "pyproject.toml").write_text(f'[tool.eidrive]\npythonpath = ["."]\nmodules = {modules}\n')
    (tmp_path / "faulty.py").write_text("raise ValueError('fault')\n")
    done = execute(["eidrive", "list", "criteria"], tmp_path)
    assert (done.returncode, expected in done.stderr) == (code, True), done.stderr
