"""Reports of the stores of sweeps: files of runs, curves, heat maps, tables, links and commands."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Sequence
from itertools import product
from pathlib import Path
from typing import Any

import pytest
from command_fixtures import Eidrive, eidrive
from lxml import html
from msgspec.structs import replace
from report_table import listed_runs

from eidrive_scenario.errors import SettingError
from eidrive_scenario.experiments.sweeps.store import ResultStore, StoredRun
from eidrive_scenario.reporting.report_files import report_files
from eidrive_scenario.reporting.run_report import report, reported_runs
from eidrive_scenario.reporting.run_report.rates import RANGES, levels_of
from eidrive_scenario.reporting.run_report.reported_runs import read_sweeps

__all__ = ["eidrive"]


def row(number: int, passed: bool, **point: str | float) -> StoredRun:
    """Return a run whose settings are those of its point."""
    result = {
        "channel": "ideal",
        "passed": passed,
        "end_reason": "stop trigger",
        "gap.passed": passed,
        "gap.value": 1.5,
        "gap.limit": 1.0,
        "gap.Ego": 1.5,
        "settings_sha256": f"{number}",
        "trace_hash": f"{number}",
    }
    options: dict[str, Any] = {name: point[name] for name in ("detector", "planner") if name in point}
    parameters: dict[str, Any] = {
        "parameters": {name: str(value) for name, value in point.items() if name not in options}
    }
    settings: dict[str, Any] = {**parameters, **options, "stations": {"Ego": options}}
    status = "passed" if passed else "failed"
    command = f"eidrive run s --seed {number}"
    return StoredRun(
        f"{number:064}", number, "s", None, number, status, dict(point), result, "", command, 0.1, json.dumps(settings)
    )


def grid(*axes: tuple[str, Sequence[str | float]], seeds: int = 1) -> Iterator[dict[str, Any]]:
    for _ in range(seeds):
        for values in product(*(values for _, values in axes)):
            yield dict(zip([name for name, _ in axes], values, strict=True))


def root_of(page: Path) -> Any:
    return html.fromstring(page.read_text(encoding="utf-8"))


def page_of(folder: Path, runs: Sequence[StoredRun]) -> Any:
    """Write a store with runs and return the root of its report."""
    with ResultStore.open(folder / "s.db", {}) as store:
        store.add(*runs)
    return root_of(report_files([folder / "s.db"], folder / "report"))


def tables(page: Any) -> list[list[list[str]]]:
    return [
        [[" ".join(" ".join(map(str, cell.itertext())).split()) for cell in line] for line in table.iter("tr")]
        for table in page.iterfind(".//table[@class='matrix']")
    ]


def test_sweep_with_out_keeps_recordings_of_failed_runs(eidrive: Eidrive, scenario: Path, tmp_path: Path) -> None:
    store = tmp_path / "results" / "s.db"
    options: list[str | Path] = ["--vary", "Speed=10,30", "--seeds", "1-2", "--store", store, "--workers", "1"]
    done = eidrive("sweep", scenario, *options, "--out", tmp_path / "kept", "--record", "on-failure")
    assert done.exit_code == 0, done.output
    with ResultStore.read(store) as opened:
        folders = {run.point["Speed"]: (store.parent / run.result["folder"]).resolve() for run in opened.runs()}
    assert {folder.parent for folder in folders.values()} == {(tmp_path / "kept").resolve()}
    assert (folders[30] / "recording.mcap").is_file()
    assert (folders[10] / "result.json").is_file()
    assert not (folders[10] / "recording.mcap").exists()

    printed = eidrive("report", store, "--out", tmp_path / "report")
    assert printed.exit_code == 0, printed.output
    page = root_of(Path(printed.stdout.strip()))
    assert len(page.findall(".//svg[@class='chart']")) == 1
    assert tables(page) == [
        [["Speed", "10", "30"], ["none", "100 % 2/2 0.34 … 1.00", "0 % 0/2 0.00 … 0.66"]],
    ]
    runs = listed_runs(Path(printed.stdout.strip()))
    links = [run["replay"] for run in runs if run["replay"]]
    assert len(links) == 2
    assert all((tmp_path / "report" / link).is_file() for link in links)
    assert f"eidrive run {scenario} --param Speed=30 --seed 2" in [run["command"] for run in runs]
    assert "Ego drove up to 30.00 m/s" in page.text_content(), "the reason of the kept result"


def test_sweep_of_a_distribution_has_a_curve_over_its_parameter(
    eidrive: Eidrive, distribution: Path, tmp_path: Path
) -> None:
    """Speeds 10, 30 and 50: below the limit of 20, above it, and excluded."""
    assert eidrive("sweep", distribution, "--store", tmp_path / "s.db", "--workers", "1").exit_code == 0
    page = root_of(report_files([tmp_path / "s.db"], tmp_path / "report"))
    assert page.xpath("//h3[contains(., 'over Speed')]")
    assert tables(page)[0] == [["Speed", "10", "30"], ["none", "100 % 1/1 0.21 … 1.00", "0 % 0/1 0.00 … 0.79"]]


def test_record_without_out_is_invalid_input(eidrive: Eidrive, scenario: Path, tmp_path: Path) -> None:
    done = eidrive("sweep", scenario, "--store", tmp_path / "s.db", "--record", "never")
    assert done.exit_code == 2
    assert "--record without --out has no effect" in done.stderr


def test_warnings_of_runs_without_files_are_counted(tmp_path: Path) -> None:
    """A store has the number of warnings of each run, not their texts."""
    runs = [row(number, True, Speed=number) for number in (1, 2, 3)]
    for run, count in zip(runs, (1, 1, 0), strict=True):
        run.result["warnings"] = count
    text = page_of(tmp_path, runs).text_content()
    assert "2 runs have warnings" in text
    assert f"2 runs: 1 warning, printed by the command of the run (such as {runs[0].command})" in text


def test_metrics_that_end_like_columns_of_criteria_remain_metrics(tmp_path: Path) -> None:
    monitors = {"monitor.door.passed": 1.0, "monitor.speed.limit": 0.0}
    run = row(1, True)
    with ResultStore.open(tmp_path / "s.db", {}) as store:
        store.add(replace(run, result={**run.result, **monitors}))
    (reported,), _ = read_sweeps([tmp_path / "s.db"])
    assert [criterion.name for criterion in reported.criteria] == ["gap"]
    assert reported.metrics == {"gap.Ego": 1.5, **monitors}


def test_missing_files_of_kept_runs_leave_the_numbers(tmp_path: Path) -> None:
    kept = row(1, True, Speed=5)
    kept.result["folder"] = "gone"
    page = page_of(tmp_path, [kept, row(2, False, Speed=6)])
    assert "2 runs: 1 passed, 1 failed." in page.text_content()


def test_two_numbers_have_a_heat_map_with_intervals_and_a_table(tmp_path: Path) -> None:
    points = [*grid(("Speed", (5, 7.5)), ("Gap", (1, 2, 3)), seeds=2)][:-1]
    runs = [row(number, point["Speed"] == 5 or number == 4, **point) for number, point in enumerate(points)]
    page = page_of(tmp_path, runs)
    (svg,) = page.iterfind(".//svg[@class='map']")
    tips = [str(title.text) for title in svg.iterfind("rect/title")]
    assert len(tips) == 6
    assert tips[0] == "Speed 5, Gap 1: 2 of 2 passed, 95 % interval 0.34 to 1.00"
    assert "Speed 7.5, Gap 2: 1 of 2 passed, 95 % interval 0.09 to 0.91" in tips
    assert "Speed 7.5, Gap 3: 0 of 1 passed, 95 % interval 0.00 to 0.79" in tips
    (table,) = tables(page)
    assert [line[0] for line in table] == ["Gap \\ Speed", "3", "2", "1"], "upwards, as in the map"
    assert table[2] == ["2", "100 % 2/2 0.34 … 1.00", "50 % 1/2 0.09 … 0.91"]


def test_heat_map_cells_lie_at_their_values(tmp_path: Path) -> None:
    """Columns at 0, 1 and 3: borders halfway between neighbors, and the outer ones as far from their values."""
    page = page_of(tmp_path, [row(n, True, **point) for n, point in enumerate(grid(("A", (0, 1, 3)), ("B", (0, 1))))])
    cells = {
        str(cell.findtext("title")).split(":")[0]: [float(str(cell.get(key))) for key in ("x", "y", "width", "height")]
        for cell in page.iterfind(".//svg[@class='map']/rect")
    }
    first, second, third = (cells[f"A {value}, B 0"] for value in (0, 1, 3))
    assert second[2] / first[2] == pytest.approx(1.5, rel=0.01)
    assert third[2] / first[2] == pytest.approx(2.0, rel=0.01)
    assert second[0] == pytest.approx(first[0] + first[2], abs=0.05)
    above = cells["A 0, B 1"]
    assert above[1] + above[3] == pytest.approx(first[1], abs=0.05)


def test_texts_and_options_of_axes_are_columns_of_the_matrix(tmp_path: Path) -> None:
    points = grid(("detector", ("oracle", "ssd")), ("Speed", (5, 6)), seeds=2)
    runs = [row(number, point["detector"] == "oracle", **point) for number, point in enumerate(points)]
    page = page_of(tmp_path, runs)
    (table,) = tables(page)
    assert table == [
        ["Speed", "5", "6"],
        ["ideal · detector: oracle", *["100 % 2/2 0.34 … 1.00"] * 2],
        ["ideal · detector: ssd", *["0 % 0/2 0.00 … 0.66"] * 2],
    ]
    legend = [str(entry.text_content()).strip() for entry in page.iterfind(".//div[@class='legend']/span")]
    assert legend == ["ideal · detector: oracle", "ideal · detector: ssd"]


def test_three_numbers_have_a_heat_map_per_pair(tmp_path: Path) -> None:
    points = grid(("A", (1, 2)), ("B", (1, 2)), ("C", (1, 2)))
    page = page_of(tmp_path, [row(number, True, **point) for number, point in enumerate(points)])
    assert [table[0][0] for table in tables(page)] == ["B \\ A", "C \\ A", "C \\ B"]
    assert [table[1][1] for table in tables(page)] == ["100 % 2/2 0.34 … 1.00"] * 3
    assert "Combined over all values of C." in page.text_content()


def test_figures_of_heat_maps_are_vectors_named_by_settings(tmp_path: Path) -> None:
    points = [*grid(("planner", ("behavior", 60 * "ü")), ("A", (1, 2)), ("B", (1, 2)))]
    with ResultStore.open(tmp_path / "s.db", {}) as store:
        store.add(*(row(number, True, **point) for number, point in enumerate(points)))
    report_files([tmp_path / "s.db"], tmp_path / "report", figures=tmp_path / "figures")
    names = sorted(path.name for path in (tmp_path / "figures").iterdir())
    assert names == [f"s-A-B-ideal_planner_{name}.{end}" for name in ("behavior", 60 * "ü") for end in ("pdf", "svg")]
    for name in names[:2]:
        content = (tmp_path / "figures" / name).read_bytes()
        assert not re.search(rb"<image|/Subtype\s*/Image", content), "an image in a vector figure"


def test_many_values_are_combined_to_ranges_of_equal_width(tmp_path: Path) -> None:
    with ResultStore.open(tmp_path / "s.db", {}) as store:
        store.add(*(row(number, True, Speed=number / 4) for number in range(41)))
    runs, _ = read_sweeps([tmp_path / "s.db"])
    levels = levels_of(runs, "Speed")
    assert levels is not None
    assert levels.labels[0] == "0 … 1"
    assert levels.centers == tuple(value + 0.5 for value in range(10))
    counts = [sum(levels.index(run) == place for run in runs) for place in range(RANGES)]
    assert counts == [4] * 9 + [5], "the last range contains the largest value"


def test_runs_without_verdict_are_counted_by_reason(tmp_path: Path) -> None:
    invalid = [
        StoredRun(f"x{n}", n, "s", None, n, "invalid", {}, {}, "no such road\nline 2", f"run {n}", 0.1) for n in (8, 9)
    ]
    with ResultStore.open(tmp_path / "s.db", {}) as store:
        store.add(row(1, True, Speed=5), *invalid)
    warnings: list[str] = []
    page = report_files([tmp_path / "s.db"], tmp_path, warn=warnings.append)
    assert warnings == [f"{tmp_path / 's.db'}: 2 invalid: no such road (such as run 8)"]
    text = root_of(page).text_content()
    assert "2 invalid: no such road" in text
    assert "1 run: " in text


def test_store_without_verdict_or_other_file_is_invalid_input(tmp_path: Path) -> None:
    with ResultStore.open(tmp_path / "s.db", {}):
        pass
    with pytest.raises(SettingError, match=r"no run in .*s\.db"):
        report_files([tmp_path / "s.db"], tmp_path)
    (tmp_path / "other.db").write_bytes(b"SQLite format 3\0 and more")
    with pytest.raises(SettingError, match=r"other\.db"):
        report_files([tmp_path / "other.db"], tmp_path)


def test_shards_with_equal_runs_are_combined(tmp_path: Path) -> None:
    for name, numbers in (("a.db", (1, 2)), ("b.db", (2, 3))):
        with ResultStore.open(tmp_path / name, {}) as store:
            store.add(*(row(number, True, Speed=number) for number in numbers))
    runs, _ = read_sweeps([tmp_path / "a.db", tmp_path / "b.db"])
    assert sorted(run.seed for run in runs) == [1, 2, 3]


def test_sweep_lists_failed_runs_first(tmp_path: Path) -> None:
    text = page_of(tmp_path, [row(number, number != 4, Speed=number % 2) for number in range(6)]).text_content()
    assert "6 runs: 5 passed, 1 failed." in text
    runs = listed_runs(tmp_path / "report" / "report.html")
    assert [run["seed"] for run in runs] == [4, 0, 1, 2, 3, 5]
    assert runs[0]["criteria"] == {"gap": (False, 1.5, 1, "", "1.5, limit 1")}


def test_overview_of_many_settings_shows_those_with_the_lowest_rates(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(report, "MOST_GROUPS", 2)
    page = page_of(tmp_path, [row(number, number > 2, detector=f"d{number}") for number in range(1, 6)])
    (table,) = page.iterfind(".//table[@class='overview']")
    assert [str(line.text_content()) for line in table.iterfind(".//div[@class='setting']")] == [
        "detector: d1",
        "detector: d2",
    ]
    assert "3 more combinations of settings" in page.text_content()


def test_too_large_sweep_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reported_runs, "MOST_RUNS", 2)
    with pytest.raises(SettingError, match="more than 2 runs"):
        page_of(tmp_path, [row(number, True, Speed=number) for number in range(3)])
