"""Options `--drive` and `--criterion` of `eidrive run`, and the command that repeats such a run."""

from __future__ import annotations

import json
import shlex
from pathlib import Path

import pytest
from command_fixtures import Eidrive

from eidrive_scenario.experiments.single_run import run_and_save
from eidrive_scenario.recording.recording import read_recording
from eidrive_scenario.simulation import RunSettings


@pytest.mark.process
def test_command_of_a_driven_run_repeats_it(tmp_path: Path, eidrive: Eidrive, passing_by: Path) -> None:
    (tmp_path / "stack.yaml").write_text("target_speed: 7\nrange: 1.0e-05\n")
    settings = RunSettings(
        drive={"Ego": tmp_path / "stack.yaml", "Parked": {"target_speed": 1e-5, "detector": "oracle"}},
        criteria=[{"max_speed": {"of": "Ego", "at_most": 20}}],
    )
    result = run_and_save(passing_by, settings=settings, below=tmp_path / "runs")
    words = shlex.split(result.command)
    assert f"Ego={tmp_path / 'stack.yaml'}" in words
    again = eidrive(*words[1:], "--json", "--no-record")
    found = json.loads(again.stdout.splitlines()[0])
    assert (found["trace_hash"], found["settings_sha256"]) == (result.trace_hash, result.settings.digest)
    assert found["settings"]["drive"] == ["Ego", "Parked"]
    assert result.recording is not None
    metadata = read_recording(result.recording).metadata
    assert json.loads(metadata["drive"]) == {
        "Ego": str(tmp_path / "stack.yaml"),
        "Parked": "{target_speed: 1.0e-05, detector: oracle}",
    }
    assert result.folder is not None
    assert result.folder != run_and_save(passing_by, below=tmp_path / "runs").folder


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--drive", "Ego="), "--drive: no entity or stack is given (got 'Ego='); expected NAME, NAME=FILE.yaml or"),
        (("--drive", "={planner: route}"), "--drive: no entity or stack is given"),
        (("--drive", "Ego", "--drive", "Ego={range: 5}"), "--drive: entity 'Ego' is given twice"),
        (
            ("--drive", "Ego=no_such_stack.yaml"),
            "--drive Ego: no file 'no_such_stack.yaml'; give the path of a YAML file, or a mapping",
        ),
        (("--drive", "Ego={planner: }}"), "--drive Ego:1: not valid YAML"),
        (("--drive", "Ego={planner: rout}"), "--drive Ego: unknown planner 'rout'; did you mean 'route'?"),
        (("--criterion", "c.yaml"), "--criterion: no file 'c.yaml'"),
    ],
)
def test_invalid_option_ends_with_exit_code_2(
    eidrive: Eidrive, passing_by: Path, options: tuple[str, ...], message: str
) -> None:
    result = eidrive("run", passing_by, "--no-record", *options)
    assert result.exit_code == 2
    assert message in result.output


def test_output_does_not_overwrite_a_stack(eidrive: Eidrive, passing_by: Path, tmp_path: Path) -> None:
    (tmp_path / "s.yaml").write_text("planner: route\n")
    result = eidrive("run", passing_by, "--drive", f"Ego={tmp_path}/s.yaml", "--csv", tmp_path / "s.yaml")
    assert result.exit_code == 2
    assert "--csv would overwrite an input file" in result.output
    assert (tmp_path / "s.yaml").read_text() == "planner: route\n"
