"""Runs as tests that an extension aborts: all others finish, and the JUnit file is complete."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree

import pytest
from faulty_extensions import install, line_of, write_scenario

pytest_plugins = ["pytester"]
pytestmark = pytest.mark.timeout(600)
"""Hung runs last for the limit and the grace period, and several processes load the engine."""

LIMIT = 8
"""Wall limit of each run [s]; a valid run needs much less."""
FAULTS: dict[str, dict[str, str]] = {
    "hangs": {"detector": "hangs"},
    "exits": {"detector": "exits"},
    "nan": {"detector": "returns_nan"},
    "none": {"planner": "planner_none"},
    "criterion": {"criterion": "faulty: {fault: observe}"},
}
SOUND = [f"sound_{number}" for number in range(7)]


@pytest.fixture
def project(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> pytest.Pytester:
    """Return a project with scenarios of faulty extensions and valid scenarios."""
    monkeypatch.setenv("PYTHONPATH", str(install(pytester.mkdir("package"))), prepend=":")
    folder = pytester.mkdir("xosc")
    for name in SOUND:
        write_scenario(folder / f"{name}.xosc")
    for name, extensions in FAULTS.items():
        write_scenario(folder / f"{name}.xosc", **extensions)  # type: ignore[arg-type]
    pytester.makeini(f"[pytest]\neidrive_wall_limit = {LIMIT}\neidrive_without_criteria = pass\n")
    return pytester


def cases_of(junit: Path) -> dict[str, str]:
    """Return the failure of each case by its name without channel and seed; "" for a passed case."""
    cases = ElementTree.parse(junit).iter("testcase")
    return {
        str(case.get("name")).partition("[")[0].rpartition("/")[2]: "\n".join(
            f"{entry.tag}: {entry.get('message')}\n{entry.text}" for entry in case if entry.tag in ("failure", "error")
        )
        for case in cases
    }


@pytest.mark.process
def test_faulty_extensions_over_two_workers_do_not_affect_other_runs(project: pytest.Pytester) -> None:
    """5 of 12 runs end with an error of an extension, which the JUnit file names."""
    arguments = ("xosc", "-n", "2", "--junitxml", "junit.xml", "--eidrive-out", "runs", "-p", "no:cacheprovider")
    result = project.runpytest_subprocess(*arguments)
    result.assert_outcomes(passed=7, errors=5)
    cases = cases_of(project.path / "junit.xml")
    assert sorted(cases) == sorted([*FAULTS, *SOUND])
    assert not any(cases[name] for name in SOUND)
    code = re.escape(str(project.path / "package" / "faulty.py"))
    at = r"of station 'Ego' at t = 0\.000 s: "
    later = r"of station 'Ego' at t = 0\.500 s: "
    for name, expected in {
        "hangs": rf"{code}:\d+: detector 'hangs' \(faulty:Hangs\) {later}still running in detect after {LIMIT} s",
        "exits": rf"{code}:{line_of('sys.exit(0)')}: detector 'exits' \(faulty:Exits\) {later}SystemExit: 0",
        "nan": rf"detector 'returns_nan' \(faulty:ReturnsNaN\) {at}detect returned boxes with the value nan",
        "none": rf"planner 'planner_none' \(faulty:PlannerNone\) {at}plan returned None",
        "criterion": r"criterion 'faulty' \(faulty:FaultyCriterion\) at t = 0\.500 s: RuntimeError: this criterion",
    }.items():
        assert cases[name].startswith("error: ")
        assert re.search(expected, cases[name]), cases[name]
        assert "reproduce: eidrive run" in cases[name]
        assert "recording.partial.mcap" in cases[name]


@pytest.mark.process
def test_uninterruptible_run_of_worker_does_not_affect_other_runs(project: pytest.Pytester) -> None:
    """The worker is replaced, and its report names the extension and the line."""
    folder = project.mkdir("hung")
    write_scenario(folder / "native.xosc", detector="hangs_in_c")
    for name in SOUND[:3]:
        write_scenario(folder / f"{name}.xosc")
    arguments = ("hung", "-n", "1", "--junitxml", "junit.xml", "-p", "no:cacheprovider", "--eidrive-wall-limit", "6")
    project.runpytest_subprocess(*arguments).assert_outcomes(passed=3, errors=1)
    cases = cases_of(project.path / "junit.xml")
    code = project.path / "package" / "faulty.py"
    line = line_of("in detect")
    assert f"{code}:{line}: detector 'hangs_in_c' (faulty:HangsInC): still running in detect" in cases["native"]
    assert "crashed while running 'hung/native.xosc::hung/native[seed=1]'" in cases["native"]
    assert f"reproduce: eidrive run {folder / 'native.xosc'} --seed 1" in cases["native"]
    assert not any(cases[name] for name in SOUND[:3])


def test_wall_limit_option_overrides_ini_option(project: pytest.Pytester) -> None:
    project.makeini("[pytest]\neidrive_wall_limit = never\neidrive_without_criteria = pass\n")
    refused = project.runpytest("xosc/sound_0.xosc", "-p", "no:cacheprovider")
    refused.stderr.fnmatch_lines(
        ["*ini option eidrive_wall_limit: not a positive number of seconds or none (got 'never')*"]
    )
    sound = project.runpytest("xosc/sound_0.xosc", "--eidrive-wall-limit", "none", "-p", "no:cacheprovider")
    sound.assert_outcomes(passed=1)


def test_aborted_run_scenario_shows_lines_of_test_and_extension(project: pytest.Pytester) -> None:
    """Frames of the engine and of the plugin are hidden."""
    project.makepyfile(
        """
        import pytest
        from eidrive_scenario.api.common import ExtensionError

        @pytest.mark.scenario("xosc/exits")
        def test_exits(run_scenario):
            run_scenario()

        @pytest.mark.scenario("xosc/exits")
        def test_expected(run_scenario):
            with pytest.raises(ExtensionError) as caught:
                run_scenario()
            assert isinstance(caught.value.__cause__, SystemExit)
        """
    )
    result = project.runpytest_subprocess("-p", "no:cacheprovider", "--junitxml", "junit.xml")
    result.assert_outcomes(passed=1, failed=1)
    text = "\n".join(result.outlines)
    assert re.search(r"^>\s+run_scenario\(\)$", text, re.MULTILINE)
    assert f"faulty.py:{line_of('sys.exit(0)')}: detector 'exits' (faulty:Exits) of station 'Ego'" in text
    assert "reproduce: eidrive run" in text
    assert f"faulty.py:{line_of('sys.exit(0)')}: SystemExit" in text
    for file in ("simulation.py", "attribution.py", "fixture.py"):
        assert file not in text


@pytest.mark.process
def test_run_scenario_beyond_wall_limit_raises_error(project: pytest.Pytester) -> None:
    project.makepyfile(
        """
        import pytest
        from eidrive_scenario.api.common import WallLimitError

        def test_hangs(run_scenario):
            with pytest.raises(WallLimitError, match="the wall limit"):
                run_scenario("xosc/hangs.xosc", wall_limit=2)
        """
    )
    project.runpytest_subprocess("-p", "no:cacheprovider").assert_outcomes(passed=1)
