"""Runs that no criterion judges: none of them passes without `--no-criteria`, and each says so on every surface."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from command_fixtures import Eidrive
from lxml import html
from openscenario_xml import round_car_xml, scenario_xml
from storyboard_xml import (
    act_xml,
    acts_xml,
    condition_xml,
    event_xml,
    group_xml,
    maneuver_xml,
    time_xml,
    trigger_xml,
)

from eidrive_scenario.api.run import (
    NOT_JUDGED,
    PASSED,
    RunSettings,
    judge_recording,
    read_results,
    run_and_save,
    run_file,
)
from eidrive_scenario.errors import SimulationError
from eidrive_scenario.experiments.statistics.sequential import success_rate
from eidrive_scenario.experiments.success_rate import decide_rate
from eidrive_scenario.gym.station_interface import Rewards, RewardSettings
from eidrive_scenario.reporting.report_files import report_files

WORDS = "the run is not judged: it has no criterion"
ADDED = "{collision: {of: Ego}}"


@pytest.fixture
def bare(tmp_path: Path, passing_by: Path) -> Path:
    """Return the scenario without its criteria; it ends by its stop trigger at 3 s."""
    text = passing_by.read_text()
    start = text.index("<UserDefinedAction>")
    end = text.index("</UserDefinedAction>") + len("</UserDefinedAction>")
    path = tmp_path / "bare.xosc"
    path.write_text(text[:start] + text[end:])
    return path


def test_result_is_not_passed_and_has_a_warning(bare: Path) -> None:
    result = run_file(bare)
    assert (result.passed, result.exit_code, result.criteria) == (False, NOT_JUDGED, ())
    assert result.end_reason == "stop trigger"
    (warning,) = result.warnings
    assert warning.startswith(WORDS)
    assert "RunSettings.criteria" in warning
    assert "RunSettings.no_criteria" in warning
    assert "not judged (stop trigger at 3.00 s, 1 warning)" in str(result)
    assert "not judged</b>" in result._repr_html_()
    row = result.to_dict()
    assert (row["passed"], row["exit_code"], row["warnings"]) == (False, 4, 1)


def test_accepted_run_passes_with_a_warning(bare: Path) -> None:
    result = run_file(bare, settings=RunSettings(no_criteria=True))
    assert (result.passed, result.exit_code, result.warnings) == (True, PASSED, (WORDS,))
    assert result.trace_hash == run_file(bare).trace_hash


@pytest.mark.parametrize("no_criteria", [True, False])
def test_judged_run_does_not_depend_on_acceptance(passing_by: Path, no_criteria: bool) -> None:
    """With centers 5 m apart both criteria pass; in line with the parked car both fail."""
    for offset, code in (("5", 0), ("0", 1)):
        result = run_file(passing_by, settings=RunSettings(parameters={"OtherY": offset}, no_criteria=no_criteria))
        assert result.exit_code == code
        assert not any(text.startswith(WORDS) for text in result.warnings)


def test_time_limit_outranks_missing_criteria(bare: Path) -> None:
    result = run_file(bare, settings=RunSettings(time_limit=1.0, no_criteria=True))
    assert (result.passed, result.exit_code, result.end_reason) == (False, 3, "time limit")


@pytest.mark.parametrize(("command", "code"), [("exitSuccess", 0), ("exitFailure", 1)])
def test_exit_command_judges_a_run(bare: Path, command: str, code: int) -> None:
    action = f'<UserDefinedAction><CustomCommandAction type="{command}"/></UserDefinedAction>'
    bare.write_text(bare.read_text().replace("<Actions>", f"<Actions>{action}", 1))
    assert run_file(bare).exit_code == code


@pytest.mark.parametrize("limit", [60.0, 1.0])
@pytest.mark.parametrize(("command", "code"), [("exitSuccess", 0), ("exitFailure", 1)])
def test_exit_command_of_the_last_time_step_judges_a_run(command: str, code: int, limit: float) -> None:
    """The storyboard is complete, or the limit is reached, in the time step in which the event executes the command."""
    action = f'<UserDefinedAction><CustomCommandAction type="{command}"/></UserDefinedAction>'
    event = event_xml("Exit", action, trigger_xml(condition_xml(time_xml(1.0, "greaterOrEqual"))))
    waiting = event_xml("Wait", action, trigger_xml(condition_xml(time_xml(9.0, "greaterOrEqual"))))
    story = acts_xml(act_xml(group_xml(maneuver_xml(event if limit > 1.0 else event + waiting))))
    scenario = scenario_xml(entities=round_car_xml("Ego"), story=story, stop="")
    result = run_file(scenario, settings=RunSettings(criteria={"time_limit": {"within": 60}}, time_limit=limit))
    assert (result.exit_code, result.end_reason) == (code, f"command: {command}")


def test_command_exits_with_0_for_accepted_runs_only(eidrive: Eidrive, bare: Path) -> None:
    done = eidrive("run", bare)
    assert done.exit_code == 4
    assert "not judged" in done.stdout
    assert "passed" not in done.stdout
    assert f"warning: {WORDS}" in done.stderr
    accepted = eidrive("run", bare, "--no-criteria")
    assert (accepted.exit_code, WORDS in accepted.stderr) == (0, True)
    assert eidrive("run", bare, "--criterion", ADDED).exit_code == 0


def test_json_has_the_warning(eidrive: Eidrive, bare: Path) -> None:
    for option, code in (([], 4), (["--no-criteria"], 0)):
        done = eidrive("run", bare, "--json", *option)
        found = json.loads(done.stdout)
        assert (done.exit_code, found["passed"], found["criteria"]) == (code, code == 0, [])
        assert found["warnings"][0].startswith(WORDS)
        assert ("--no-criteria" in found["command"]) == (code == 0)


def test_success_rate_is_not_decided(eidrive: Eidrive, bare: Path) -> None:
    done = eidrive("run", bare, "--success-rate", "0.5")
    assert (done.exit_code, "success rate of at least" in done.stdout) == (4, False)
    with pytest.raises(SimulationError, match=WORDS):
        decide_rate(lambda seed: run_file(bare, seed=seed), success_rate(0.5))


def test_judge_states_missing_criteria(eidrive: Eidrive, bare: Path, tmp_path: Path) -> None:
    folder = run_and_save(bare, out=tmp_path / "run").folder
    assert folder is not None
    judgement = judge_recording(folder)
    assert (judgement.passed, judgement.exit_code) == (False, NOT_JUDGED)
    done = eidrive("judge", folder)
    assert (done.exit_code, WORDS in done.stderr, "not judged" in done.stdout) == (4, True, True)
    assert eidrive("judge", folder, "--criterion", ADDED).exit_code == 0


def test_pages_state_missing_criteria(eidrive: Eidrive, bare: Path, passing_by: Path, tmp_path: Path) -> None:
    """Two runs are not judged, one passes: the success rate is that of one run."""
    for seed in (1, 2):
        run_and_save(bare, seed=seed, below=tmp_path / "runs")
    run_and_save(passing_by, below=tmp_path / "runs")
    page: Any = html.fromstring(report_files([tmp_path / "runs"], tmp_path / "report").read_text())
    (lead,) = page.find_class("lead")
    assert lead.text_content() == "3 runs: 1 passed, 2 not judged."
    assert f"2 runs: {WORDS}" in page.text_content()
    cells = [[cell.text_content() for cell in row.findall("td")][2:4] for row in page.iterfind(".//tbody/tr")]
    assert ["not judged", "\N{EN DASH}"] in cells
    assert ["1/1", "0.21 … 1.00"] in cells
    replay = next(path for path in (tmp_path / "report").rglob("*.html") if path.name.startswith("bare"))
    shown: Any = html.fromstring(replay.read_text())
    assert shown.find_class("verdict")[0].text_content() == "not judged"
    assert WORDS in shown.xpath("//div[@id='verdict']")[0].text_content()


@pytest.mark.process
def test_sweep_has_no_verdict(eidrive: Eidrive, bare: Path, tmp_path: Path) -> None:
    store = tmp_path / "s.db"
    options: list[str | Path] = ["--vary", "OtherY=5,6", "--workers", "1", "--store", store]
    done = eidrive("sweep", bare, *options)
    assert done.exit_code == 4
    assert "2 not judged" in done.stdout
    assert f"2 not judged: {WORDS}" in done.stderr
    assert all("by --criterion '{collision" in error for error in read_results(store)["error"])
    (line, _) = eidrive("results", store, "--json").stdout.splitlines()
    assert json.loads(line)["runs"] == {"not judged": 1}
    assert f"not judged: eidrive run {bare}" in eidrive("results", store, "--failures").stdout
    both = eidrive("results", store, "--failures", "--json")
    assert (both.exit_code, "--json and --failures exclude each other" in both.stderr) == (2, True)
    accepted = eidrive("sweep", bare, *options, "--no-criteria")
    assert (accepted.exit_code, "2 passed" in accepted.stdout) == (0, True)
    assert "2 of 2 runs have warnings" in accepted.stderr
    searched = eidrive("sweep", bare, "--find-boundary", "OtherY=0:5", "--workers", "1", "--store", tmp_path / "b.db")
    assert (searched.exit_code, f"no run has a verdict: not judged: {WORDS}" in searched.stderr) == (2, True)


def test_reward_of_unjudged_run_is_neither_that_of_success_nor_of_failure(bare: Path) -> None:
    rewards = Rewards(RewardSettings(passed=5.0, failed=-3.0), "Ego")
    assert rewards.terms_of_end(run_file(bare)) == {"passed": 0.0, "failed": 0.0}
    accepted = run_file(bare, settings=RunSettings(no_criteria=True))
    assert rewards.terms_of_end(accepted) == {"passed": 5.0, "failed": 0.0}
