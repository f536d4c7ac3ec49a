"""docs/reinforcement_learning.md, and the error for a missing library."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from eidrive_scenario.base.installation import install_command

PAGE = Path(__file__).parents[3] / "docs" / "reinforcement_learning.md"
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def test_blocks_of_the_page_run_and_print_the_stated_output(capsys: pytest.CaptureFixture[str]) -> None:
    blocks = BLOCK.findall(PAGE.read_text(encoding="utf-8"))
    names: dict[str, object] = {}
    for (kind, text), (following, expected) in zip(blocks, [*blocks[1:], ("", "")], strict=True):
        if kind != "python":
            continue
        exec(compile(text, PAGE.name, "exec"), names)
        printed = capsys.readouterr().out
        if following == "text":
            assert printed == expected, text


@pytest.mark.process
@pytest.mark.parametrize(("module", "library"), [("gymnasium", "Gymnasium"), ("pettingzoo", "PettingZoo")])
def test_missing_library_is_an_error_with_the_command_that_installs_it(module: str, library: str) -> None:
    program = (
        f"import sys; sys.modules[{module!r}] = None\n"
        "from eidrive_scenario.errors import SettingError\n"
        "try:\n"
        "    from eidrive_scenario.gym import EidriveParallelEnv\n"
        "except SettingError as error:\n"
        "    print(error)\n"
    )
    printed = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout
    assert printed.strip() == f"{library} is not installed; install it: {install_command('gym')}"
