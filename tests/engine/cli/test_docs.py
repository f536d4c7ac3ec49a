"""Agreement of docs/explanations.md and docs/results.md with the output of the commands."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
from command_fixtures import Eidrive

from eidrive_scenario.recording.text.csv_writer import COLUMNS

PAGE = Path(__file__).parents[3] / "docs" / "explanations.md"


@pytest.fixture(scope="module")
def blocks() -> list[list[str]]:
    """Return the two blocks of the page: a log and an explanation."""
    found = re.findall(r"```\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    return [block.strip("\n").splitlines() for block in found]


def test_documented_log_equals_output(eidrive: Eidrive, blocks: list[list[str]]) -> None:
    printed = eidrive("run", "coop/scenario_1", "--no-record", "--log", "-").stdout.splitlines()
    shown = [line for line in blocks[0] if line.strip() != "…"]
    assert len(shown) >= 4
    assert [line for line in shown if line not in printed] == []


def test_documented_explanation_equals_output(eidrive: Eidrive, blocks: list[list[str]]) -> None:
    command, *shown = blocks[1]
    printed = eidrive(*command.removeprefix("$ eidrive ").split()).stdout
    lines = [re.sub(r"'(\w+)', .*/(scenario_1\.xosc)", r"'\1', \2", line) for line in printed.splitlines()]
    assert lines[-len(shown) :] == shown


RESULTS = PAGE.with_name("results.md")


def test_documented_keys_equal_keys_of_result(eidrive: Eidrive, passing_by: Path) -> None:
    text = RESULTS.read_text(encoding="utf-8")
    table = text[text.index("| key |") : text.index("| metric |")]
    shown = [key for row in table.splitlines()[2:] for key in re.findall(r"`(\w+)`", row.split("|")[1] if row else "")]
    printed = json.loads(eidrive("run", passing_by, "--json", "--no-record").stdout)
    assert shown == ["scenario", "run", *list(printed)[1:]]
    assert ",".join(COLUMNS) in text


@pytest.mark.process
def test_documented_reading_of_recording_is_executable(eidrive: Eidrive, passing_by: Path, tmp_path: Path) -> None:
    eidrive("run", passing_by, "--out", tmp_path / "run")
    code = re.findall(r"```python\n(.*?)```", RESULTS.read_text(encoding="utf-8"), re.DOTALL)[0]
    printed = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (printed.stdout, printed.stderr) == ("passing_by 1 3.0\n", "")
