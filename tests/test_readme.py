"""README.md and the tables of commands and options: agreement with the code and with the files of the project."""

from __future__ import annotations

import re
from pathlib import Path
from typing import get_args

from eidrive_scenario.cli import CommandTable
from eidrive_scenario.cli.show import Names
from eidrive_scenario.pytest_plugin.options import OPTIONS

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
COMMANDS = (ROOT / "docs" / "command_line.md").read_text(encoding="utf-8")
PYTEST = (ROOT / "docs" / "pytest.md").read_text(encoding="utf-8")


def test_readme_is_short() -> None:
    assert len(README.splitlines()) <= 150


def test_page_lists_every_command() -> None:
    assert re.findall(r"^\| `eidrive ([a-z]+)", COMMANDS, re.MULTILINE) == list(CommandTable())


def test_page_lists_every_kind_of_names() -> None:
    row = next(line for line in COMMANDS.splitlines() if line.startswith("| `eidrive list"))
    listed = re.findall(r"`(?:eidrive list )?([a-z_]+)`", row)
    assert sorted(listed) == sorted([*get_args(Names), "check"])


def test_page_lists_every_option_of_the_pytest_plugin() -> None:
    table = PYTEST[PYTEST.index("| option | effect |") :].split("\n\n")[0]
    listed = re.findall(r"^\| `(--eidrive-[a-z-]+)", table, re.MULTILINE)
    assert sorted(listed) == sorted(option.flag for option in OPTIONS)


def test_files_that_the_readme_names_exist() -> None:
    named = set(re.findall(r"`((?:docs|examples|xosc)/[\w/.]*|CONTRIBUTING\.md)`|\]\(([\w/.]+)\)", README))
    missing = [name for pair in named for name in pair if name and not (ROOT / name).exists()]
    assert missing == []
    pages = {f"docs/{path.name}" for path in (ROOT / "docs").glob("*.md")}
    assert {page for page in pages if page not in README} == {"docs/index.md"}, "the README itself is the index"
