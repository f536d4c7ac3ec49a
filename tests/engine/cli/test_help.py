"""`--help` of all commands: length, and examples that the commands accept."""

from __future__ import annotations

import re
import shlex
from typing import Any

import pytest
import typer
from command_fixtures import Eidrive
from typer.testing import CliRunner

from eidrive_scenario.cli import app
from eidrive_scenario.cli.options import RARE

GROUP: Any = typer.main.get_command(app)
NAMES = sorted(GROUP.commands)
MOST_LINES = 40
WIDTH = 100


def help_text(*arguments: str) -> str:
    done = CliRunner().invoke(app, [*arguments], env={"COLUMNS": str(WIDTH), "TERMINAL_WIDTH": str(WIDTH)})
    assert done.exit_code == 0, done.output
    return done.stdout


def examples(text: str) -> list[list[str]]:
    """Return the words of the commands after `Example:`, at `&&` separated."""
    lines = [found[1] for line in text.splitlines() if (found := re.match(r" *Example: (.*)", line))]
    return [shlex.split(part) for line in lines for part in line.split("&&")]


@pytest.mark.parametrize("name", ["", *NAMES])
def test_help_fits_on_screen_and_has_example(name: str) -> None:
    text = help_text(*name.split(), "--help")
    assert len(text.splitlines()) <= MOST_LINES
    assert max(map(len, text.splitlines())) <= WIDTH
    commands = examples(text)
    assert commands
    assert commands[0][:2] == ["eidrive", name or "run"]


@pytest.mark.parametrize("name", NAMES)
def test_examples_of_help_are_parsed_by_their_command(name: str) -> None:
    command = GROUP.commands[name]
    words = examples(help_text(name, "--help"))[0][2:]
    names = {option: parameter.name for parameter in command.params for option in parameter.opts}
    values = command.make_context(name, list(words)).params
    assert [names[word] for word in words if word.startswith("--") and not values[names[word]]] == []


@pytest.mark.parametrize("name", NAMES)
def test_help_names_every_option(name: str) -> None:
    found = {option for parameter in GROUP.commands[name].params for option in parameter.opts}
    options = {option for option in found if option.startswith("--")}
    texts = [help_text(name, "--help")]
    if RARE in texts[0]:
        texts.append(help_text(name, "--help-all"))
    for text in texts:
        assert options <= set(re.findall(r"--[a-z][a-z0-9-]*", text))


def test_options_of_help_all_are_described(eidrive: Eidrive) -> None:
    assert "Maximum simulated time in seconds" not in help_text("run", "--help")
    assert "Maximum simulated time in seconds" in help_text("run", "--help-all")
    assert eidrive("run", "--help-all").exit_code == 0
    assert "Maximum simulated time in seconds" not in help_text("run", "--help")
