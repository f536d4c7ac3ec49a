"""Text of a failed run: criterion, value, limit, time, state at the violation, last state, command and recording."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from faulty_extensions import write_scenario

from eidrive_scenario.errors import Diagnostic, InputError
from eidrive_scenario.experiments.single_run import run_and_save
from eidrive_scenario.pytest_plugin.failures import explain, failure_text, line_of_criterion
from eidrive_scenario.simulation import RunSettings

pytest_plugins = ["pytester"]

pytestmark = pytest.mark.timeout(600)

PASSING_BY = Path(__file__).parents[2] / "data" / "passing_by.xosc"


def test_control_characters_in_a_failure_are_escaped() -> None:
    assert failure_text(InputError(Diagnostic("unknown entity 'a\x1b[2J\x9b'"))) == r"unknown entity 'a\u001b[2J\u009b'"


def test_failed_run_is_explained_with_state_and_decision(tmp_path: Path) -> None:
    """A driven vehicle exceeds its speed limit; the stop trigger fires in the first tick after one second."""
    scenario = write_scenario(tmp_path / "a b.xosc", criterion="max_speed: {of: Ego, at_most: 1}", end=1.0)
    text = explain(run_and_save(scenario, seed=2, below=tmp_path / "kept")).splitlines()
    speed = re.match(r"max_speed (\S+) m/s, limit 1 m/s, first violated at 0\.00 s: Ego drove up to ", text[0])
    assert speed is not None
    assert float(speed[1]) == pytest.approx(5.0, abs=0.5)
    assert text[1] == "  first violation at 0.00 s"
    assert re.match(r"  decision of Ego: drive at \d+\.\d m/s, acceleration -?\d+\.\d m/s²: \w+", text[2])
    assert text[3] == "  Ego received no message so far"
    assert text[4] == "a b failed with channel none, seed 2"
    assert text[5] == "storyboard: stopped at 1.05 s: simulation time 1.05 s > 1 s"
    assert text[6].startswith("running events: ")
    assert not any(line.startswith("last decision of ") for line in text)
    assert f"reproduce: eidrive run '{scenario}' --seed 2" in text
    assert Path(text[-1].removeprefix("recording: ")).is_file()


def test_running_event_is_part_of_state(tmp_path: Path) -> None:
    """At the limit of simulated time the storyboard runs, with the event that began at 0.5 s."""
    scenario = write_scenario(tmp_path / "s.xosc", end=9.0, action="sound")
    result = run_and_save(scenario, settings=RunSettings(time_limit=0.75))
    assert result.end_reason == "time limit"
    assert result.final_state[0] == "storyboard: running at 0.75 s"
    assert "ended by its time limit after 0.75 s" in explain(result)


@pytest.mark.process
@pytest.mark.parametrize("workers", [(), ("-n", "1")])
def test_short_summary_contains_reason_at_any_width(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch, workers: tuple[str, ...]
) -> None:
    """pytest shows the message behind the name only as far as the terminal is wide; here the name has 90 columns."""
    monkeypatch.delenv("CI", raising=False)
    name = "a" * 38
    text = PASSING_BY.read_text(encoding="utf-8")
    (pytester.path / f"{name}.xosc").write_text(text.replace('value="5.0"', 'value="0.0"'), encoding="utf-8")
    reason = r"collision 1, limit 0, first violated at 1\.6\d s"
    test = rf"{name}\.xosc::{name}\[seed=1\]"
    for columns, line in ((80, rf"FAILED \({reason}\) {test}"), (200, rf"FAILED {test} - {reason}: Ego and Parked.*")):
        monkeypatch.setenv("COLUMNS", str(columns))
        result = pytester.runpytest_inprocess(f"{name}.xosc", "-p", "no:cacheprovider", *workers)
        (summary,) = [one for one in result.outlines if one.startswith("FAILED")]
        assert re.fullmatch(line, summary)


@pytest.mark.process
def test_command_of_options_reproduces_run(pytester: pytest.Pytester) -> None:
    """The pasted command gives the same verdict in another folder, with every option that needs quotes."""
    folder = pytester.mkdir("it's a folder")
    text = PASSING_BY.read_text(encoding="utf-8")
    (folder / "near by.xosc").write_text(text.replace('value="5.0"', 'value="0.0"'), encoding="utf-8")
    (folder / "late.yaml").write_text("delay: {kind: constant, seconds: 0.2}", encoding="utf-8")
    result = pytester.runpytest_inprocess(
        str(folder),
        *("--eidrive-channel", "it's a folder/late.yaml", "--eidrive-time-limit", "2.5", "-p", "no:cacheprovider"),
        *("--eidrive-criterion", '{max_speed: {of: Ego, at_most: 90, name: "Ego\'s $HOME"}}'),
    )
    result.assert_outcomes(failed=1)
    (command,) = {line.removeprefix("reproduce: ") for line in result.outlines if line.startswith("reproduce: ")}
    words = command.replace("eidrive ", f"{sys.executable} -m eidrive_scenario ", 1)
    again = subprocess.run(["/bin/sh", "-c", f"{words} --json"], cwd="/", capture_output=True, text=True, check=False)
    assert again.returncode == 1, again.stderr
    assert '"time_limit": 2.5' in again.stdout
    assert "Ego's $HOME" in again.stdout
    assert '"seconds": 0.2' in again.stdout


@pytest.mark.process
def test_command_of_scenario_without_file_reproduces_test(pytester: pytest.Pytester) -> None:
    """The pytest command has the options that select and change the run."""
    shutil.copy(PASSING_BY, pytester.path / "scene.xosc")
    pytester.makepyfile(
        **{
            "test_own": """
            import pathlib

            import pytest

            @pytest.mark.parametrize("value", ["0", "it's [0]"])
            def test_object(run_scenario, value):
                source = pathlib.Path("scene.xosc").read_bytes().replace(b'value="5.0"', b'value="0.0"')
                assert run_scenario(source).passed
            """
        }
    )
    options = ["--eidrive-time-limit", "2.5", "--eidrive-criterion", "{max_speed: {of: Ego, at_most: 90}}"]
    options += ["--eidrive-max-runs", "all", "--eidrive-out", "runs", "--eidrive-topics", "foxglove"]
    result = pytester.runpytest_inprocess(*options, "-p", "no:cacheprovider", "-k", "it")
    result.assert_outcomes(failed=1, deselected=1)
    (command,) = {line.removeprefix("reproduce: ") for line in result.outlines if line.startswith("reproduce: ")}
    assert "--eidrive-max-runs all" in command
    assert "--eidrive-topics" not in command
    words = command.replace("pytest ", f"{sys.executable} -m pytest -p no:cacheprovider ", 1)
    again = subprocess.run(["/bin/sh", "-c", words], cwd=pytester.path, capture_output=True, text=True, check=False)
    assert "1 failed" in again.stdout, again.stdout + again.stderr
    assert f"reproduce: {command}" in again.stdout


def test_line_of_criterion_is_that_of_its_declaration(tmp_path: Path) -> None:
    path = tmp_path / "s.xosc"
    path.write_text(
        '<a name="collision"/>\n'
        '<CustomCommandAction type="eidrive.channel">collision</CustomCommandAction>\n'
        '<CustomCommandAction type="eidrive.criterion">\n'
        "  max_speed: {of: Ego, at_most: 9, name: own speed}\n"
        "  collision: {of: Ego}</CustomCommandAction>\n"
        "own\n",
        encoding="utf-8",
    )
    assert line_of_criterion(path, "collision") == 5
    assert line_of_criterion(path, "own speed") == 4
    assert line_of_criterion(path, "own") == 4
    assert line_of_criterion(path, "speed_limit") is None
    assert line_of_criterion(tmp_path / "missing.xosc", "collision") is None
