"""Parameter value distributions as pytest items."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import pytest

# Imported here, as numpy loads once only in a process, and a run of pytester in this process forgets what it imported.
from eidrive_scenario.openscenario import load_distribution

pytest_plugins = ["pytester"]

PASSING_BY = Path(__file__).parents[2] / "data" / "passing_by.xosc"
DISTRIBUTION = """<OpenSCENARIO>
<FileHeader revMajor="1" revMinor="3" date="2026-01-31T12:00:00" description="a test" author="nobody"/>
<ParameterValueDistribution><ScenarioFile filepath="passing_by.xosc"/><Deterministic>
<DeterministicSingleParameterDistribution parameterName="OtherY">
{}
</DeterministicSingleParameterDistribution>
</Deterministic></ParameterValueDistribution></OpenSCENARIO>"""
CONSTRAINT = '<ConstraintGroup><ValueConstraint rule="lessThan" value="9"/></ConstraintGroup></ParameterDeclaration>'


def values(*texts: str) -> str:
    return f"<DistributionSet>{''.join(f'<Element value={text!r}/>' for text in texts)}</DistributionSet>"


@pytest.fixture
def vary(pytester: pytest.Pytester) -> Callable[[str], Path]:
    """Writes `vary.xosc`, which varies how far passing_by's cars are apart; the scenario wants less than 9 m."""

    def write(distribution: str) -> Path:
        text = PASSING_BY.read_text(encoding="utf-8")
        text = text.replace('parameterType="double" value="5.0"/>', f'parameterType="double" value="5.0">{CONSTRAINT}')
        (pytester.path / "passing_by.xosc").write_text(text, encoding="utf-8")
        path = pytester.path / "vary.xosc"
        path.write_text(DISTRIBUTION.format(distribution), encoding="utf-8")
        return path

    return write


def collected(pytester: pytest.Pytester, *arguments: str) -> list[str]:
    result = pytester.runpytest_inprocess("--collect-only", "-q", "-p", "no:cacheprovider", *arguments)
    return [line for line in result.outlines if "::" in line and "left out" not in line]


def test_one_item_for_each_run(pytester: pytest.Pytester, vary: Callable[[str], Path]) -> None:
    vary(values("5", "4.5", "roads/[town]::1.xodr"))
    items = ["run0-OtherY=5-seed1", "run1-OtherY=4.5-seed1", "run2-OtherY=_town_1.xodr-seed1"]
    assert collected(pytester, "vary.xosc") == [f"vary.xosc::vary[{item}]" for item in items]
    one = "vary.xosc::vary[run1-OtherY=4.5-ideal-seed2]"
    assert collected(pytester, one, "--eidrive-channel", "none,ideal", "--eidrive-seeds", "2") == [one]
    assert collected(pytester, "vary.xosc", "-k", "run0") == ["vary.xosc::vary[run0-OtherY=5-seed1]"]
    assert collected(pytester, ".") == [
        "passing_by.xosc::passing_by[seed1]",
        *(f"vary.xosc::vary[{item}]" for item in items),
    ]


def test_what_is_left_out_is_told(pytester: pytest.Pytester, vary: Callable[[str], Path]) -> None:
    path = vary('<DistributionRange stepWidth="0.01"><Range lowerLimit="0" upperLimit="8"/></DistributionRange>')
    assert len(load_distribution(path)) == 801
    result = pytester.runpytest_inprocess("--collect-only", "-q", "-p", "no:cacheprovider", "vary.xosc")
    assert len([line for line in result.outlines if "::" in line]) == 100
    told = "vary.xosc: {} of 801 runs are tests, {} are left out"
    result.stdout.fnmatch_lines([told.format(100, 701), "--eidrive-max-runs N takes more of them*"])
    result = pytester.runpytest_inprocess("--collect-only", "-q", "vary.xosc", "--eidrive-max-runs", "2")
    result.stdout.fnmatch_lines(["vary.xosc::vary?run0-OtherY=0-seed1?", told.format(2, 799)])
    everything = collected(pytester, "vary.xosc", "--eidrive-max-runs", "all")
    assert len(everything) == 801
    assert everything[-1] == "vary.xosc::vary[run800-OtherY=8-seed1]"


def test_nothing_is_told_where_nothing_is_left_out(pytester: pytest.Pytester, vary: Callable[[str], Path]) -> None:
    vary(values("5", "4"))
    result = pytester.runpytest_inprocess("--collect-only", "-q", "-p", "no:cacheprovider", "vary.xosc")
    result.stdout.no_fnmatch_line("*left out*")


def test_the_workers_of_xdist_tell_it_too(pytester: pytest.Pytester, vary: Callable[[str], Path]) -> None:
    vary(values("5", "4.5", "4"))
    arguments = ("vary.xosc", "--eidrive-max-runs", "2", "-n", "2", "-p", "no:cacheprovider")
    result = pytester.runpytest_subprocess(*arguments)
    result.assert_outcomes(passed=2)
    result.stdout.fnmatch_lines(["vary.xosc: 2 of 3 runs are tests, 1 are left out"])


def test_outcomes_and_what_is_noted(pytester: pytest.Pytester, vary: Callable[[str], Path]) -> None:
    path = vary(values("5", "0", "9"))
    arguments = ("vary.xosc", "--junitxml", "junit.xml", "--eidrive-out", "runs", "-rs", "-p", "no:cacheprovider")
    result = pytester.runpytest_subprocess(*arguments)
    result.assert_outcomes(passed=1, failed=1, skipped=1)
    result.stdout.fnmatch_lines(
        [
            "run 1 of passing_by failed with channel *, seed 1",
            "collision: Ego and Parked hit each other at 1.6* s at *",
            f"SKIPPED * ruled out by constraints: {path}:5: the parameter 'OtherY' is '9', outside its constraints;*",
        ]
    )
    result.stdout.no_fnmatch_line("*Traceback*")
    cases = {case.get("name"): case for case in ElementTree.parse(pytester.path / "junit.xml").iter("testcase")}
    properties = {
        entry.get("name"): entry.get("value") for entry in cases["vary[run0-OtherY=5-seed1]"].iter("property")
    }
    assert (properties["run"], properties["parameter.OtherY"], properties["seed"]) == ("0", "5", "1")
    kept = sorted(path.relative_to(pytester.path).as_posix() for path in pytester.path.glob("runs/**/result.json"))
    short = [re.sub(r"-[0-9a-f]{10}/", "/", path) for path in kept]
    assert short == [f"runs/vary/passing_by-none-run{run}-seed1/result.json" for run in (0, 1)]
    assert json.loads((pytester.path / kept[1]).read_text(encoding="utf-8"))["parameters"]["OtherY"] == "0"


def test_a_wrong_distribution_is_told_with_its_line(pytester: pytest.Pytester, vary: Callable[[str], Path]) -> None:
    path = vary('<DistributionRange stepWidth="0"><Range lowerLimit="0" upperLimit="8"/></DistributionRange>')
    result = pytester.runpytest_inprocess("vary.xosc", "-p", "no:cacheprovider")
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines([f"{path}:5: stepWidth is 0; give a number above zero"])
    result.stdout.no_fnmatch_line("*Traceback*")


def test_the_bound_must_count(pytester: pytest.Pytester, vary: Callable[[str], Path]) -> None:
    vary(values("5"))
    result = pytester.runpytest_inprocess("vary.xosc", "--eidrive-max-runs", "some")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(["*--eidrive-max-runs: 'some' is no number from 1 on"])
