"""Wall limit of `eidrive check`, and extensions that hang or end the process."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from faulty_extensions import install, line_of, write_scenario
from typer.testing import CliRunner

from eidrive_scenario.cli import app
from eidrive_scenario.extensions.library import library_path

pytestmark = pytest.mark.timeout(600)
"""Hanging checks take their limit and the grace time, and several processes load the engine."""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a folder with the faulty extensions and a valid scenario."""
    install(tmp_path)
    write_scenario(tmp_path / "z_right.xosc")
    return tmp_path


def check(folder: Path, *arguments: str) -> tuple[int, str, str]:
    done = subprocess.run(
        [sys.executable, "-m", "eidrive_scenario", "check", *arguments],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(folder)},
        capture_output=True,
        text=True,
        check=False,
    )
    return done.returncode, done.stdout, done.stderr


@pytest.mark.exhaustive
def test_check_beyond_wall_limit_exits_with_3_and_reports_each_file(folder: Path) -> None:
    """No file is checked within a microsecond."""
    names = ("coop/scenario_1", "coop/scenario_2")
    code, out, err = check(folder, *names, "--wall-limit", "1e-6")
    assert code == 3
    for name in names:
        path = re.escape(str(library_path() / f"{name}.xosc"))
        assert re.search(rf"^{path}: check aborted: .*not finished after 1e-06 s of wall time", err, re.MULTILINE), err
    assert out == "2 files, 0 errors, 0 warnings\n"


@pytest.mark.exhaustive
def test_check_within_wall_limit_has_unchanged_output(folder: Path) -> None:
    assert check(folder, "coop/scenario_1", "--wall-limit", "600") == check(folder, "coop/scenario_1")


@pytest.mark.exhaustive
def test_check_hanging_extension_is_reported_and_other_files_checked(folder: Path) -> None:
    write_scenario(folder / "hangs.xosc", detector="hangs_when_built")
    code, out, err = check(folder, "hangs.xosc", "z_right.xosc", "--wall-limit", "10")
    assert code == 3
    assert "hangs.xosc: check aborted: " in err
    assert "detector 'hangs_when_built' (faulty:HangsWhenBuilt)" in err
    assert "still running in __init__ after 10 s of wall time" in err
    assert "z_right.xosc" not in err
    assert out.splitlines()[-1] == "2 files, 0 errors, 1 warning"
    assert "no criterion demands" in out


@pytest.mark.exhaustive
def test_check_hanging_native_code_exits_with_3(folder: Path) -> None:
    write_scenario(folder / "hangs.xosc", detector="hangs_in_c_when_built")
    code, _, err = check(folder, "hangs.xosc", "--wall-limit", "6", "--sarif", "check.sarif")
    assert code == 3
    detector = f"{folder / 'faulty.py'}:{line_of('in __init__')}: detector 'hangs_in_c_when_built'"
    assert err.startswith("check aborted: ")
    assert f"{detector} (faulty:HangsInCWhenBuilt): still running in __init__ after 6 s of wall time" in err
    (invocation,) = json.loads((folder / "check.sarif").read_text())["runs"][0]["invocations"]
    (aborted,) = invocation["toolExecutionNotifications"]
    assert (invocation["executionSuccessful"], "still running" in aborted["message"]["text"]) == (False, True)


@pytest.mark.exhaustive
def test_killed_check_process_replaces_the_sarif_log_of_an_earlier_check(folder: Path) -> None:
    write_scenario(folder / "killed.xosc", detector="kills_process_when_built")
    (folder / "check.sarif").write_text("{}")
    code, _, err = check(folder, "killed.xosc", "--wall-limit", "600", "--sarif", "check.sarif")
    assert (code, err) == (3, "check aborted: its process was ended by SIGKILL\n")
    (invocation,) = json.loads((folder / "check.sarif").read_text())["runs"][0]["invocations"]
    assert not invocation["executionSuccessful"]


@pytest.mark.exhaustive
def test_check_exiting_extension_is_reported_and_other_files_checked(folder: Path) -> None:
    write_scenario(folder / "exits.xosc", detector="exits_when_built")
    code, out, err = check(folder, "exits.xosc", "z_right.xosc")
    assert code == 3
    assert "exits.xosc: check aborted: " in err
    assert "detector 'exits_when_built' (faulty:ExitsWhenBuilt)" in err
    assert "internal error" not in err
    assert out.splitlines()[-1] == "2 files, 0 errors, 1 warning"


@pytest.mark.parametrize("limit", ["0", "-1", "nan", "inf"])
def test_check_nonpositive_wall_limit_exits_with_2(limit: str) -> None:
    done = CliRunner().invoke(app, ["check", "coop/scenario_1", "--wall-limit", limit])
    assert done.exit_code == 2
    assert "--wall-limit" in done.stderr
