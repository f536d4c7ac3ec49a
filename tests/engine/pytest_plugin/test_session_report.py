"""Report of a test session: `--eidrive-report`."""

from __future__ import annotations

from pathlib import Path

import pytest
from lxml import html
from report_table import listed_runs

pytestmark = pytest.mark.process

pytest_plugins = ["pytester"]


def lead(page: Path) -> str:
    """Return the first sentence of a report."""
    (text,) = html.parse(str(page)).getroot().find_class("lead")
    return str(text.text_content())


def replays(page: Path) -> list[Path]:
    return [page.parent / run["replay"] for run in listed_runs(page) if run["replay"]]


@pytest.mark.parametrize("workers", [[], ["-n", "2"]], ids=["one process", "two workers"])
def test_session_writes_the_report_of_its_runs_once(project: pytest.Pytester, workers: list[str]) -> None:
    result = project.runpytest_inprocess("xosc", "-p", "no:cacheprovider", "--eidrive-report", "out/all.html", *workers)
    result.assert_outcomes(passed=1, failed=1, errors=1)
    page = project.path / "out" / "all.html"
    result.stdout.fnmatch_lines(["*- report -*", str(page)])
    assert lead(page) == "2 runs: 1 passed, 1 failed."
    assert len(replays(page)) == 2
    assert all(path.is_file() for path in replays(page))
    assert len(list((page.parent / "runs").rglob("recording.mcap"))) == 2


def test_report_omits_runs_of_earlier_sessions(project: pytest.Pytester) -> None:
    common = ("-p", "no:cacheprovider", "--eidrive-out", "runs", "--eidrive-record", "on-failure")
    project.runpytest_inprocess("xosc/near.xosc", *common)
    project.makeini("[pytest]\neidrive_report = pages")
    result = project.runpytest_inprocess("xosc/far.xosc", *common)
    result.assert_outcomes(passed=1)
    page = project.path / "pages" / "report.html"
    assert lead(page) == "1 run: 1 passed."
    assert replays(page) == []
    assert not (project.path / "pages" / "runs").exists()


def test_report_without_any_run_is_not_written(project: pytest.Pytester) -> None:
    result = project.runpytest_inprocess("xosc/wrong.xosc", "-p", "no:cacheprovider", "--eidrive-report", "page")
    result.stdout.fnmatch_lines(["*page: not written, as no run has kept files"])
    assert not (project.path / "page").exists()


def test_unwritable_report_is_an_error_in_the_summary(project: pytest.Pytester) -> None:
    (project.path / "file").write_text("", encoding="utf-8")
    options = ("--eidrive-report", "file/page.html", "--eidrive-out", "runs")
    result = project.runpytest_inprocess("xosc/far.xosc", "-p", "no:cacheprovider", *options)
    result.assert_outcomes(passed=1)
    result.stdout.fnmatch_lines(["*file/page.html: not written: *"])
