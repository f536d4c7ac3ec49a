"""Judgement of recordings: verdicts equal to those of the run, other criteria, and recordings that lack something."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import msgspec
import pytest
from criteria_values import CRITERIA
from scenario_1 import ONE

from eidrive_scenario.errors import InputError, SettingError
from eidrive_scenario.evaluation.criteria_parser import CRITERION, declaration_text, declare_criteria, parse_criteria
from eidrive_scenario.experiments.judgement import INCOMPLETE, judge_recording
from eidrive_scenario.experiments.single_run import run_and_save
from eidrive_scenario.files.atomic import partial_path
from eidrive_scenario.recording.frame import ExecutedCommand
from eidrive_scenario.recording.recorder import Recorder
from eidrive_scenario.recording.recording import open_recording, read_recording
from eidrive_scenario.recording.run_files import RECORDING
from eidrive_scenario.simulation import RunResult, RunSettings
from eidrive_scenario.simulation.recorded_outcome import CONTEXT, OUTCOME, recorded_outcome

PASSING_BY = Path(__file__).parents[2] / "data" / "passing_by.xosc"
STORY = """<Story name="s"><Act name="a"><ManeuverGroup name="g" maximumExecutionCount="1">
<Actors selectTriggeringEntities="false"/><Maneuver name="m"><Event name="e" priority="parallel"><Action name="c">
<UserDefinedAction><CustomCommandAction type="{type}">{content}</CustomCommandAction></UserDefinedAction></Action>
<StartTrigger><ConditionGroup><Condition name="start" delay="0" conditionEdge="none"><ByValueCondition>
<SimulationTimeCondition value="1" rule="greaterOrEqual"/></ByValueCondition></Condition></ConditionGroup>
</StartTrigger></Event></Maneuver></ManeuverGroup><StartTrigger/></Act></Story><StopTrigger>"""


def with_command(folder: Path, kind: str, content: str) -> Path:
    """Write the scenario with a command after 1 s."""
    path = folder / "command.xosc"
    story = STORY.format(type=kind, content=content)
    path.write_text(PASSING_BY.read_text(encoding="utf-8").replace("<StopTrigger>", story), encoding="utf-8")
    return path


def check_equal(result: RunResult) -> None:
    """Compare verdicts, exit code and end of a judgement with those of the run."""
    assert result.recording is not None
    judgement = judge_recording(result.recording)
    assert [repr(verdict) for verdict in judgement.criteria] == [repr(verdict) for verdict in result.criteria]
    assert (judgement.exit_code, judgement.end_reason) == (result.exit_code, result.end_reason)
    assert judgement.metrics.items() <= result.metrics.items()
    assert judgement.warnings == ()


@pytest.mark.parametrize(("other_y", "code"), [("5", 0), ("0", 1), ("2.5", 1)])
def test_judgement_equals_verdicts_of_run(tmp_path: Path, other_y: str, code: int) -> None:
    result = run_and_save(PASSING_BY, settings=RunSettings(parameters={"OtherY": other_y}), out=tmp_path)
    assert result.exit_code == code
    check_equal(result)


def test_judgement_of_run_at_time_limit_has_its_exit_code(tmp_path: Path) -> None:
    result = run_and_save(PASSING_BY, settings=RunSettings(time_limit=1.0), out=tmp_path)
    assert (result.exit_code, result.end_reason) == (3, "time limit")
    check_equal(result)


def test_judgement_includes_criteria_of_events_from_their_start(tmp_path: Path) -> None:
    """The ego drives 10 m/s for 3 s; the late criterion measures the last two of them."""
    path = with_command(tmp_path, "eidrive.criterion", "driven_distance: {of: Ego, at_least: 25}")
    result = run_and_save(
        path, settings=RunSettings(criteria={"driven_distance": {"of": "Ego", "at_least": 1}}), out=tmp_path / "run"
    )
    values = {verdict.name: verdict.value for verdict in result.criteria}
    assert values["driven_distance"] == pytest.approx(30.0)
    assert values["driven_distance_2"] == pytest.approx(20.0, abs=0.6)
    check_equal(result)


@pytest.mark.parametrize("kind", ["exitSuccess", "exitFailure"])
def test_judgement_includes_verdict_of_exit_command(tmp_path: Path, kind: str) -> None:
    result = run_and_save(with_command(tmp_path, kind, "reason of the exit"), out=tmp_path / "run")
    assert result.end_reason == f"command: {kind}"
    check_equal(result)


def test_judgement_with_link_statistics_equals_verdicts_of_run(tmp_path: Path) -> None:
    criteria = ["{channel_busy_ratio: {at_most: 1}}", "{packet_reception_ratio: {receiver: Ego, at_least: 0.1}}"]
    settings = RunSettings(channel="80211p_urban", criteria=criteria, time_limit=3.0)
    result = run_and_save(ONE, settings=settings, out=tmp_path)
    busy = next(verdict for verdict in result.criteria if verdict.name == "channel_busy_ratio")
    assert busy.value is not None
    assert busy.value > 0.0
    check_equal(result)


def test_other_criteria_replace_those_of_the_run(tmp_path: Path) -> None:
    run_and_save(PASSING_BY, out=tmp_path)
    judgement = judge_recording(tmp_path, {"max_speed": {"of": "Ego", "at_most": 9.0}})
    (verdict,) = judgement.criteria
    assert (verdict.name, verdict.passed) == ("max_speed", False)
    assert verdict.value == pytest.approx(10.0)
    assert judgement.exit_code == 1


@pytest.mark.parametrize("strict", ["true", "false", "1", "0"])
def test_other_criteria_use_truth_values_and_texts_of_the_run(tmp_path: Path, strict: str) -> None:
    """The run lasts 3 s. A text remains one if it is that of a truth value."""
    declared = (
        '<ParameterDeclaration name="Strict" parameterType="boolean" value="true"/>'
        f'<ParameterDeclaration name="Label" parameterType="string" value="{strict}"/></ParameterDeclarations>'
    )
    path = tmp_path / "strict.xosc"
    text = PASSING_BY.read_text(encoding="utf-8").replace("</ParameterDeclarations>", declared)
    path.write_text(text, encoding="utf-8")
    criterion = '{time_limit: {within: "${4 - 2 * (not $Strict)}", fatal: $Strict, name: $Label}}'
    result = run_and_save(
        path, settings=RunSettings(parameters={"Strict": strict}, criteria=criterion), out=tmp_path / "run"
    )
    (of_run,) = [verdict for verdict in result.criteria if verdict.name == strict]
    (judged,) = judge_recording(tmp_path / "run", criterion).criteria
    assert repr(judged) == repr(of_run)
    assert (judged.passed, judged.limit) == ((True, 4.0) if strict in ("true", "1") else (False, 2.0))


@pytest.mark.parametrize(
    ("criterion", "message"),
    [
        ("{max_speed: {of: Egg, at_most: 9}}", "unknown entity 'Egg'; did you mean 'Ego'"),
        ("{monitor: {of: Seen}}", "unknown monitor 'Seen'"),
        ("{keep_lane: {of: Ego}}", "requires roads"),
        ("{max_sped: {of: Ego}}", "did you mean 'max_speed'"),
        ("{route_completion: {of: Ego, at_least: 1}}", "the scenario requests none"),
    ],
)
def test_other_criteria_with_errors_raise_setting_error(tmp_path: Path, criterion: str, message: str) -> None:
    run_and_save(PASSING_BY, out=tmp_path)
    with pytest.raises(SettingError, match=message):
        judge_recording(tmp_path, criterion)


@pytest.mark.parametrize("kind", sorted(CRITERIA))
def test_declaration_text_is_read_as_equal_declaration(kind: str) -> None:
    (declaration,) = declare_criteria({kind: dict(CRITERIA[kind])}, {})
    (again,) = parse_criteria(declaration_text(declaration, "Käfer: {1}"))
    assert again.settings.model_dump() == declaration.settings.model_dump() | {"name": "Käfer: {1}"}
    assert again.criterion_type is declaration.criterion_type


def rewritten(path: Path, out: Path, **metadata: str) -> Path:
    """Write the frames of a recording again without its outcome, and with changed metadata."""
    recording = read_recording(path)
    attachments = {name: data for name, data in recording.attachments.items() if name != OUTCOME}
    recorder = Recorder(out, metadata={**recording.metadata, **metadata}, attachments=attachments)
    for frame in recording.frames():
        recorder.observe(frame)
    recorder.close()
    return out


def test_recording_without_outcome_is_incomplete(tmp_path: Path) -> None:
    result = run_and_save(PASSING_BY, out=tmp_path)
    assert result.recording is not None
    judgement = judge_recording(rewritten(result.recording, tmp_path / "again.mcap"))
    assert [repr(verdict) for verdict in judgement.criteria] == [repr(verdict) for verdict in result.criteria]
    assert (judgement.end_reason, judgement.exit_code) == (INCOMPLETE, 3)
    with pytest.raises(SettingError, match="criterion 'channel_busy_ratio' requires link statistics"):
        judge_recording(tmp_path / "again.mcap", "{channel_busy_ratio: {at_most: 1}}")


def test_recording_of_former_format_requires_criteria(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "old.mcap", metadata={"format": "2", "eidrive-scenario": "0.1.0"})
    run_and_save(PASSING_BY, out=tmp_path / "run")
    for frame in read_recording(tmp_path / "run").frames():
        recorder.observe(frame)
    recorder.close()
    with pytest.raises(SettingError, match=r"contains no criteria \(written by version 0\.1\.0\); give criteria"):
        judge_recording(tmp_path / "old.mcap")
    assert judge_recording(tmp_path / "old.mcap", "{max_speed: {of: Ego, at_most: 11}}").criteria[0].passed


def test_invalid_outcome_raises_input_error(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "r.mcap", metadata={}, attachments={OUTCOME: b'{"passed": 1}'})
    recorder.close()
    with pytest.raises(InputError, match=r"outcome\.json cannot be decoded"):
        recorded_outcome(open_recording(tmp_path / "r.mcap"))


def test_recording_without_frames_raises_setting_error(tmp_path: Path) -> None:
    Recorder(tmp_path / "r.mcap", metadata={}).close()
    with pytest.raises(InputError, match="contains no readable frame"):
        judge_recording(tmp_path / "r.mcap", "{time_limit: {within: 3}}")


def test_damaged_roads_of_recording_are_named_with_its_path(tmp_path: Path) -> None:
    Recorder(tmp_path / "r.mcap", metadata={}, attachments={"road.xodr": b"<OpenDRIVE>"}).close()
    with pytest.raises(InputError, match=r"r\.mcap/road\.xodr:1: not well-formed"):
        judge_recording(tmp_path / "r.mcap", "{time_limit: {within: 3}}")


def test_equal_runs_give_equal_recordings_with_outcome(tmp_path: Path) -> None:
    files = [run_and_save(PASSING_BY, out=tmp_path / name).recording for name in ("a", "b")]
    assert len({path.read_bytes() for path in files if path is not None}) == 1


def test_differing_verdict_is_a_warning(tmp_path: Path) -> None:
    """An attached outcome with another limit stands for a criterion that has changed since the run."""
    result = run_and_save(PASSING_BY, out=tmp_path)
    assert result.recording is not None
    recording = read_recording(result.recording)
    outcome = json.loads(recording.attachments[OUTCOME])
    outcome["criteria"][1]["limit"] = 2.0
    changed = {**recording.attachments, OUTCOME: json.dumps(outcome).encode()}
    recorder = Recorder(tmp_path / "changed.mcap", metadata=recording.metadata, attachments=changed)
    for frame in recording.frames():
        recorder.observe(frame)
    recorder.close()
    (warning,) = judge_recording(tmp_path / "changed.mcap").warnings
    assert warning.startswith("verdict 'min_distance' differs from that of the run")


def test_unknown_criterion_of_the_run_is_reported_with_its_command(tmp_path: Path) -> None:
    command = "eidrive --project demo run cut_in.xosc --seed 1"
    recorder = Recorder(tmp_path / "r.mcap", metadata={CONTEXT: "{}", "command": command})
    result = run_and_save(PASSING_BY, out=tmp_path / "run")
    assert result.recording is not None
    for frame in read_recording(result.recording).frames():
        recorder.observe(msgspec.structs.replace(frame, commands=(ExecutedCommand(CRITERION, "keep_gap: {}", 0.0),)))
    recorder.close()
    hint = f"judge it with the extensions of {command}, or with other criteria (RunSettings.criteria)"
    with pytest.raises(SettingError) as caught:
        judge_recording(tmp_path / "r.mcap")
    assert str(caught.value) == f"{tmp_path / 'r.mcap'}: unknown criterion 'keep_gap'; {hint}"


@pytest.fixture
def killed_run(tmp_path: Path) -> Callable[[], Path]:
    """Return a function that kills a run of the command line as soon as its recording has frames."""

    def run() -> Path:
        path = tmp_path / "endless.xosc"
        path.write_text(PASSING_BY.read_text(encoding="utf-8").replace('value="3.0"', 'value="100000"'))
        words = ["run", str(path), "--out", str(tmp_path / "out"), "--time-limit", "100000"]
        process = subprocess.Popen([sys.executable, "-m", "eidrive_scenario", *words], stdout=subprocess.DEVNULL)
        try:
            for _ in range(600):
                time.sleep(0.1)
                found = list((tmp_path / "out").glob(f"*/{partial_path(Path(RECORDING)).name}"))
                if found and found[0].stat().st_size > 50_000:
                    break
        finally:
            os.kill(process.pid, signal.SIGKILL)
            process.wait()
        return tmp_path / "out"

    return run


def test_judgement_of_killed_run_covers_its_recorded_frames(killed_run: Callable[[], Path]) -> None:
    judgement = judge_recording(killed_run(), "{min_distance: {of: Ego, to: Parked, at_least: 3, measure: center}}")
    assert judgement.exit_code == 3
    assert judgement.end_reason == INCOMPLETE
    assert judgement.simulated_s > 3.0
    assert judgement.criteria[0].value == pytest.approx(5.0)
    assert any("the run did not end" in line for line in judgement.warnings)
