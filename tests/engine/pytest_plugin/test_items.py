"""Scenario files as tests: outcomes, properties, texts of failures."""

from __future__ import annotations

import json
import re
import shlex
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest
from mcap.reader import make_reader

pytest_plugins = ["pytester"]

PASSING_BY = Path(__file__).parents[2] / "data" / "passing_by.xosc"


def test_scenario_items_have_outcomes_and_reasons(project: pytest.Pytester) -> None:
    result = project.runpytest_inprocess("xosc", "-p", "no:cacheprovider")
    result.assert_outcomes(passed=1, failed=1, errors=1)
    result.stdout.fnmatch_lines_random(
        [
            "*failed with channel *, seed 1",
            "collision 1, limit 0, first violated at 1.6* s: Ego and Parked hit each other at 1.6* s at *",
            "min_distance * m, limit 3 m, first violated at * s: Ego and Parked came within * m (*) at * s, *",
            "*wrong.xosc:61: *did you mean 'step'?",
        ]
    )
    result.stdout.no_fnmatch_line("*Traceback*")
    result.stdout.no_fnmatch_line("*.py:*: *Error*")


@pytest.mark.process
def test_junit_file_of_two_workers_contains_all_runs(project: pytest.Pytester) -> None:
    arguments = ("--eidrive-seeds", "2", "--eidrive-channel", "ideal,none", "-n", "2", "--junitxml", "junit.xml")
    result = project.runpytest_inprocess("xosc/far.xosc", "xosc/near.xosc", *arguments, "-p", "no:cacheprovider")
    result.assert_outcomes(passed=4, failed=4)
    cases = {
        f"{case.get('classname')}::{case.get('name')}": case
        for case in ElementTree.parse(project.path / "junit.xml").iter("testcase")
    }
    assert sorted(cases) == [
        f"xosc.{name}.xosc::xosc/{name}[channel={channel}-seed={seed}]"
        for name in ("far", "near")
        for channel in ("ideal", "none")
        for seed in (1, 2)
    ]
    case = cases["xosc.far.xosc::xosc/far[channel=ideal-seed=2]"]
    properties = {entry.get("name"): entry.get("value") for entry in case.iter("property")}
    assert properties["min_distance.passed"] == "True"
    assert float(properties["min_distance.value"] or "") == pytest.approx(5.0)
    assert properties["min_distance.limit"] == "3.0"
    assert float(properties["min_distance.Ego.Parked.box"] or "") == pytest.approx(3.0)
    assert (properties["seed"], properties["end_reason"]) == ("2", "stop trigger")
    assert len(properties["trace_hash"] or "") == 64
    failure = cases["xosc.near.xosc::xosc/near[channel=none-seed=1]"].find("failure")
    assert failure is not None
    assert "hit each other" in (failure.text or "")
    assert "Traceback" not in (failure.text or "")


def test_out_option_writes_folder_per_run(project: pytest.Pytester) -> None:
    result = project.runpytest_inprocess(
        "xosc/far.xosc", "--eidrive-out", "runs", "--eidrive-seeds", "2", "-p", "no:cacheprovider"
    )
    result.assert_outcomes(passed=2)
    result.stdout.fnmatch_lines(["eidrive: seeds 2, out runs"])
    kept = sorted(path.relative_to(project.path).as_posix() for path in project.path.glob("runs/**/*.*"))
    short = [re.sub(r"-[0-9a-f]{10}/", "/", path) for path in kept]
    names = ("recording.mcap", "result.json")
    assert short == [f"runs/xosc/far/far-none-seed{seed}/{name}" for seed in (1, 2) for name in names]
    assert json.loads((project.path / kept[1]).read_text())["passed"] is True


def test_record_option_keeps_recordings_of_failed_runs(project: pytest.Pytester) -> None:
    arguments = ("xosc/far.xosc", "xosc/near.xosc", "--eidrive-out", "runs", "--eidrive-record", "on-failure")
    project.runpytest_inprocess(*arguments, "-p", "no:cacheprovider").assert_outcomes(passed=1, failed=1)
    kept = [path.relative_to(project.path / "runs/xosc") for path in project.path.glob("runs/**/*.*")]
    assert sorted((path.parts[0], path.name) for path in kept) == [
        ("far", "result.json"),
        ("near", "recording.mcap"),
        ("near", "result.json"),
    ]


@pytest.mark.process
def test_topics_option_adds_topics_of_other_tools(project: pytest.Pytester) -> None:
    arguments = ("xosc/far.xosc", "--eidrive-out", "runs", "--eidrive-topics", "osi,foxglove")
    project.runpytest_inprocess(*arguments, "-p", "no:cacheprovider").assert_outcomes(passed=1)
    (recording,) = project.path.glob("runs/**/recording.mcap")
    with recording.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    assert {channel.topic for channel in summary.channels.values()} >= {"/frame", "/tf", "ground_truth"}
    wrong = project.runpytest_inprocess("xosc/far.xosc", "--eidrive-topics", "rviz")
    wrong.stderr.fnmatch_lines(["*--eidrive-topics: not some of foxglove, osi (got 'rviz')*"])


@pytest.mark.parametrize("option", [("--eidrive-record", "always"), ("--eidrive-topics", "osi")])
def test_option_of_kept_files_without_their_folder_is_a_usage_error(
    project: pytest.Pytester, option: tuple[str, str]
) -> None:
    done = project.runpytest_inprocess("xosc/far.xosc", *option)
    assert done.ret == pytest.ExitCode.USAGE_ERROR
    done.stderr.fnmatch_lines([f"*{option[0]} without --eidrive-out has no effect*"])


@pytest.mark.process
def test_trace_hash_does_not_depend_on_test_order(project: pytest.Pytester) -> None:
    def hashes(*arguments: str) -> dict[str, str]:
        project.runpytest_inprocess(*arguments, "--junitxml", "junit.xml", "-p", "no:cacheprovider")
        found = {}
        for case in ElementTree.parse(project.path / "junit.xml").iter("testcase"):
            (trace,) = (entry.get("value") for entry in case.iter("property") if entry.get("name") == "trace_hash")
            found[case.get("name") or ""] = trace or ""
        return found

    forwards = hashes("xosc/far.xosc", "xosc/near.xosc")
    backwards = hashes("xosc/near.xosc", "xosc/far.xosc")
    assert forwards == backwards
    assert len(set(forwards.values())) == 2


@pytest.mark.process
def test_failure_prints_reproducing_command_and_recording(project: pytest.Pytester) -> None:
    arguments = ("--eidrive-channel", "{delay: {kind: constant, seconds: 0.1}}", "--eidrive-out", "kept runs")
    result = project.runpytest_inprocess("xosc/near.xosc", *arguments, "-p", "no:cacheprovider")
    result.assert_outcomes(failed=1)
    # With CI=true pytest repeats the whole text in its summary.
    (command,) = {line for line in result.outlines if line.startswith("reproduce: ")}
    (recording,) = {line.removeprefix("recording: ") for line in result.outlines if line.startswith("recording: ")}
    kept = json.loads(Path(recording).with_name("result.json").read_text(encoding="utf-8"))
    words = shlex.split(command.removeprefix("reproduce: "))
    assert words[0] == "eidrive"
    again = subprocess.run(
        [sys.executable, "-m", "eidrive_scenario", *words[1:], "--json"],
        cwd="/",
        capture_output=True,
        text=True,
        check=False,
    )
    printed = json.loads(again.stdout)
    assert (printed["trace_hash"], printed["settings"]) == (kept["trace_hash"], kept["settings"])


@pytest.mark.process
def test_junit_properties_contain_all_settings(project: pytest.Pytester) -> None:
    arguments = ("--eidrive-channel", "{loss: {kind: bernoulli, probability: 0.5}}", "--junitxml", "junit.xml")
    project.runpytest_inprocess("xosc/far.xosc", *arguments, "--eidrive-out", "runs", "-p", "no:cacheprovider")
    (case,) = ElementTree.parse(project.path / "junit.xml").iter("testcase")
    properties = {str(entry.get("name")): str(entry.get("value")) for entry in case.iter("property")}
    (path,) = project.path.glob("runs/**/result.json")
    settings = json.loads(path.read_text(encoding="utf-8"))["settings"]
    assert settings["channel_profile"]["loss"]["probability"] == 0.5
    for key, value in settings.items():
        text = properties[f"settings.{key}"]
        assert (text if isinstance(value, str) else json.loads(text)) == value
    assert len(properties["settings_sha256"]) == 64


@pytest.mark.process
def test_junit_file_of_a_name_with_control_characters_is_readable(project: pytest.Pytester) -> None:
    criterion = r'{max_speed: {of: Ego, name: "a\x01b"}}'
    options = ("xosc/far.xosc", "-p", "no:cacheprovider", "--junitxml", "junit.xml")
    project.runpytest_inprocess(*options, "--eidrive-criterion", criterion).assert_outcomes(passed=1)
    names = {entry.get("name") for entry in ElementTree.parse(project.path / "junit.xml").iter("property")}
    assert r"a\u0001b.passed" in names


def test_failed_python_test_prints_command_of_run(project: pytest.Pytester) -> None:
    project.makepyfile(
        test_own="""
        import pathlib

        def test_file(run_scenario):
            assert run_scenario("xosc/near.xosc", seed=4).passed

        def test_object(run_scenario):
            assert run_scenario(pathlib.Path("xosc/near.xosc").read_bytes()).passed
        """
    )
    result = project.runpytest_inprocess("test_own.py", "-p", "no:cacheprovider")
    result.assert_outcomes(failed=2)
    near = project.path / "xosc" / "near.xosc"
    result.stdout.fnmatch_lines([f"reproduce: eidrive run {near} --seed 4"])
    result.stdout.fnmatch_lines([f"reproduce: pytest {project.path / 'test_own.py'}::test_object"])
