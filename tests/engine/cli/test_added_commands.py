"""Commands of other packages and of projects."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.process

PROJECT = """\
[project]
name = "acme"
version = "1"
[project.entry-points."eidrive_scenario.commands"]
hello = "acme_cmd:main"
broken = "acme_cmd:nothing"
fail = "acme_cmd:fail"
leave = "acme_cmd:leave"
list = "acme_cmd:main"
[tool.eidrive]
pythonpath = ["."]
"""
MODULE = """\
import typer


def main(name: str = "world") -> None:
    typer.echo(f"hello {name}")


def fail() -> None:
    raise ZeroDivisionError("no runs")


def leave() -> None:
    raise SystemExit(7)
"""


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("acme")
    (folder / "pyproject.toml").write_text(PROJECT, encoding="utf-8")
    (folder / "acme_cmd.py").write_text(MODULE, encoding="utf-8")
    return folder


@pytest.mark.parametrize(
    ("arguments", "inside", "code", "expected"),
    [
        (["hello", "--name", "Ego"], True, 0, "hello Ego"),
        (["--project", "{project}", "hello"], False, 0, "hello world"),
        (["hello"], False, 2, "No such command 'hello'"),
        (["helo"], True, 2, "Did you mean 'hello'"),
        (["broken"], True, 3, "command 'broken' (acme_cmd:nothing) does not load"),
        (["fail"], True, 3, "acme_cmd.py:9: command 'fail' (acme_cmd:fail): ZeroDivisionError: no runs"),
        (["leave"], True, 7, ""),
        (["list", "commands"], True, 0, "hello      acme_cmd:main"),
    ],
    ids=["inside", "outside", "unselected", "misspelled", "broken", "exception", "exit code", "name of the engine"],
)
def test_command_of_project(
    project: Path, tmp_path: Path, arguments: list[str], inside: bool, code: int, expected: str
) -> None:
    environment = {key: value for key, value in os.environ.items() if key != "EIDRIVE_PROJECT"}
    command = [sys.executable, "-m", "eidrive_scenario", *(word.format(project=project) for word in arguments)]
    done = subprocess.run(
        command, cwd=project if inside else tmp_path, env=environment, capture_output=True, text=True, check=False
    )
    assert (done.returncode, expected in done.stdout + done.stderr) == (code, True), done.stdout + done.stderr
