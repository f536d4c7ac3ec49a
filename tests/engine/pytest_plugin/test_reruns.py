"""Repeated attempts of pytest-rerunfailures: each one runs the scenario again."""

from __future__ import annotations

import shutil
from pathlib import Path
from xml.etree import ElementTree

import pytest
from faulty_extensions import install, write_scenario

pytest_plugins = ["pytester"]
pytest.importorskip("pytest_rerunfailures")

pytestmark = pytest.mark.timeout(600)

PASSING_BY = Path(__file__).parents[2] / "data" / "passing_by.xosc"
MENDS = """
import shutil
from pathlib import Path

def pytest_runtest_teardown(item):
    root = Path(item.config.rootpath)
    with (root / "attempts.txt").open("a") as attempts:
        attempts.write("x")
    if len((root / "attempts.txt").read_text()) == 2:
        shutil.copy(root / "good", root / "drives" / "first.xosc")
"""


@pytest.mark.process
@pytest.mark.parametrize("broken", [('value="5.0"', 'value="0.0"'), ('"step"', '"stp"')])
def test_rerun_reads_and_runs_scenario_again(pytester: pytest.Pytester, broken: tuple[str, str]) -> None:
    """The scenario is corrected after the second attempt; failures and errors are both repeated."""
    text = PASSING_BY.read_text(encoding="utf-8")
    shutil.copy(PASSING_BY, pytester.path / "good")
    (pytester.mkdir("drives") / "first.xosc").write_text(text.replace(*broken), encoding="utf-8")
    pytester.makeconftest(MENDS)
    arguments = ("drives", "--reruns", "3", "--junitxml", "junit.xml", "-p", "no:cacheprovider")
    outcomes = pytester.runpytest_inprocess(*arguments).parseoutcomes()
    assert (outcomes["rerun"], outcomes["passed"], outcomes.get("failed", 0)) == (2, 1, 0)
    case = list(ElementTree.parse(pytester.path / "junit.xml").iter("testcase"))[-1]
    names = [entry.get("name") for entry in case.iter("property")]
    assert names.count("trace_hash") == 1
    assert {entry.get("name"): entry.get("value") for entry in case.iter("property")}["min_distance.passed"] == "True"


@pytest.mark.process
def test_rerun_of_python_test_reports_last_attempt(pytester: pytest.Pytester) -> None:
    shutil.copy(PASSING_BY, pytester.path / "scene.xosc")
    pytester.makepyfile(
        """
        attempts = []

        def test_own(run_scenario):
            attempts.append(None)
            result = run_scenario("scene.xosc", seed=len(attempts), parameters={"OtherY": "0"})
            assert result.passed
        """
    )
    arguments = ("--reruns", "2", "--junitxml", "junit.xml", "-p", "no:cacheprovider")
    result = pytester.runpytest_inprocess(*arguments)
    assert result.parseoutcomes() == {"failed": 1, "rerun": 2}
    case = list(ElementTree.parse(pytester.path / "junit.xml").iter("testcase"))[-1]
    assert [entry.get("value") for entry in case.iter("property") if entry.get("name") == "seed"] == ["3"]
    assert "failed with channel none, seed 3" in (result.stdout.str())
    assert "failed with channel none, seed 2" not in result.stdout.str()


@pytest.mark.process
def test_killed_worker_with_reruns_does_not_affect_other_runs(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHONPATH", str(install(pytester.mkdir("package"))), prepend=":")
    folder = pytester.mkdir("xosc")
    write_scenario(folder / "killed.xosc", detector="kills_process")
    for number in range(3):
        write_scenario(folder / f"sound_{number}.xosc")
    result = pytester.runpytest_subprocess("xosc", "-n", "2", "--reruns", "1", "-p", "no:cacheprovider")
    outcomes = result.parseoutcomes()
    assert (outcomes["passed"], outcomes["errors"]) == (3, 1)
    result.stdout.fnmatch_lines(["*the process of the run was ended by SIGKILL"])


@pytest.mark.process
def test_ended_worker_is_reported_with_signal_or_exit_code(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(
        """
        import os, signal

        def test_exits():
            os._exit(7)

        def test_aborts():
            os.kill(os.getpid(), signal.SIGABRT)

        def test_passes():
            pass
        """
    )
    result = pytester.runpytest_subprocess("-n", "2", "-p", "no:cacheprovider", "-p", "no:faulthandler")
    result.assert_outcomes(passed=1, failed=2)
    result.stdout.fnmatch_lines_random(
        ["the process of the test ended with exit code 7", "the process of the test was ended by SIGABRT"]
    )
