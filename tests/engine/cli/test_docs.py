"""What docs/why.md shows of scenario 1 is what comes."""

import re
from collections.abc import Callable
from pathlib import Path

import pytest
from typer.testing import Result

Eidrive = Callable[..., Result]
PAGE = Path(__file__).parents[3] / "docs" / "why.md"


@pytest.fixture(scope="module")
def blocks() -> list[list[str]]:
    """The two blocks of the page: of a log, and of an explanation."""
    found = re.findall(r"```\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    return [block.strip("\n").splitlines() for block in found]


def test_the_log(eidrive: Eidrive, blocks: list[list[str]]) -> None:
    printed = eidrive("run", "coop/scenario_1", "--no-record", "--log", "-").stdout.splitlines()
    shown = [line for line in blocks[0] if line.strip() != "…"]
    assert len(shown) >= 4
    assert [line for line in shown if line not in printed] == []


def test_the_explanation(eidrive: Eidrive, blocks: list[list[str]]) -> None:
    command, *shown = blocks[1]
    printed = eidrive(*command.removeprefix("$ eidrive ").split()).stdout
    told = [re.sub(r"'(\w+)', .*/(scenario_1\.xosc)", r"'\1', \2", line) for line in printed.splitlines()]
    assert told[-len(shown) :] == shown
