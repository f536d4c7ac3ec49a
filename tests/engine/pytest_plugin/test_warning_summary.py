"""Warnings of runs in a test session: properties, JUnit file and summary."""

from __future__ import annotations

import shutil
from pathlib import Path
from xml.etree import ElementTree

import pytest

pytest_plugins = ["pytester"]

PASSING_BY = Path(__file__).parents[2] / "data" / "passing_by.xosc"
MARKED = """
import pytest

@pytest.mark.scenario("scene.xosc", channel=["ideal", "none"], seeds=3)
def test_marked(run_scenario):
    result = run_scenario()
    assert list(result.warnings) == {expected!r}
"""
CHANNEL = "--eidrive-channel latency_300ms replaces the marker's channel=['ideal', 'none']"
SEEDS = "--eidrive-seeds 1 replaces the marker's seeds=3"


def session(pytester: pytest.Pytester, expected: list[str], *options: str) -> pytest.RunResult:
    shutil.copy(PASSING_BY, pytester.path / "scene.xosc")
    pytester.makepyfile(test_marked=MARKED.format(expected=expected))
    return pytester.runpytest_inprocess("-p", "no:cacheprovider", "test_marked.py", *options)


def warnings_of(junit: Path) -> list[str | None]:
    return [entry.get("value") for entry in ElementTree.parse(junit).iter("property") if entry.get("name") == "warning"]


def test_option_that_replaces_marker_list_warns(pytester: pytest.Pytester) -> None:
    options = ("--eidrive-channel", "latency_300ms", "--eidrive-seeds", "1", "--junitxml", "junit.xml")
    result = session(pytester, [CHANNEL, SEEDS], *options)
    result.assert_outcomes(passed=1)
    result.stdout.fnmatch_lines(["*warnings of runs*", f"*test_marked*: {CHANNEL.replace('[', '[[]')}"])
    assert warnings_of(pytester.path / "junit.xml") == [CHANNEL, SEEDS]


@pytest.mark.process
def test_warning_of_worker_is_reported_by_controller(pytester: pytest.Pytester) -> None:
    options = ("--eidrive-channel", "latency_300ms", "-n", "1", "--junitxml", "junit.xml")
    result = session(pytester, [CHANNEL], *options)
    result.assert_outcomes(passed=3)
    result.stdout.fnmatch_lines(["*warnings of runs*", f"*and 2 more: {CHANNEL.replace('[', '[[]')}"])
    assert warnings_of(pytester.path / "junit.xml") == [CHANNEL] * 3


@pytest.mark.process
@pytest.mark.parametrize("options", [(), ("--eidrive-channel", "ideal,none"), ("--eidrive-seeds", "3")])
def test_option_equal_to_marker_list_does_not_warn(pytester: pytest.Pytester, options: tuple[str, ...]) -> None:
    result = session(pytester, [], *options)
    result.assert_outcomes(passed=6)
    result.stdout.no_fnmatch_line("*warnings of runs*")


def test_warning_of_a_run_without_verdict_is_shown(pytester: pytest.Pytester) -> None:
    """Such a run is an error of the setup of its test."""
    criterion = ("--eidrive-criterion", "{max_speed: {of: Ego, at_most: 90}}")
    shutil.copy(PASSING_BY, pytester.path / "scene.xosc")
    options = ("--eidrive-drive", "Ego", "--eidrive-time-limit", "0.5", *criterion)
    result = pytester.runpytest_inprocess("-p", "no:cacheprovider", "scene.xosc", *options)
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines(["*warnings of runs*", "*scene[[]seed=1]: *no criterion demands that Ego drives on*"])


def test_warnings_of_runs_of_a_success_rate_are_shown_once(pytester: pytest.Pytester) -> None:
    text = """
import pytest

@pytest.mark.scenario("scene.xosc", channel=["ideal", "none"], success_rate=0.5)
def test_marked(run_scenario):
    assert run_scenario(drive="Ego", time_limit=60).passed
"""
    shutil.copy(PASSING_BY, pytester.path / "scene.xosc")
    pytester.makepyfile(test_marked=text)
    options = ("test_marked.py", "--eidrive-channel", "none", "--junitxml", "junit.xml")
    result = pytester.runpytest_inprocess("-p", "no:cacheprovider", *options)
    result.assert_outcomes(passed=1)
    result.stdout.fnmatch_lines(["*warnings of runs*"])
    warnings = warnings_of(pytester.path / "junit.xml")
    assert len(warnings) == len({*warnings})
    assert any("no criterion demands that Ego drives on" in str(warning) for warning in warnings)
    assert "--eidrive-channel none replaces the marker's channel=['ideal', 'none']" in warnings


def test_warnings_of_scenario_files_are_shown_once(pytester: pytest.Pytester) -> None:
    text = PASSING_BY.read_text().replace(
        "<UserDefinedAction>",
        '<UserDefinedAction><CustomCommandAction type="eidrive.channel">{delay: {kind: constant, seconds: 0.02}}'
        "</CustomCommandAction></UserDefinedAction><UserDefinedAction>",
        1,
    )
    (pytester.path / "scene.xosc").write_text(text)
    options = ("--eidrive-seeds", "2", "--junitxml", "junit.xml")
    result = pytester.runpytest_inprocess("-p", "no:cacheprovider", "scene.xosc", *options)
    result.assert_outcomes(passed=2)
    result.stdout.fnmatch_lines(["*scene[[]seed=1] and 1 more: *scene.xosc:*: most messages take one step of 0.05 s*"])
    assert len(warnings_of(pytester.path / "junit.xml")) == 2
