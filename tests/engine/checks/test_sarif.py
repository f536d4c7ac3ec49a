"""SARIF log of `eidrive check`; its form is that of the standard (OASIS SARIF 2.1.0)."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import pytest
from command_fixtures import Eidrive

from eidrive_scenario.checks.scenario_checks import ALL_RULES
from eidrive_scenario.cli import check
from eidrive_scenario.errors import WallLimitError

BROKEN = 'dynamicsShape="stp"'
UNUSED = '<ParameterDeclarations>\n   <ParameterDeclaration name="Größe" parameterType="double" value="1"/>'


def run_of(path: Path) -> dict[str, Any]:
    log = json.loads(path.read_text(encoding="utf-8"))
    assert log["version"] == "2.1.0"
    assert log["$schema"].endswith("sarif-schema-2.1.0.json")
    (run,) = log["runs"]
    return dict(run)


@pytest.fixture
def folder(tmp_path: Path, passing_by: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the current folder, with a subfolder of an invalid scenario and one with an unused parameter."""
    text = passing_by.read_text(encoding="utf-8")
    below = tmp_path / "my scenarios" / "größe"
    below.mkdir(parents=True)
    broken = text.replace('dynamicsShape="step"', BROKEN, 1)
    (below / "a#1.xosc").write_text(broken.replace("<Story", "<!-- 🚗 --><Story"), encoding="utf-8")
    (below / "b.xosc").write_text(text.replace("<ParameterDeclarations>", UNUSED, 1), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_notification_of_aborted_check_has_its_file(
    eidrive: Eidrive, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def reach_limit(*_: object) -> None:
        raise WallLimitError(5.0)

    monkeypatch.setattr(check, "_check_file", reach_limit)
    assert eidrive("check", "my scenarios", "--sarif", "log").exit_code == 3
    (invocation,) = run_of(folder / "log")["invocations"]
    texts = [notification["message"]["text"] for notification in invocation["toolExecutionNotifications"]]
    message = "not finished after 5 s of wall time (the wall limit)"
    assert texts == [f"my scenarios/größe/{name}.xosc: {message}" for name in ("a#1", "b")]


def test_results_have_rule_level_address_and_columns(eidrive: Eidrive, folder: Path) -> None:
    done = eidrive("check", "my scenarios", "--sarif", "out/check.sarif")
    assert done.exit_code == 2
    run = run_of(folder / "out" / "check.sarif")
    assert run["columnKind"] == "unicodeCodePoints"
    assert run["originalUriBaseIds"]["%SRCROOT%"]["uri"] == f"{folder.as_uri()}/"
    rules = run["tool"]["driver"]["rules"]
    printed = done.stdout.splitlines()[:-1]
    assert len(run["results"]) == len(printed) >= 2
    for result in run["results"]:
        assert rules[result["ruleIndex"]]["id"] == result["ruleId"]
        ((place,),) = [[one["physicalLocation"] for one in result["locations"]]]
        assert place["artifactLocation"]["uriBaseId"] == "%SRCROOT%"
        path = unquote(place["artifactLocation"]["uri"])
        region = place["region"]
        line = (folder / path).read_text(encoding="utf-8").splitlines()[region["startLine"] - 1]
        assert line[region["startColumn"] - 1 : region["endColumn"] - 1] == line.strip()
        assert any(one.startswith(f"{path}:{region['startLine']}: {result['message']['text']}") for one in printed)
    error = next(result for result in run["results"] if result["level"] == "error")
    assert error["ruleId"] == "scenario"
    assert (
        error["locations"][0]["physicalLocation"]["artifactLocation"]["uri"]
        == "my%20scenarios/gr%C3%B6%C3%9Fe/a%231.xosc"
    )
    assert {result["ruleId"] for result in run["results"] if result["level"] == "warning"} == {"unused-parameter"}


def test_log_describes_every_rule(eidrive: Eidrive, passing_by: Path, tmp_path: Path) -> None:
    log = tmp_path / "check.sarif"
    assert eidrive("check", passing_by, "--sarif", log).exit_code == 0
    run = run_of(log)
    assert run["results"] == []
    assert run["invocations"][0]["executionSuccessful"] is True
    rules = {rule["id"]: rule for rule in run["tool"]["driver"]["rules"]}
    assert len(rules) == len(run["tool"]["driver"]["rules"]) == len(ALL_RULES) + 1
    for rule in ALL_RULES:
        described = rules[rule.name]
        assert described["defaultConfiguration"]["level"] == rule.level.value
        assert described["shortDescription"]["text"] == rule.summary
        assert rule.name in described["help"]["text"]


def test_file_elsewhere_has_whole_address(eidrive: Eidrive, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (folder / "empty").mkdir()
    monkeypatch.chdir(folder / "empty")
    eidrive("check", folder, "--sarif", "check.sarif")
    address = run_of(Path("check.sarif"))["results"][0]["locations"][0]["physicalLocation"]["artifactLocation"]
    assert address == {"uri": (folder / "my scenarios" / "größe" / "a#1.xosc").as_uri()}


def test_diagnostics_without_a_file_are_notifications(eidrive: Eidrive, passing_by: Path, tmp_path: Path) -> None:
    """Code scanning shows results in files only; an unknown planner is a mistake of the command."""
    log = tmp_path / "check.sarif"
    assert eidrive("check", passing_by, "missing.xosc", "--planner", "rout", "--sarif", log).exit_code == 2
    run = run_of(log)
    assert run["results"] == []
    texts = [one["message"]["text"] for one in run["invocations"][0]["toolConfigurationNotifications"]]
    assert any(text.startswith("no scenario 'missing.xosc'") for text in texts)
    assert any(text.startswith("--planner: unknown planner 'rout'; did you mean 'route'?") for text in texts)


def test_log_does_not_overwrite_a_scenario(eidrive: Eidrive, passing_by: Path) -> None:
    before = passing_by.read_bytes()
    done = eidrive("check", passing_by, "--sarif", passing_by)
    assert done.exit_code == 2
    assert "--sarif would overwrite an input file" in done.stderr
    assert passing_by.read_bytes() == before
