"""Report of many results."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

import pytest
from lxml import html

from eidrive_scenario import reporting
from eidrive_scenario.errors import InputError
from eidrive_scenario.experiments.single_run import run_and_save
from eidrive_scenario.reporting.report_files import report_files
from eidrive_scenario.reporting.run_report.report import write_report
from eidrive_scenario.simulation import RunSettings


def result(seed: int, channel: str, passed: bool, **changes: Any) -> dict[str, Any]:
    verdict = {
        "name": "min_distance",
        "passed": passed,
        "value": 4.2 if passed else 0.0,
        "limit": 3.5,
        "unit": "m",
        "reason": "" if passed else "Ego and <Incoming> came as near as 0.00 m at 3.10 s",
    }
    run = {
        "scenario": "coop/scenario_1",
        "seed": seed,
        "channel": channel,
        "passed": passed,
        "end_reason": "stop trigger",
        "criteria": [verdict],
        "metrics": {"min_distance.Ego.Incoming.box": 1.0 + seed},
        "trace_hash": "00",
        "simulated_s": 12.5,
        "wall_s": 0.3,
    }
    return {**run, **changes}


def rows(page: Path) -> list[list[str]]:
    return [
        [" ".join(str(cell.xpath("string()")).split()) for cell in row.iterfind("td")]
        for row in html.fromstring(page.read_text(encoding="utf-8")).iterfind(".//tbody/tr")
    ]


def test_report_overview_has_one_row_per_scenario_and_channel(tmp_path: Path) -> None:
    results = [result(seed, "ideal", True) for seed in (2, 1)] + [result(1, "none", False)]
    page = write_report(results, tmp_path)
    assert page == tmp_path / "report.html"
    overview = rows(page)[:2]
    assert overview[0] == ["coop/scenario_1", "ideal", "2/2", "0.34 … 1.00", "2.50 (2.00 … 3.00)"]
    assert overview[1] == ["coop/scenario_1", "none", "0/1", "0.00 … 0.79", "2.00"]


def test_report_shows_verdict_and_reason_of_each_run(tmp_path: Path) -> None:
    page = write_report([result(3, "none", False), result(1, "none", True)], tmp_path / "page.html")
    assert page.name == "page.html"
    passed, failed = rows(page)[1:]
    assert passed == ["1", "passed", "min_distance", "4.20 m", "3.50 m", "", "stop trigger", "12.50"]
    assert failed[:2] == ["3", "failed"]
    assert failed[5] == "Ego and <Incoming> came as near as 0.00 m at 3.10 s"


def test_report_counts_run_at_time_limit_as_unfinished(tmp_path: Path) -> None:
    page = write_report(
        [result(1, "none", False, end_reason="time limit", criteria=[]), result(2, "none", True)], tmp_path
    )
    text = html.fromstring(page.read_text(encoding="utf-8")).findtext(".//p/span[@class='broken']")
    assert text == "1 did not finish"


def warnings_of(page: Path) -> list[str]:
    """Return the summary and the lines of the section about warnings."""
    sections = html.fromstring(page.read_text(encoding="utf-8")).iterfind(".//details")
    return [
        " ".join(str(part.text).split())
        for section in sections
        if "warnings" in str(section.findtext("summary"))
        for part in section
    ]


def test_report_lists_each_warning_once_with_number_and_command_of_runs(tmp_path: Path) -> None:
    """A warning counts once for each run; the copy of a run does not count."""
    often, rare = "the time step is <0.5> s", "an event never started"
    runs = [
        result(1, "none", True, warnings=[rare, often, often], command="eidrive run a --seed 1"),
        result(2, "none", True, warnings=[often], command="eidrive run a --seed 2"),
        result(3, "none", True, warnings=[]),
    ]
    runs = [{**run, "settings_sha256": f"{number:064}"} for number, run in enumerate(runs)]
    page = write_report([*runs, runs[1]], tmp_path)
    assert warnings_of(page) == [
        "2 runs have warnings",
        f"2 runs: {often} (such as eidrive run a --seed 1)",
        f"1 run: {rare} (such as eidrive run a --seed 1)",
    ]
    assert warnings_of(write_report(runs[2:], tmp_path / "none")) == []


def test_report_lists_most_frequent_warnings_and_counts_the_others(tmp_path: Path) -> None:
    rare = [f"warning {number}" for number in range(120)]
    runs = [result(1, "none", True, warnings=rare), result(2, "none", True, warnings=["frequent"])]
    summary, first, *others, last = warnings_of(write_report([*runs, {**runs[1], "seed": 3}], tmp_path))
    assert (summary, first) == ("3 runs have warnings", "2 runs: frequent")
    assert len(others) == 99
    assert last == "21 more in the results of the runs"


def test_report_of_result_with_invalid_warnings_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="warnings"):
        write_report([result(1, "none", True, warnings=3)], tmp_path)


def test_report_omits_null_metrics(tmp_path: Path) -> None:
    results = [result(1, "ideal", True, metrics={"ttc": None}), result(2, "ideal", True, metrics={"ttc": 1.5})]
    assert rows(write_report(results, tmp_path))[0][-1] == "1.50"


def test_replay_of_run_folder_with_undecodable_name_is_linked(tmp_path: Path) -> None:
    folder = Path(os.fsdecode(os.fsencode(tmp_path) + b"/r\xffn"))
    try:
        run_and_save("coop/scenario_1", settings=RunSettings(time_limit=0.5), out=folder)
    except OSError:
        pytest.skip("this file system takes no such name")
    page = report_files([tmp_path], tmp_path / "report.html")
    assert b'href="replays/r%FFn.html"' in page.read_bytes()
    assert (tmp_path / "replays" / f"{folder.name}.html").is_file()


def test_report_of_invalid_or_no_result_raises_input_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="result: 'scenario': field required"):
        write_report([{"seed": 1, "passed": True, "end": ""}], tmp_path)
    with pytest.raises(InputError, match="no result to report"):
        write_report([], tmp_path)


def test_report_has_no_external_resources(tmp_path: Path) -> None:
    text = write_report([result(1, "ideal", True)], tmp_path).read_text(encoding="utf-8")
    assert "http" not in text
    assert "<link" not in text
    assert "src=" not in text


def test_report_shows_distances_first_and_omits_times(tmp_path: Path) -> None:
    metrics = {"collision.time": 3.0, "collision.count": 1.0, "a": 1.0, "b": 2.0, "min_distance.A.B.box": 0.5, "c": 0.0}
    page = write_report([result(1, "ideal", False, metrics=metrics)], tmp_path)
    heads = [head.text for head in html.fromstring(page.read_text(encoding="utf-8")).iterfind(".//thead/tr/th")][4:8]
    assert heads == ["min_distance A B box [m]", "collision count", "a", "b"]


def test_report_of_distribution_shows_varied_parameters(tmp_path: Path) -> None:
    runs = [
        result(1, "none", True, run=number, parameters={"Speed": speed, "End": "3"})
        for number, speed in ((11, "30"), (2, "20"))
    ]
    page = write_report(runs, tmp_path)
    assert [row[:4] for row in rows(page)[1:]] == [["2", "20", "1", "passed"], ["11", "30", "1", "passed"]]
    headings = [cell.text for cell in html.fromstring(page.read_text(encoding="utf-8")).iterfind(".//th")]
    assert "Speed" in headings
    assert "End" not in headings


def test_report_metrics_have_units_of_criteria(tmp_path: Path) -> None:
    metrics = {"min_distance.Ego.Incoming.box": 1.0, "collision.impact_speed": 2.0, "collision.count": 1.0}
    text = write_report([result(1, "ideal", True, metrics=metrics)], tmp_path).read_text(encoding="utf-8")
    assert "min_distance Ego Incoming box [m]<br>" in text
    assert "collision impact_speed [m/s]<br>" in text
    assert "collision count<br>" in text


def test_style_defines_all_colors_for_both_schemes() -> None:
    templates = Path(reporting.__file__).parent / "templates"
    style = (templates / "style.css").read_text(encoding="utf-8")
    light, dark = re.findall(r":root \{(.*?)\}", style, re.DOTALL)[:2]
    named = [re.findall(r"(--\w+): #", colors) for colors in (light, dark)]
    assert named[0] == named[1]
    rest = style.replace(light, "").replace(dark, "")
    pages = [rest, *(path.read_text(encoding="utf-8") for path in templates.glob("*.jinja"))]
    fixed = re.compile(r"(?:color|background|border)[^;:}]*:[^;}]*#[0-9a-f]{3}")
    assert not [found for page in pages for found in fixed.findall(page)]
    assert {name for page in pages for name in re.findall(r"var\((--\w+)", page)} <= {*named[0], "--arm", "--share"}
