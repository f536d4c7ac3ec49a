"""Tests of a success rate: option, marker, report, and the option of `eidrive run`."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import pytest
from command_fixtures import Eidrive, eidrive, passing_by

from eidrive_scenario.experiments.statistics.sequential import Decision, success_rate
from eidrive_scenario.experiments.success_rate import decide_rate

pytest_plugins = ["pytester"]
__all__ = ["eidrive", "passing_by"]

pytestmark = pytest.mark.timeout(600)

PASSING_BY = Path(__file__).parents[2] / "data" / "passing_by.xosc"
TEXT = """
import pytest
from eidrive_scenario.api.run import success_rate

@pytest.mark.scenario("drives/first", success_rate=success_rate(at_least=0.5, expected=0.9))
def test_rate(run_scenario):
    verdict = run_scenario()
    assert verdict.passed
    assert verdict.rate.trials == 6

@pytest.mark.scenario("drives/first", success_rate=0.5)
def test_default(run_scenario):
    assert run_scenario().rate.trials == 8

@pytest.mark.scenario("drives/first", success_rate=success_rate(at_least=0.5, limit=4))
def test_undecided(run_scenario):
    assert run_scenario().passed

@pytest.mark.scenario("drives/first", success_rate=0.5)
def test_failing(run_scenario):
    assert run_scenario(parameters={"OtherY": "0"}).passed
"""


@pytest.fixture
def project(pytester: pytest.Pytester) -> pytest.Pytester:
    shutil.copy(PASSING_BY, pytester.mkdir("drives") / "first.xosc")
    return pytester


def result_of(seed: int, failed: set[int]) -> Any:
    return SimpleNamespace(passed=seed not in failed, seed=seed, exit_code=int(seed in failed))


def test_decide_rate_runs_consecutive_seeds_until_decision() -> None:
    """At least 0.5 against 0.9: six passed runs suffice, and each failure requires three more."""
    seeds: list[int] = []

    def run(seed: int) -> Any:
        seeds.append(seed)
        return result_of(seed, {2})

    verdict = decide_rate(run, success_rate(0.5, expected=0.9))
    assert verdict.decision is Decision.PASSED
    assert [failure.seed for failure in verdict.failures] == [2]
    assert seeds == list(range(1, 1 + verdict.rate.trials))
    # (t - 1) ln(0.5 / 0.9) + ln(0.5 / 0.1) <= -ln 19
    assert verdict.rate.trials == 9


def test_decide_rate_of_failing_runs_fails() -> None:
    verdict = decide_rate(lambda seed: result_of(seed, set(range(99))), success_rate(0.5, expected=0.9))
    assert (verdict.decision, verdict.rate.trials) == (Decision.FAILED, 2)
    assert not verdict.passed


def test_decide_rate_passes_errors_of_runs() -> None:
    def run(seed: int) -> Any:
        raise RuntimeError("broken")

    with pytest.raises(RuntimeError, match="broken"):
        decide_rate(run, success_rate(0.5))


@pytest.mark.process
def test_marker_decides_rate_over_seeds(project: pytest.Pytester) -> None:
    """A test that is not decided at its limit fails, and the report lists the first failed runs with their commands."""
    project.makepyfile(test_rates=TEXT)
    done = project.runpytest_inprocess("test_rates.py", "-v", "-p", "no:cacheprovider", "--junitxml", "junit.xml")
    done.assert_outcomes(passed=2, failed=2)
    done.stdout.fnmatch_lines(
        [
            "*test_rate?drives/first-rate=0.5? PASSED*",
            "*with a confidence of 95%: undecided (4 of 4 runs passed*",
            "*with a confidence of 95%: failed (0 of * runs passed*",
            "*reproduce: eidrive run*OtherY=0*--seed 1*",
        ]
    )
    cases = {str(case.get("name")): case for case in ElementTree.parse(project.path / "junit.xml").iter("testcase")}
    entries = {
        str(entry.get("name")): entry.get("value")
        for entry in cases["test_rate[drives/first-rate=0.5]"].iter("property")
    }
    assert entries["success_rate.decision"] == "passed"
    assert (entries["success_rate.runs"], entries["success_rate.passed_runs"]) == ("6", "6")


def test_option_applies_to_scenario_files(project: pytest.Pytester) -> None:
    done = project.runpytest_inprocess("drives", "-v", "-p", "no:cacheprovider", "--eidrive-success-rate", "0.5")
    done.assert_outcomes(passed=1)
    done.stdout.fnmatch_lines(["*first?rate=0.5?*PASSED*"])


def test_rate_of_runs_that_reach_their_time_limit_is_an_error(project: pytest.Pytester) -> None:
    """As in `eidrive run --success-rate`, such a run has no verdict; a test in Python fails in place of an error."""
    project.makepyfile(test_rates=TEXT)
    options = ("--eidrive-success-rate", "0.5", "--eidrive-time-limit", "0.5", "-p", "no:cacheprovider")
    done = project.runpytest_inprocess("drives", "test_rates.py", "-k", "first.xosc or test_default", *options)
    done.assert_outcomes(errors=1, failed=1)
    done.stdout.fnmatch_lines(["seed 1: ended by its time limit after 0.50 s", "reproduce: eidrive run*--seed 1*"])


@pytest.mark.process
@pytest.mark.parametrize(
    ("argument", "expected"),
    [
        ("success_rate=2", "not a rate"),
        ("success_rate=1.5", "rates"),
        ("success_rate=0.5, seeds=3", "exclude"),
        ("success_rate=success_rate(at_least=0.5), seeds=3", "exclude"),
    ],
)
def test_invalid_marker_is_an_error(project: pytest.Pytester, argument: str, expected: str) -> None:
    text = (
        "import pytest\nfrom eidrive_scenario.api.run import success_rate\n"
        f'@pytest.mark.scenario("drives/first", {argument})\ndef test_rate(run_scenario):\n    pass\n'
    )
    project.makepyfile(test_rates=text)
    done = project.runpytest_inprocess("test_rates.py", "-p", "no:cacheprovider")
    assert done.ret != 0
    done.stdout.fnmatch_lines([f"*{expected}*"])


def test_invalid_option_is_a_usage_error(project: pytest.Pytester) -> None:
    done = project.runpytest_inprocess("drives", "--eidrive-success-rate", "1.5")
    assert done.ret == pytest.ExitCode.USAGE_ERROR


@pytest.mark.parametrize("place", ["command line", "ini file"])
def test_seeds_beside_success_rate_are_a_usage_error(project: pytest.Pytester, place: str) -> None:
    if place == "ini file":
        project.makeini("[pytest]\neidrive_seeds = 3\neidrive_success_rate = 0.9\n")
        done = project.runpytest_inprocess("drives")
    else:
        done = project.runpytest_inprocess("drives", "--eidrive-seeds", "3", "--eidrive-success-rate", "0.9")
    assert done.ret == pytest.ExitCode.USAGE_ERROR
    done.stderr.fnmatch_lines(["*eidrive*seeds and *eidrive*success?rate exclude each other*"])


def test_seeds_on_command_line_replace_success_rate_of_marker(project: pytest.Pytester) -> None:
    """The command line takes precedence over a marker, and a marker over the ini file."""
    project.makeini("[pytest]\neidrive_success_rate = 0.9\n")
    project.makepyfile(test_rates=TEXT)
    done = project.runpytest_inprocess("test_rates.py", "-k", "default", "--eidrive-seeds", "2", "--collect-only", "-q")
    assert done.outlines[:2] == [f"test_rates.py::test_default[drives/first-seed={seed}]" for seed in (1, 2)]


def test_run_command_ends_at_decision(eidrive: Eidrive, passing_by: Path) -> None:
    done = eidrive("run", passing_by, "--no-record", "--success-rate", 0.5)
    assert done.exit_code == 0
    assert "passed (8 of 8 runs passed" in done.stdout.splitlines()[-1]


def test_run_command_fails_or_is_undecided(eidrive: Eidrive, passing_by: Path) -> None:
    done = eidrive("run", passing_by, "--success-rate", 0.5, "--repeat", 3)
    assert done.exit_code == 1
    assert "undecided (3 of 3 runs passed" in done.stdout.splitlines()[-1]
    done = eidrive("run", passing_by, "--success-rate", 0.5, "--param", "OtherY=0", "--json")
    assert done.exit_code == 1
    last = json.loads(done.stdout.splitlines()[-1])["success_rate"]
    assert (last["decision"], last["passed"]) == ("failed", 0)


@pytest.mark.parametrize("options", [("--success-rate", "1"), ("--success-rate", "0.9", "--confidence", "0.5")])
def test_run_command_with_invalid_rate_is_error(eidrive: Eidrive, passing_by: Path, options: tuple[str, ...]) -> None:
    done = eidrive("run", passing_by, *options)
    assert done.exit_code == 2
    assert "give a" in done.stderr
