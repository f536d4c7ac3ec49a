"""Command `eidrive judge`."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from command_fixtures import Eidrive


@pytest.mark.parametrize(("other_y", "code"), [("5", 0), ("0", 1)])
def test_judge_prints_criteria_of_run_with_its_exit_code(
    eidrive: Eidrive, passing_by: Path, tmp_path: Path, other_y: str, code: int
) -> None:
    run = eidrive("run", passing_by, "--param", f"OtherY={other_y}", "--out", tmp_path, "--json")
    judged = eidrive("judge", tmp_path, "--json")
    assert run.exit_code == judged.exit_code == code
    first, second = json.loads(run.stdout), json.loads(judged.stdout)
    for key in ("seed", "passed", "end_reason", "criteria", "simulated_s"):
        assert first[key] == second[key]
    shown = eidrive("judge", tmp_path).stdout
    assert all(verdict["reason"] in shown for verdict in first["criteria"])


def test_judge_of_several_recordings_prints_one_table(eidrive: Eidrive, passing_by: Path, tmp_path: Path) -> None:
    """The folder of all runs has the recordings of both folders; the exit code is the highest one."""
    folders = [tmp_path / "runs" / other_y for other_y in ("5", "0")]
    for folder in folders:
        eidrive("run", passing_by, "--param", f"OtherY={folder.name}", "--out", folder)
    for words in (sorted(folders), [tmp_path / "runs"]):
        judged = eidrive("judge", *words)
        heading, collided, passed, summary = judged.stdout.splitlines()
        assert ("min_distance" in heading, judged.exit_code) == (True, 1)
        assert (str(folders[1]) in collided, "failed" in collided) == (True, True)
        assert (str(folders[0]) in passed, "failed" in passed) == (True, False)
        assert summary == "2 recordings: 1 failed, 1 passed"
    objects = map(json.loads, eidrive("judge", *folders, "--json").stdout.splitlines())
    assert [judgement["passed"] for judgement in objects] == [True, False]


def test_judged_scenario_has_the_name_of_its_run(eidrive: Eidrive, tmp_path: Path) -> None:
    """`coop` and `pipeline` have scenarios of equal file names."""
    run = eidrive("run", "pipeline/scenario_1", "--time-limit", "0.5", "--out", tmp_path, "--json")
    judged = eidrive("judge", tmp_path, "--json")
    assert json.loads(run.stdout)["scenario"] == json.loads(judged.stdout)["scenario"] == "pipeline/scenario_1"


def test_judge_with_other_criterion_fails(eidrive: Eidrive, passing_by: Path, tmp_path: Path) -> None:
    eidrive("run", passing_by, "--out", tmp_path)
    (tmp_path / "slow.yaml").write_text("max_speed: {of: Ego, at_most: 5}\n")
    judged = eidrive("judge", tmp_path, "--criterion", tmp_path / "slow.yaml")
    assert judged.exit_code == 1
    assert "max_speed" in judged.stdout
    assert "min_distance" not in judged.stdout


def test_criteria_of_judge_refer_to_parameters_of_the_run(eidrive: Eidrive, passing_by: Path, tmp_path: Path) -> None:
    """As those of `eidrive run`."""
    criterion = "{max_speed: {of: Ego, at_most: '${2 * $OtherY}'}}"
    run = eidrive("run", passing_by, "--param", "OtherY=4.5", "--criterion", criterion, "--out", tmp_path, "--json")
    judged = eidrive("judge", tmp_path, "--criterion", criterion, "--json")
    speed = json.loads(run.stdout)["criteria"][-1]
    assert (speed["name"], speed["limit"]) == ("max_speed", 9.0)
    assert json.loads(judged.stdout)["criteria"] == [speed]
    unknown = eidrive("judge", tmp_path, "--criterion", "{max_speed: {of: Ego, at_most: $OtherX}}")
    assert (unknown.exit_code, "OtherX" in unknown.stderr) == (2, True)


def test_judge_of_damaged_recording_has_exit_code_three(eidrive: Eidrive, passing_by: Path, tmp_path: Path) -> None:
    eidrive("run", passing_by, "--out", tmp_path)
    (path,) = tmp_path.glob("*/recording.mcap")
    path.write_bytes(path.read_bytes()[:-3000])
    judged = eidrive("judge", path)
    assert judged.exit_code == 3
    assert "incomplete or damaged" in judged.stdout
    assert "warning: the recording is damaged: " in judged.stderr


@pytest.mark.parametrize("content", [b"", b"not a recording"])
def test_judge_of_other_file_has_exit_code_two(eidrive: Eidrive, tmp_path: Path, content: bytes) -> None:
    (tmp_path / "x.mcap").write_bytes(content)
    judged = eidrive("judge", tmp_path / "x.mcap")
    assert judged.exit_code == 2
    assert "x.mcap: not an MCAP file" in judged.stderr
