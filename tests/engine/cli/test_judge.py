"""Command `eidrive judge`."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from command_fixtures import Eidrive

from eidrive_scenario.errors import ExtensionError, ExtensionPlace
from eidrive_scenario.experiments import judgement


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


def test_judge_of_several_recordings_reports_those_that_it_cannot_judge(
    eidrive: Eidrive, passing_by: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One of three is no recording, and a criterion raises an exception for another; the exit code is the highest."""
    for name in "abc":
        eidrive("run", passing_by, "--out", tmp_path / name)
    aborted, bad, good = (path for name in "abc" for path in (tmp_path / name).rglob("recording.mcap"))
    bad.write_bytes(b"not a recording")

    def judge_with_fault(path: Path, criteria: object) -> judgement.Judgement:
        if path == aborted:
            raise ExtensionError(ExtensionPlace("criterion", "gap", "gaps:Gap"), "ValueError: no gap")
        return judge_recording(path, criteria)

    judge_recording = judgement.judge_recording
    monkeypatch.setattr(judgement, "judge_recording", judge_with_fault)
    judged = eidrive("judge", tmp_path)
    heading, *lines, summary = judged.stdout.splitlines()
    assert [line.split()[:3] for line in lines[:2]] == [
        [str(aborted.parent), "aborted"],
        [str(bad.parent), "invalid", "input"],
    ]
    assert (lines[2].startswith(str(good.parent)), "min_distance" in heading) == (True, True)
    assert (summary, judged.exit_code) == ("3 recordings: 1 aborted, 1 invalid input, 1 passed", 3)
    assert f"{aborted}: judgement aborted: criterion 'gap' (gaps:Gap): ValueError: no gap" in judged.stderr
    assert f"{bad}: not an MCAP file" in judged.stderr
    objects = [json.loads(line) for line in eidrive("judge", tmp_path, "--json").stdout.splitlines()]
    assert [(entry["recording"], entry["passed"]) for entry in objects] == [
        (str(aborted), False),
        (str(bad), False),
        (str(good), True),
    ]
    assert objects[0]["error"]["problem"] == "ValueError: no gap"
    assert "not an MCAP file" in objects[1]["error"]["message"]
    assert eidrive("judge", aborted.parent).exit_code == 3


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
