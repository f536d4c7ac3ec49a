"""Driving stacks and criteria by options, ini options and the marker of the plugin."""

from __future__ import annotations

import shutil
from pathlib import Path
from xml.etree import ElementTree

import pytest

pytest_plugins = ["pytester"]

PASSING_BY = Path(__file__).parents[2] / "data" / "passing_by.xosc"
SLOW = "target_speed: 2\nplanner: route\n"


@pytest.fixture
def project(pytester: pytest.Pytester) -> pytest.Pytester:
    folder = pytester.mkdir("drives")
    shutil.copy(PASSING_BY, folder / "first.xosc")
    (pytester.path / "slow.yaml").write_text(SLOW)
    (pytester.path / "limit.yaml").write_text("max_speed: {of: Ego, at_most: 9}\n")
    return pytester


def run(pytester: pytest.Pytester, *arguments: str, text: str = "") -> pytest.RunResult:
    if text:
        pytester.makepyfile(test_own="import pytest\n" + text)
    return pytester.runpytest_inprocess("-v", "--strict-markers", "-p", "no:cacheprovider", *arguments)


def properties(pytester: pytest.Pytester) -> dict[str | None, str | None]:
    return {one.get("name"): one.get("value") for one in ElementTree.parse(pytester.path / "j.xml").iter("property")}


def test_options_drive_and_judge_scenario_files(project: pytest.Pytester) -> None:
    """Ego keeps the 10 m/s that the storyboard commands, so the speed limit of 9 m/s fails."""
    options = ("--eidrive-drive", "Ego=slow.yaml", "--eidrive-criterion", "limit.yaml")
    result = run(project, "drives", *options, "--eidrive-criterion", "{collision: {of: Ego}}", "--junitxml", "j.xml")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["eidrive: drive Ego=slow.yaml, criterion limit.yaml,{collision: {of: Ego}}"])
    result.stdout.fnmatch_lines(
        ["max_speed * m/s, limit 9 *", f"reproduce: eidrive run *--drive Ego={project.path}/slow.yaml *"]
    )
    found = properties(project)
    assert found["settings.drive"] == '["Ego"]'
    assert float(found["max_speed.value"] or 0.0) > 9.0
    assert (found["collision.passed"], found["collision_2.passed"]) == ("True", "True")


def test_ini_options_apply_to_all_tests(project: pytest.Pytester) -> None:
    project.makeini("[pytest]\neidrive_drive =\n    Ego=slow.yaml\n    Parked\neidrive_criterion =\n    limit.yaml\n")
    text = """
def test_any(run_scenario):
    result = run_scenario("drives/first.xosc")
    assert result.settings.drive == ("Ego", "Parked")
    assert result.settings.stations["Ego"]["target_speed"] == 2.0
    assert [verdict.name for verdict in result.criteria][-1] == "max_speed"
"""
    run(project, "drives/first.xosc", "test_own.py", text=text).assert_outcomes(passed=1, failed=1)


def test_marker_accepts_stacks_and_criteria_beside_the_test(project: pytest.Pytester) -> None:
    (project.path / "drives" / "own.yaml").write_text(SLOW)
    (project.path / "drives" / "test_own.py").write_text("""
import pytest
@pytest.mark.scenario("first", drive={"Ego": "own.yaml"}, criteria=[{"collision": {"of": "Ego"}}, "../limit.yaml"])
def test_driven(run_scenario):
    result = run_scenario()
    assert result.settings.stations["Ego"]["target_speed"] == 2.0
    assert [verdict.name for verdict in result.criteria][2:] == ["collision_2", "max_speed"]

@pytest.mark.scenario("first", drive=["Ego", "Parked"])
def test_two(run_scenario):
    assert run_scenario().settings.drive == ("Ego", "Parked")

@pytest.mark.scenario("first", drive="Ego")
def test_replaced_by_a_keyword(run_scenario):
    assert run_scenario(drive="Parked").settings.drive == ("Parked",)
""")
    run(project, "drives/test_own.py").assert_outcomes(passed=3)


def test_command_line_replaces_the_stack_of_the_marker_with_a_warning(project: pytest.Pytester) -> None:
    text = """
@pytest.mark.scenario("drives/first", drive={"Ego": {"target_speed": 3}}, criteria={"collision": {"of": "Ego"}})
def test_driven(run_scenario):
    result = run_scenario()
    assert result.settings.stations["Ego"]["target_speed"] == 2.0
    assert "--eidrive-drive Ego replaces the driving stack of 'Ego' in the marker" in result.warnings
    assert len(result.settings.criteria) == 2
"""
    options = ("--eidrive-drive", "Ego=slow.yaml", "--eidrive-criterion", "{collision: {of: Parked}}")
    run(project, "test_own.py", *options, text=text).assert_outcomes(passed=1)


@pytest.mark.exhaustive
def test_planner_of_all_driven_stations(project: pytest.Pytester) -> None:
    text = """
def test_driven(run_scenario):
    assert run_scenario("drives/first.xosc").settings.stations["Ego"]["planner"] == "route"
    assert run_scenario("drives/first.xosc", planner=None).settings.planner is None
"""
    options = ("--eidrive-drive", "Ego={planner: none}", "--eidrive-planner", "route")
    run(project, "test_own.py", "--eidrive-drive", "Ego", *options[2:], text=text).assert_outcomes(passed=1)
    result = run(project, "drives", *options)
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines(
        ["eidrive: drive Ego={planner: none}, planner route", "--eidrive-planner: planner 'route' has*--eidrive-drive"]
    )


def test_entity_that_the_scenario_lacks_is_an_error_of_the_test(project: pytest.Pytester) -> None:
    result = run(project, "drives", "--eidrive-drive", "Egon")
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines(["--eidrive-drive: the scenario has no entity 'Egon'; did you mean 'Ego'?"])


def test_option_without_a_stack_is_a_usage_error(project: pytest.Pytester) -> None:
    result = run(project, "drives", "--eidrive-drive", "Ego=")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(["*no entity or stack is given (got 'Ego=')*"])


def test_invalid_marker_is_reported_with_the_argument(project: pytest.Pytester) -> None:
    text = """
@pytest.mark.scenario("drives/first", drive=5)
def test_driven(run_scenario):
    run_scenario()
"""
    result = run(project, "test_own.py", text=text)
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["drive has the entity 5; give a name*"])
