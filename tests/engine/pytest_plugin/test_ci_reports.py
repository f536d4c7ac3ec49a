"""Reports for CI systems: attachments in JUnit files, annotations and job summaries of GitHub Actions."""

from __future__ import annotations

import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import pytest

from eidrive_scenario.pytest_plugin.reports import annotation, summary

pytest_plugins = ["pytester"]

pytestmark = pytest.mark.timeout(600)

PASSING_BY = Path(__file__).parents[2] / "data" / "passing_by.xosc"
VARIABLES = ("GITHUB_ACTIONS", "GITHUB_STEP_SUMMARY", "GITHUB_WORKSPACE", "CI_PROJECT_DIR")


@pytest.fixture
def project(project: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> pytest.Pytester:
    """Return the project outside of any CI system."""
    for name in VARIABLES:
        monkeypatch.delenv(name, raising=False)
    return project


def outputs(junit: Path) -> dict[str, list[str]]:
    """Return the texts of `system-out` of each case by its name without folder and settings."""
    return {
        re.sub(r"^.*/|\[.*$", "", str(case.get("name"))): [entry.text or "" for entry in case.findall("system-out")]
        for case in ElementTree.parse(junit).iter("testcase")
    }


def attached(texts: list[str]) -> list[str]:
    (text,) = texts
    return re.findall(r"^\[\[ATTACHMENT\|(.*)\]\]$", text, re.MULTILINE)


@pytest.mark.process
def test_failed_run_has_absolute_attachments(project: pytest.Pytester) -> None:
    """Jenkins requires absolute paths. The files exist, and only the failed run has them."""
    arguments = ("--junitxml", "junit.xml", "--eidrive-out", "runs", "-n", "1", "-p", "no:cacheprovider")
    project.runpytest_inprocess("xosc", *arguments).assert_outcomes(passed=1, failed=1, errors=1)
    texts = outputs(project.path / "junit.xml")
    assert (texts["far"], texts["wrong"]) == ([], [])
    paths = [Path(path) for path in attached(texts["near"])]
    assert [path.name for path in paths] == ["recording.mcap", "result.json"]
    assert all(path.is_absolute() and path.is_file() for path in paths)


def test_attachments_of_gitlab_are_relative_to_project(
    project: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With captured output in the file, the lines are in the same element: GitLab reads one."""
    monkeypatch.setenv("CI_PROJECT_DIR", str(project.path))
    project.makepyfile(
        """
        def test_own(run_scenario):
            print("printed")
            assert run_scenario("xosc/near.xosc").passed
        """
    )
    arguments = ("--junitxml", "junit.xml", "--eidrive-out", "runs", "-o", "junit_logging=system-out")
    project.runpytest_inprocess("test_attachments_of_gitlab_are_relative_to_project.py", *arguments)
    (texts,) = outputs(project.path / "junit.xml").values()
    assert "printed" in texts[0]
    paths = attached(texts)
    assert [Path(path).name for path in paths] == ["recording.mcap", "result.json"]
    assert all(not Path(path).is_absolute() and (project.path / path).is_file() for path in paths)


@pytest.mark.process
def test_github_session_writes_annotations_and_summary_once(
    project: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("GITHUB_ACTIONS", "true")
    monkeypatch.setenv("GITHUB_WORKSPACE", str(project.path))
    step = project.path / "step.md"
    step.write_text("# before\n", encoding="utf-8")
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(step))
    result = project.runpytest_inprocess("xosc", "-n", "1", "-q", "-p", "no:cacheprovider")
    commands = [line for line in result.outlines if line.startswith("::")]
    declared = PASSING_BY.read_text(encoding="utf-8").splitlines()
    near, wrong = sorted(commands)
    found = re.match(
        r"::error file=xosc/near\.xosc,line=(\d+),title=[^:]*::collision 1, limit 0, first violated at ", near
    )
    assert found is not None
    assert "collision" in declared[int(found[1]) - 1]
    assert wrong.startswith("::error file=xosc/wrong.xosc,line=61,title=xosc/wrong.xosc%3A%3Axosc/wrong[seed=1]::")
    text = step.read_text(encoding="utf-8")
    assert text.startswith("# before\n## Scenarios\n\n1 passed, 1 failed, 1 error\n")
    rows = [line for line in text.splitlines() if line.startswith("| xosc")]
    assert len(rows) == 2
    assert f"<code>eidrive run {project.path}/xosc/near.xosc --seed 1</code>" in "".join(rows).replace("&#95;", "_")


def test_session_outside_of_github_writes_neither(project: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(project.path / "step.md"))
    result = project.runpytest_inprocess("xosc/wrong.xosc", "-p", "no:cacheprovider")
    result.stdout.no_fnmatch_line("::*")
    assert not (project.path / "step.md").exists()


def test_unwritable_summary_is_reported(project: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GITHUB_ACTIONS", "true")
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(project.path / "no" / "step.md"))
    result = project.runpytest_inprocess("xosc/far.xosc", "-p", "no:cacheprovider")
    result.assert_outcomes(passed=1)
    result.stdout.fnmatch_lines(["GITHUB_STEP_SUMMARY: the summary is not written (*"])


def report(nodeid: str, *reasons: str, file: str = "", line: int = 0, command: str = "") -> Any:
    facts = {"reasons": list(reasons), "commands": [command] if command else [], "file": file, "line": line}
    return SimpleNamespace(nodeid=nodeid, when="call", eidrive=facts)


def test_annotation_escapes_workflow_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """GitHub decodes %25, %0D, %0A in all parts, and %3A, %2C in properties."""
    monkeypatch.setenv("GITHUB_WORKSPACE", str(tmp_path))
    line = annotation(
        report("a,b.xosc::x[c:d]", "50% lost:\r\nnext, ::end::", file=str(tmp_path / "a,b.xosc")), tmp_path
    )
    assert line == ("::error file=a%2Cb.xosc,line=1,title=a%2Cb.xosc%3A%3Ax[c%3Ad]::50%25 lost:%0D%0Anext, ::end::")


def test_summary_counts_expected_failures(project: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GITHUB_ACTIONS", "true")
    step = project.path / "step.md"
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(step))
    project.makepyfile("import pytest\n\n@pytest.mark.xfail\ndef test_one():\n    assert False\n")
    project.runpytest_inprocess("test_summary_counts_expected_failures.py", "-p", "no:cacheprovider")
    assert step.read_text(encoding="utf-8") == "## Scenarios\n\n1 xfailed\n\n"


def test_summary_escapes_markdown() -> None:
    text = summary(
        {"failed": 1}, [report("a|b_c::x[y]", "<b>*1*</b>\nsecond", command="eidrive run 'a|b' --param x=`y`")]
    )
    (row,) = (line for line in text.splitlines() if line.startswith("| a"))
    assert row.split(" | ")[0] == r"| a\|b\_c::x\[y\]"
    assert r"\<b\>\*1\*\</b\><br>second" in row
    assert "eidrive run 'a&#124;b' --param x=&#96;y&#96;" in row
    assert len(re.findall(r"(?<!\\)\|", row)) == 5


def test_summary_stays_below_limit_of_github() -> None:
    """One step may write 1 MiB."""
    text = summary({"failed": 9000}, [report(f"xosc/{number}.xosc", "reason " * 30) for number in range(9000)])
    assert len(text.encode()) < 2**20
    listed = text.count("| xosc")
    assert text.rstrip().endswith(f"and {9000 - listed} more")
