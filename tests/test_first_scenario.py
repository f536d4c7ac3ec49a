"""Agreement of docs/first_scenario.md with the commands that it shows: all of them, in order, in an empty folder."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.process

PAGE = (Path(__file__).parents[1] / "docs" / "first_scenario.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```(console|xml)\n(.*?)```", PAGE, re.DOTALL)
FAILING = ("--channel none", "pytest ")
"""Parts of the commands that end with exit code 1."""


@pytest.mark.timeout(600)
def test_commands_of_the_page_print_what_it_shows(tmp_path: Path) -> None:
    environment = {**os.environ, "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}
    environment.pop("PYTEST_ADDOPTS", None)
    folder, executed = tmp_path, 0
    for kind, text in BLOCKS:
        if kind == "xml":
            (folder / "scenarios" / "child.xosc").write_text(text, encoding="utf-8")
            continue
        for entry in text.split("$ ")[1:]:
            command, *shown = entry.strip().splitlines()
            if command.startswith("cd "):
                folder /= command.removeprefix("cd ")
                continue
            done = subprocess.run(
                command, shell=True, cwd=folder, env=environment, capture_output=True, text=True, check=False
            )
            printed = " ".join(done.stdout.split())
            assert done.returncode == any(part in command for part in FAILING), f"{command}\n{done.stdout}{done.stderr}"
            for line in shown:
                assert " ".join(line.split()) in printed, command
            executed += 1
    assert executed == PAGE.count("\n$ ") - 1
