"""Parameter value distributions as pytest items."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import pytest
from openscenario_xml import deterministic_xml, distribution_xml, single_xml, values_xml

# Imported here because pytester unloads modules after an in-process run, and numpy can be loaded only once.
from eidrive_scenario.openscenario import load_distribution

pytest_plugins = ["pytester"]

PASSING_BY = Path(__file__).parents[2] / "data" / "passing_by.xosc"
CONSTRAINT = '<ConstraintGroup><ValueConstraint rule="lessThan" value="9"/></ConstraintGroup></ParameterDeclaration>'


@pytest.fixture
def vary(pytester: pytest.Pytester) -> Callable[[str], Path]:
    """Return a function that writes `vary.xosc`, which varies the lateral distance; its constraint is below 9 m."""

    def write(distribution: str) -> Path:
        text = PASSING_BY.read_text(encoding="utf-8")
        text = text.replace('parameterType="double" value="5.0"/>', f'parameterType="double" value="5.0">{CONSTRAINT}')
        (pytester.path / "passing_by.xosc").write_text(text, encoding="utf-8")
        path = pytester.path / "vary.xosc"
        path.write_bytes(distribution_xml(deterministic_xml(distribution), scenario="passing_by.xosc"))
        return path

    return write


def collected(pytester: pytest.Pytester, *arguments: str) -> list[str]:
    result = pytester.runpytest_inprocess("--collect-only", "-q", "-p", "no:cacheprovider", *arguments)
    return [line for line in result.outlines if "::" in line and "omitted" not in line]


def test_distribution_yields_one_item_per_run(pytester: pytest.Pytester, vary: Callable[[str], Path]) -> None:
    vary(values_xml("OtherY", "5", "4.5", "roads/[town]::1.xodr"))
    items = ["run=0-OtherY=5-seed=1", "run=1-OtherY=4.5-seed=1", "run=2-OtherY=_town_1.xodr-seed=1"]
    assert collected(pytester, "vary.xosc") == [f"vary.xosc::vary[{item}]" for item in items]
    one = "vary.xosc::vary[run=1-OtherY=4.5-channel=ideal-seed=2]"
    assert collected(pytester, one, "--eidrive-channel", "none,ideal", "--eidrive-seeds", "2") == [one]
    assert collected(pytester, "vary.xosc", "-k", "run:0") == ["vary.xosc::vary[run=0-OtherY=5-seed=1]"]
    assert collected(pytester, ".") == [
        "passing_by.xosc::passing_by[seed=1]",
        *(f"vary.xosc::vary[{item}]" for item in items),
    ]


def test_omitted_runs_are_reported(pytester: pytest.Pytester, vary: Callable[[str], Path]) -> None:
    path = vary(
        single_xml(
            "OtherY", '<DistributionRange stepWidth="0.01"><Range lowerLimit="0" upperLimit="8"/></DistributionRange>'
        )
    )
    assert len(load_distribution(path)) == 801
    result = pytester.runpytest_inprocess("--collect-only", "-q", "-p", "no:cacheprovider", "vary.xosc")
    assert len([line for line in result.outlines if "::" in line]) == 100
    message = "vary.xosc: {} of 801 runs are tests, {} are omitted"
    result.stdout.fnmatch_lines([message.format(100, 701), "--eidrive-max-runs N selects more of them*"])
    result = pytester.runpytest_inprocess("--collect-only", "-q", "vary.xosc", "--eidrive-max-runs", "2")
    result.stdout.fnmatch_lines(["vary.xosc::vary?run=0-OtherY=0-seed=1?", message.format(2, 799)])
    everything = collected(pytester, "vary.xosc", "--eidrive-max-runs", "all")
    assert len(everything) == 801
    assert everything[-1] == "vary.xosc::vary[run=800-OtherY=8-seed=1]"


def test_distribution_without_omitted_runs_prints_no_report(
    pytester: pytest.Pytester, vary: Callable[[str], Path]
) -> None:
    vary(values_xml("OtherY", "5", "4"))
    result = pytester.runpytest_inprocess("--collect-only", "-q", "-p", "no:cacheprovider", "vary.xosc")
    result.stdout.no_fnmatch_line("*omitted*")


@pytest.mark.process
def test_omitted_runs_of_xdist_workers_are_reported(pytester: pytest.Pytester, vary: Callable[[str], Path]) -> None:
    vary(values_xml("OtherY", "5", "4.5", "4"))
    arguments = ("vary.xosc", "--eidrive-max-runs", "2", "-n", "1", "-p", "no:cacheprovider")
    result = pytester.runpytest_inprocess(*arguments)
    result.assert_outcomes(passed=2)
    result.stdout.fnmatch_lines(["vary.xosc: 2 of 3 runs are tests, 1 are omitted"])


def test_distribution_items_have_outcomes_and_properties(
    pytester: pytest.Pytester, vary: Callable[[str], Path]
) -> None:
    path = vary(values_xml("OtherY", "5", "0", "9"))
    arguments = ("vary.xosc", "--junitxml", "junit.xml", "--eidrive-out", "runs", "-rs", "-p", "no:cacheprovider")
    result = pytester.runpytest_inprocess(*arguments)
    result.assert_outcomes(passed=1, failed=1, skipped=1)
    result.stdout.fnmatch_lines(
        [
            "collision 1, limit 0, first violated at 1.6* s: Ego and Parked hit each other at 1.6* s at *",
            "run 1 of passing_by failed with channel *, seed 1",
            f"SKIPPED * excluded by constraints: {path}:6: parameter 'OtherY' is '9', outside its constraints;*",
        ]
    )
    result.stdout.no_fnmatch_line("*Traceback*")
    cases = {case.get("name"): case for case in ElementTree.parse(pytester.path / "junit.xml").iter("testcase")}
    properties = {
        entry.get("name"): entry.get("value") for entry in cases["vary[run=0-OtherY=5-seed=1]"].iter("property")
    }
    assert (properties["run"], properties["parameter.OtherY"], properties["seed"]) == ("0", "5", "1")
    kept = sorted(path.relative_to(pytester.path).as_posix() for path in pytester.path.glob("runs/**/result.json"))
    short = [re.sub(r"-[0-9a-f]{10}/", "/", path) for path in kept]
    assert short == [f"runs/vary/passing_by-none-run{run}-seed1/result.json" for run in (0, 1)]
    assert json.loads((pytester.path / kept[1]).read_text(encoding="utf-8"))["parameters"]["OtherY"] == "0"


def test_invalid_distribution_is_reported_with_its_line(pytester: pytest.Pytester, vary: Callable[[str], Path]) -> None:
    path = vary(
        single_xml(
            "OtherY", '<DistributionRange stepWidth="0"><Range lowerLimit="0" upperLimit="8"/></DistributionRange>'
        )
    )
    result = pytester.runpytest_inprocess("vary.xosc", "-p", "no:cacheprovider")
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines([f"{path}:6: stepWidth is 0; specify a number above zero"])
    result.stdout.no_fnmatch_line("*Traceback*")


def test_max_runs_option_of_text_is_usage_error(pytester: pytest.Pytester, vary: Callable[[str], Path]) -> None:
    vary(values_xml("OtherY", "5"))
    result = pytester.runpytest_inprocess("vary.xosc", "--eidrive-max-runs", "some")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(["*--eidrive-max-runs: not a positive integer (got 'some')"])
