"""Ini options: one for each option, with the command line in front, and errors that name them."""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path

import pytest

from eidrive_scenario.pytest_plugin.options import OPTIONS

pytest_plugins = ["pytester"]

pytestmark = pytest.mark.timeout(600)

PASSING_BY = Path(__file__).parents[2] / "data" / "passing_by.xosc"


@pytest.fixture
def project(pytester: pytest.Pytester) -> pytest.Pytester:
    shutil.copy(PASSING_BY, pytester.mkdir("drives") / "first.xosc")
    return pytester


def collected(pytester: pytest.Pytester, *arguments: str) -> list[str]:
    result = pytester.runpytest_inprocess("--collect-only", "-q", "-p", "no:cacheprovider", *arguments)
    return [line.partition("[")[2] for line in result.outlines if "::" in line]


def test_every_option_is_in_one_help_group_with_ini_option(pytester: pytest.Pytester) -> None:
    lines = pytester.runpytest_inprocess("--help").outlines
    begin = lines.index("OpenSCENARIO files:")
    group = " ".join(" ".join(lines[begin : lines.index("", begin)]).split())
    assert len(OPTIONS) == 16
    for option in OPTIONS:
        assert f"{option.flag}=" in group
        assert f"ini option: {option.key}" in group
        assert any(line.strip().startswith(f"{option.key} (") for line in lines)


def test_ini_options_select_channels_and_seeds(project: pytest.Pytester) -> None:
    (project.path / "bad.yaml").write_text("loss: {kind: bernoulli, probability: 0.9}")
    project.makeini(
        "[pytest]\neidrive_channel =\n  ideal,none\n  bad.yaml\neidrive_seeds = 2\neidrive_detector=oracle\n"
    )
    assert collected(project, "drives") == [
        f"channel={channel}-detector=oracle-seed={seed}]" for channel in ("ideal", "none", "bad") for seed in (1, 2)
    ]


def test_command_line_takes_precedence_over_ini_options(project: pytest.Pytester) -> None:
    project.makeini("[pytest]\neidrive_channel = ideal\neidrive_seeds = 3\neidrive_planner = route\n")
    arguments = ("--eidrive-channel", "none", "--eidrive-seeds", "1", "--eidrive-planner", "behavior")
    assert collected(project, "drives", *arguments) == ["channel=none-planner=behavior-seed=1]"]


@pytest.mark.statistical
def test_marker_takes_precedence_over_ini_options(project: pytest.Pytester) -> None:
    project.makeini("[pytest]\neidrive_channel = ideal\neidrive_success_rate = 0.9\n")
    project.makepyfile(
        """
        import pytest

        @pytest.mark.scenario("drives/*.xosc", channel="none", seeds=2)
        def test_own(run_scenario):
            pass
        """
    )
    assert collected(project) == ["drives/first-channel=none-seed=1]", "drives/first-channel=none-seed=2]"]
    assert collected(project, "drives") == ["channel=ideal-rate=0.9]"]


def test_ini_options_configure_runs(project: pytest.Pytester) -> None:
    """Paths of the ini file are relative to the root, also in a session that starts in another folder."""
    project.makeini(
        "[pytest]\neidrive_out = kept\neidrive_time_limit = 1.5\neidrive_channel = drives/late.yaml\n"
        "eidrive_criterion = drives/slow.yaml\n"
    )
    (project.path / "drives" / "late.yaml").write_text("delay: {kind: constant, seconds: 0.2}")
    (project.path / "drives" / "slow.yaml").write_text("max_speed: {of: Ego, at_most: 90}")
    folder = project.mkdir("elsewhere")
    result = project.run(
        "env", "-C", str(folder), sys.executable, "-m", "pytest", "-p", "no:cacheprovider", str(project.path / "drives")
    )
    assert f"rootdir: {project.path}" in result.outlines
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines(["ended by its time limit after 1.50 s", "*storyboard: running at 1.50 s*"])
    (kept,) = (project.path / "kept" / "drives").rglob("result.json")
    settings = json.loads(kept.read_text(encoding="utf-8"))["settings"]
    assert settings["time_limit"] == 1.5
    assert settings["channel_profile"]["delay"]["seconds"] == 0.2
    assert [name for entry in settings["criteria"] for name in entry] == ["max_speed"]


@pytest.mark.process
@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("seeds", "0", "not a positive integer (got '0')"),
        ("success_rate", "1.5", "not a rate between 0 and 1 (got '1.5')"),
        ("max_runs", "some", "not a positive integer (got 'some')"),
        ("time_limit", "-1", "not a positive number of seconds (got '-1')"),
        ("wall_limit", "never", "not a positive number of seconds or none (got 'never')"),
        ("channel", " ,", "no channel is listed (got ',')"),
        ("channel", "idael", "no channel profile 'idael': neither a file nor in the library*did you mean 'ideal'?"),
        ("detector", "oracel", "unknown detector 'oracel'*did you mean 'oracle'?"),
        ("planner", "rout", "unknown planner 'rout'*did you mean 'route'?"),
        ("drive", "=stack", "no entity or stack is given (got '=stack')"),
        ("criterion", "{", "*not valid YAML*"),
        ("record", "failed", "not one of always, on-failure, never (got 'failed')"),
    ],
)
def test_invalid_ini_value_is_usage_error(project: pytest.Pytester, name: str, value: str, message: str) -> None:
    project.makeini(f"[pytest]\neidrive_{name} = {value}\n")
    result = project.runpytest_inprocess("drives", "-p", "no:cacheprovider")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    pattern = f"*ini option eidrive_{name}: {message}*".replace("[", "[[]")
    result.stderr.fnmatch_lines([pattern])


@pytest.mark.process
def test_invalid_option_value_is_usage_error(project: pytest.Pytester) -> None:
    for arguments, message in (
        (("--eidrive-detector", "lidra"), "*--eidrive-detector: unknown detector 'lidra'*"),
        (("--eidrive-criterion", "{colision: {of: Ego}}"), "*--eidrive-criterion: *'colision'*did you mean*collision*"),
        (("--eidrive-drive", "Ego=missing.yaml"), "*--eidrive-drive: no file 'missing.yaml'*"),
        (("--eidrive-time-limit", "0"), "*--eidrive-time-limit: not a positive number of seconds (got '0')"),
        (("--eidrive-out", ""), "*--eidrive-out: no value is given (got '')"),
    ):
        result = project.runpytest_inprocess("drives", *arguments, "-p", "no:cacheprovider")
        assert result.ret == pytest.ExitCode.USAGE_ERROR
        result.stderr.fnmatch_lines([message])
