"""Report of many results."""

from __future__ import annotations

import os
import re
import subprocess
from pathlib import Path
from typing import Any

import pytest
from lxml import html
from report_table import listed_runs, report_data

from eidrive_scenario import reporting
from eidrive_scenario.errors import InputError
from eidrive_scenario.experiments.single_run import run_and_save
from eidrive_scenario.reporting.report_files import report_files
from eidrive_scenario.reporting.run_report.report import write_run_report
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


def overview(page: Path) -> list[list[str]]:
    """Return the rows of the table of settings."""
    return [
        [" ".join(" ".join(map(str, cell.itertext())).split()) for cell in row.iterfind("td")]
        for row in html.fromstring(page.read_text(encoding="utf-8")).iterfind(".//table[@class='overview']/tbody/tr")
    ]


def test_report_overview_has_one_row_per_scenario_and_channel(tmp_path: Path) -> None:
    results = [result(seed, "ideal", True) for seed in (2, 1)] + [result(1, "none", False)]
    page = write_run_report(results, tmp_path)
    assert page == tmp_path / "report.html"
    assert overview(page) == [
        ["coop/scenario_1", "ideal", "2/2", "0.34 … 1.00", "2.50 2.00 … 3.00"],
        ["coop/scenario_1", "none", "0/1", "0.00 … 0.79", "2.00"],
    ]


def test_report_shows_verdict_and_reason_of_each_run(tmp_path: Path) -> None:
    page = write_run_report([result(3, "none", False), result(1, "none", True)], tmp_path / "page.html")
    assert page.name == "page.html"
    failed, passed = listed_runs(page)
    assert [failed[title] for title in ("outcome", "seed", "end", "simulated [s]")] == [
        "failed",
        3,
        "stop trigger",
        12.5,
    ]
    reason = "Ego and <Incoming> came as near as 0.00 m at 3.10 s"
    assert failed["criteria"] == {"min_distance": (False, 0, 3.5, "m", reason)}
    assert (passed["outcome"], passed["seed"]) == ("passed", 1)
    assert passed["criteria"] == {"min_distance": (True, 4.2, 3.5, "m", "")}


def verdict(name: str, passed: bool, **values: Any) -> dict[str, Any]:
    return {"name": name, "passed": passed, **values}


TIME_LIMIT: dict[str, Any] = {"end_reason": "time limit", "criteria": []}


@pytest.mark.parametrize(
    ("runs", "headline"),
    [
        ([result(1, "none", True)], "The run passed"),
        ([result(1, "none", False)], "The run failed: min_distance"),
        ([result(seed, "none", True) for seed in range(3)], "All 3 runs passed"),
        ([result(1, "none", False, **TIME_LIMIT), result(2, "none", True)], "1 of 2 runs did not finish"),
        (
            [
                result(1, "none", False, criteria=[verdict("speed", False), verdict("collision", False)]),
                result(2, "none", False, criteria=[verdict("speed", True), verdict("collision", False)]),
                result(3, "none", False, criteria=[]),
                result(4, "none", False, **TIME_LIMIT),
                result(5, "none", True),
            ],
            "2 of 5 runs failed: collision (2), speed (1); 1 did not finish; 1 was not judged",
        ),
        (
            [result(1, "none", False, criteria=[verdict(name, False) for name in "abcde"])],
            "The run failed: a, b, c, d, 1 more criterion",
        ),
        (
            [result(1, "none", False, criteria=[verdict(name, False) for name in "abcdef"]), result(2, "none", True)],
            "1 of 2 runs failed: a (1), b (1), c (1), d (1), 2 more criteria",
        ),
    ],
)
def test_report_is_titled_by_what_failed(runs: list[dict[str, Any]], headline: str, tmp_path: Path) -> None:
    tree = html.fromstring(write_run_report(runs, tmp_path).read_text(encoding="utf-8"))
    assert (tree.findtext(".//h1"), tree.findtext(".//title")) == (headline, headline)


def test_report_states_version_date_machine_and_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.argv", ["/usr/bin/eidrive", "report", "my runs"])
    monkeypatch.chdir(tmp_path)
    settings = {"versions": {"eidrive-scenario": "0.1.9"}}
    page = write_run_report([result(1, "none", True, settings=settings)], tmp_path)
    tree = html.fromstring(page.read_text(encoding="utf-8"))
    entries = {str(entry.findtext("dt")): str(entry.xpath("string(dd)")) for entry in tree.iterfind(".//dl/div")}
    assert list(entries) == ["version", "date", "machine", "command"]
    assert (entries["version"], entries["command"]) == ("eidrive-scenario 0.1.9", "eidrive report 'my runs'")
    assert re.fullmatch(r"\d{4}-\d\d-\d\d \d\d:\d\d[+-]\d\d:\d\d", entries["date"])


def test_report_in_a_repository_states_its_commit_and_executes_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def git(*arguments: str) -> str:
        user = ("-c", "user.name=a", "-c", "user.email=a@example.org")
        return subprocess.run(
            ["git", *user, *arguments], cwd=tmp_path, check=True, capture_output=True, text=True
        ).stdout

    git("init", "--quiet")
    (tmp_path / "file").write_text("1")
    (tmp_path / ".gitattributes").write_text("* filter=hostile\n")
    git("add", ".")
    git("commit", "--quiet", "--message", "first")
    commit = git("rev-parse", "HEAD")[:10]
    monkeypatch.chdir(tmp_path)
    page = write_run_report([result(1, "none", True)], tmp_path / "out")
    assert f"<dd>{commit}</dd>" in page.read_text(encoding="utf-8")
    git("config", "filter.hostile.clean", f"touch '{tmp_path}/executed'; cat")
    (tmp_path / "file").write_text("2")  # as long as before, or git knows the change without the content
    write_run_report([result(1, "none", True)], tmp_path / "out")
    assert not (tmp_path / "executed").exists()
    git("status")
    assert (tmp_path / "executed").exists(), "commands that compare files execute the filter"


def test_page_without_script_lists_runs_that_did_not_pass(tmp_path: Path) -> None:
    runs = [result(seed, "none", seed > 2) for seed in range(1, 5)] + [result(9, "none", False, **TIME_LIMIT)]
    (summary,) = html.fromstring(write_run_report(runs, tmp_path).read_text(encoding="utf-8")).iterfind(".//noscript")
    assert str(summary.xpath("string(p)")) == "5 runs: 2 passed, 1 did not finish, 2 failed."
    rows = [[str(cell.xpath("string()")) for cell in row] for row in summary.iterfind(".//tbody/tr")]
    reason = "min_distance Ego and <Incoming> came as near as 0.00 m at 3.10 s"
    assert [row[2:5] for row in rows] == [["1", "failed", reason], ["2", "failed", reason], ["9", "did not finish", ""]]


def test_data_of_report_cannot_end_its_element(tmp_path: Path) -> None:
    attack = "</script><script>alert(1)</script><!--"
    runs = [result(1, attack, False, scenario=attack, command=attack, end_reason=attack, settings={attack: attack})]
    page = write_run_report(runs, tmp_path)
    assert page.read_text(encoding="utf-8").count("<script") == 2
    assert listed_runs(page)[0]["settings of the run"] == {attack: attack}


def test_settings_metrics_and_texts_of_equal_runs_are_stored_once(tmp_path: Path) -> None:
    """Runs that differ by their seed add no settings to the data, but the changed one."""
    settings = {f"setting {number}": f"value {number}" for number in range(100)}
    runs = [result(seed, "none", True, settings={**settings, "seed": seed}) for seed in range(50)]
    page = write_run_report(runs, tmp_path)
    data = report_data(page)
    assert data["settings"][0] == [0]
    assert {len(changes) for changes in data["settings"][1:]} == {3}
    assert data["texts"].count("value 7") == 1
    assert listed_runs(page)[49]["settings of the run"] == {**settings, "seed": "49"}


def test_numbers_that_json_and_javascript_lack(tmp_path: Path) -> None:
    """Infinite and undefined numbers are absent, and seeds beyond 2^53 are texts."""
    metrics = {"far": float("inf"), "undefined": float("nan"), "exact": 0.1234567891, "large": 1e300}
    runs = [result(10**30, "none", False, metrics=metrics, criteria=[verdict("gap", False, value=float("inf"))])]
    (run,) = listed_runs(write_run_report(runs, tmp_path))
    assert run["metrics"] == {"far": None, "undefined": None, "exact": 0.123457, "large": 1e300}
    assert run["criteria"]["gap"][1] is None
    assert run["seed"] == "1" + 30 * "0"


def test_criterion_without_reason_has_value_and_limit_as_reason(tmp_path: Path) -> None:
    """Stores of sweeps have no reasons."""
    runs = [result(1, "none", False, criteria=[verdict("gap", False, value=0.5, limit=1.0, unit="m")])]
    (run,) = listed_runs(write_run_report(runs, tmp_path))
    assert run["criteria"]["gap"][-1] == "0.50 m, limit 1.00 m"


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
    page = write_run_report([*runs, runs[1]], tmp_path)
    assert warnings_of(page) == [
        "2 runs have warnings",
        f"2 runs: {often} (such as eidrive run a --seed 1)",
        f"1 run: {rare} (such as eidrive run a --seed 1)",
    ]
    assert warnings_of(write_run_report(runs[2:], tmp_path / "none")) == []


def test_report_lists_most_frequent_warnings_and_counts_the_others(tmp_path: Path) -> None:
    rare = [f"warning {number}" for number in range(120)]
    runs = [result(1, "none", True, warnings=rare), result(2, "none", True, warnings=["frequent"])]
    summary, first, *others, last = warnings_of(write_run_report([*runs, {**runs[1], "seed": 3}], tmp_path))
    assert (summary, first) == ("3 runs have warnings", "2 runs: frequent")
    assert len(others) == 99
    assert last == "21 more in the results of the runs"


def test_report_of_result_with_invalid_warnings_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="warnings"):
        write_run_report([result(1, "none", True, warnings=3)], tmp_path)


def test_report_omits_null_metrics(tmp_path: Path) -> None:
    results = [result(1, "ideal", True, metrics={"ttc": None}), result(2, "ideal", True, metrics={"ttc": 1.5})]
    assert overview(write_run_report(results, tmp_path))[0][-1] == "1.50"


def test_replay_of_run_folder_with_undecodable_name_is_linked(tmp_path: Path) -> None:
    folder = Path(os.fsdecode(os.fsencode(tmp_path) + b"/r\xffn"))
    try:
        run_and_save("coop/scenario_1", settings=RunSettings(time_limit=0.5), out=folder)
    except OSError:
        pytest.skip("this file system takes no such name")
    page = report_files([tmp_path], tmp_path / "report.html")
    assert [run["replay"] for run in listed_runs(page)] == ["replays/r%FFn.html"]
    assert (tmp_path / "replays" / f"{folder.name}.html").is_file()


def test_report_of_invalid_or_no_result_raises_input_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="result: 'scenario': field required"):
        write_run_report([{"seed": 1, "passed": True, "end": ""}], tmp_path)
    with pytest.raises(InputError, match="no result to report"):
        write_run_report([], tmp_path)


def test_report_has_no_external_resources(tmp_path: Path) -> None:
    text = write_run_report([result(1, "ideal", True)], tmp_path).read_text(encoding="utf-8")
    assert "http" not in text
    assert "<link" not in text
    assert "src=" not in text


def test_report_shows_distances_first_and_omits_times(tmp_path: Path) -> None:
    metrics = {"collision.time": 3.0, "collision.count": 1.0, "a": 1.0, "b": 2.0, "min_distance.A.B.box": 0.5, "c": 0.0}
    page = write_run_report([result(1, "ideal", False, metrics=metrics)], tmp_path)
    tree = html.fromstring(page.read_text(encoding="utf-8"))
    heads = [head.text for head in tree.iterfind(".//table[@class='overview']/thead/tr/th")][4:8]
    assert heads == ["min_distance A B box [m]", "collision count", "a", "b"]


def test_report_of_distribution_shows_varied_parameters(tmp_path: Path) -> None:
    runs = [
        result(1, "none", True, run=number, parameters={"Speed": speed, "End": "3"})
        for number, speed in ((11, "30"), (2, "20"))
    ]
    page = write_run_report(runs, tmp_path)
    assert [(run["run"], run["Speed"]) for run in listed_runs(page)] == [(2, 20), (11, 30)]
    shown = [column["title"] for column in report_data(page)["columns"] if column["shown"]]
    assert shown == ["scenario", "run", "Speed"]
    assert "End" not in listed_runs(page)[0]


def test_report_metrics_have_units_of_criteria(tmp_path: Path) -> None:
    metrics = {"min_distance.Ego.Incoming.box": 1.0, "collision.impact_speed": 2.0, "collision.count": 1.0}
    text = write_run_report([result(1, "ideal", True, metrics=metrics)], tmp_path).read_text(encoding="utf-8")
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
    pages = [
        rest,
        *(path.read_text(encoding="utf-8") for path in (*templates.glob("*.jinja"), *templates.glob("report/*"))),
    ]
    fixed = re.compile(r"(?:color|background|border)[^;:}]*:[^;}]*#[0-9a-f]{3}")
    assert not [found for page in pages for found in fixed.findall(page)]
    assert {name for page in pages for name in re.findall(r"var\((--\w+)", page)} <= {
        *named[0],
        "--share",
        "--least",
    }
