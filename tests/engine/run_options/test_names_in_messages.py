"""Names of settings in messages: those of RunSettings in Python, options on the command line and in pytest."""

from __future__ import annotations

import ast
import json
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from command_fixtures import Eidrive, eidrive

import eidrive_scenario
from eidrive_scenario.errors import InputError
from eidrive_scenario.run_options import OPTIONS, RunSettings, with_option_names
from eidrive_scenario.simulation import run_file

__all__ = ["eidrive"]
ENGINE = Path(eidrive_scenario.__file__).parent
SURFACES = ("cli", "pytest_plugin", "run_options")


def texts_of(path: Path) -> Iterator[str]:
    """Yield the text literals of a module without its docstrings."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    documentation = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in documentation:
            yield node.value


def test_engine_names_settings_and_no_options() -> None:
    flags = re.compile(rf"(?<![\w-])({'|'.join(option.flag for option in OPTIONS)})(?![\w-])")
    settings = re.compile(r"RunSettings\.(\w+)")
    for path in ENGINE.rglob("*.py"):
        if path.relative_to(ENGINE).parts[0] not in SURFACES:
            for text in texts_of(path):
                assert not flags.search(text), path
                assert set(settings.findall(text)) <= {option.name for option in OPTIONS}, path


def test_setting_without_option_keeps_name_of_python() -> None:
    text = "RunSettings.channel: use RunSettings.dt; MyRunSettings.dt"
    assert with_option_names(text, {"channel": "--eidrive-channel"}) == (
        "--eidrive-channel: use RunSettings.dt; MyRunSettings.dt"
    )
    assert with_option_names(text) == "--channel: use --dt; MyRunSettings.dt"


def test_error_names_setting_in_python_and_option_on_command_line(eidrive: Eidrive) -> None:
    with pytest.raises(InputError, match=r"^RunSettings\.detector: unknown detector 'lidra'; did you mean 'lidar'\?$"):
        run_file("coop/scenario_1", settings=RunSettings(detector="lidra"))
    result = eidrive("run", "coop/scenario_1", "--detector", "lidra")
    assert result.stderr == "--detector: unknown detector 'lidra'; did you mean 'lidar'?\n"


def test_warning_names_setting_in_python_and_option_on_command_line(eidrive: Eidrive, tmp_path: Path) -> None:
    reason = "no UserDefinedValueCondition reads the value; none is known here"
    result = run_file("coop/scenario_1", settings=RunSettings(user_values={"mood": "bad"}, time_limit=0.1))
    assert result.warnings == (f"RunSettings.user_values mood: {reason}",)
    words = ("run", "coop/scenario_1", "--user-value", "mood=bad", "--time-limit", "0.1", "--json")
    printed = eidrive(*words, "--out", tmp_path)
    (written,) = tmp_path.rglob("result.json")
    assert json.loads(printed.stdout.splitlines()[0])["warnings"] == [f"--user-value mood: {reason}"]
    assert json.loads(written.read_text(encoding="utf-8"))["warnings"] == [f"--user-value mood: {reason}"]
    assert f"warning: --user-value mood: {reason}" in printed.stderr


def test_diagnostics_of_a_check_name_options_on_screen_and_in_sarif(eidrive: Eidrive, tmp_path: Path) -> None:
    log = tmp_path / "log.sarif"
    result = eidrive("check", "coop/scenario_1", "--planner", "rout", "--sarif", log)
    message = "--planner: unknown planner 'rout'; did you mean 'route'?"
    assert message in result.stdout
    assert "RunSettings" not in log.read_text(encoding="utf-8")
