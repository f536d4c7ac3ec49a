"""Scenarios without criteria as tests: an error by default, a warning or neither by the option."""

from __future__ import annotations

from xml.etree import ElementTree

import pytest

pytest_plugins = ["pytester"]

WORDS = "the run is not judged: it has no criterion"


@pytest.fixture
def bare(project: pytest.Pytester) -> pytest.Pytester:
    """Return a project whose only scenario has no criteria."""
    path = project.path / "xosc" / "far.xosc"
    text = path.read_text()
    for other in ("near", "wrong"):
        path.with_name(f"{other}.xosc").unlink()
    start = text.index("<UserDefinedAction>")
    end = text.index("</UserDefinedAction>") + len("</UserDefinedAction>")
    path.write_text(text[:start] + text[end:])
    return project


def run(project: pytest.Pytester, *arguments: str) -> pytest.RunResult:
    return project.runpytest_inprocess("xosc", "-p", "no:cacheprovider", *arguments)


@pytest.mark.exhaustive
def test_run_without_criteria_is_an_error(bare: pytest.Pytester) -> None:
    result = run(bare, "--junitxml", "junit.xml")
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines(
        [f"{WORDS}; add one to the scenario or by --eidrive-criterion *", "far is not judged with channel *, seed 1"]
    )
    (case,) = ElementTree.parse(bare.path / "junit.xml").iter("testcase")
    error = case.find("error")
    assert error is not None
    assert WORDS in (error.text or "")
    assert any(
        entry.get("name") == "warning" and (entry.get("value") or "").startswith(WORDS)
        for entry in case.iter("property")
    )
    run(bare, "--eidrive-criterion", "{collision: {of: Ego}}").assert_outcomes(passed=1)


@pytest.mark.exhaustive
@pytest.mark.parametrize(("outcome", "warned"), [("warn", True), ("pass", False)])
def test_ini_option_accepts_run(bare: pytest.Pytester, outcome: str, warned: bool) -> None:
    bare.makeini(f"[pytest]\neidrive_without_criteria = {outcome}")
    result = run(bare)
    result.assert_outcomes(passed=1)
    assert (WORDS in result.stdout.str()) == warned
    run(bare, "--eidrive-without-criteria", "error").assert_outcomes(errors=1)


def test_unknown_outcome_is_refused(bare: pytest.Pytester) -> None:
    bare.makeini("[pytest]\neidrive_without_criteria = ignore")
    result = run(bare)
    assert result.ret == 4
    result.stderr.fnmatch_lines(["*eidrive_without_criteria: not one of error, warn, pass (got 'ignore')"])


def test_success_rate_without_criteria_is_an_error(bare: pytest.Pytester) -> None:
    result = run(bare, "--eidrive-success-rate", "0.5")
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines([f"seed 1: {WORDS}*"])


def test_fixture_returns_result_that_is_not_passed(bare: pytest.Pytester) -> None:
    """A test in Python judges by itself: without a criterion it may use the metrics, but `passed` is False."""
    bare.makepyfile(
        """
        def test_metrics(run_scenario):
            assert run_scenario("xosc/far.xosc").simulated_s == 3.0

        def test_passed(run_scenario):
            assert run_scenario("xosc/far.xosc").passed

        def test_accepted(run_scenario):
            assert run_scenario("xosc/far.xosc", no_criteria=True).passed
        """
    )
    result = bare.runpytest_inprocess("-p", "no:cacheprovider")
    result.assert_outcomes(passed=2, failed=1)
    result.stdout.fnmatch_lines([f"*: {WORDS}*"])
