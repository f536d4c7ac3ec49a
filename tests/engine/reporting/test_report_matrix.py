"""Matrices of success rates, and replays of the runs of a report."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from report_table import listed_runs

from eidrive_scenario.experiments.reported_run import ReportedRun, parse_run
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.recording.recorder import Recorder
from eidrive_scenario.recording.run_files import RECORDING
from eidrive_scenario.reporting.notebook import write_replay
from eidrive_scenario.reporting.replay.page import write_replays
from eidrive_scenario.reporting.run_report.rates import parameter_matrix, scenario_matrix
from eidrive_scenario.reporting.run_report.report import write_run_report
from eidrive_scenario.reporting.run_report.reported_runs import read_runs
from eidrive_scenario.reporting.run_report.run_groups import group_runs

Play = Callable[..., list[Frame]]


def run(scenario: str, channel: str, seed: int, passed: bool, **parameters: str) -> ReportedRun:
    result: dict[str, Any] = {
        "scenario": scenario,
        "seed": seed,
        "channel": channel,
        "passed": passed,
        "end_reason": "stop trigger",
        "criteria": [{"name": "collision", "passed": passed}],
        "parameters": parameters,
        "trace_hash": f"{seed}",
        "run": seed if parameters else None,
    }
    return parse_run(result)


def stored_run(folder: Path, name: str, frames: list[Frame] | None, *, passed: bool = True, settings: str = "") -> Path:
    """Write the files of a run; without frames it has no recording. `settings` is their hash."""
    (folder / name).mkdir()
    result: dict[str, Any] = {"scenario": "street", "seed": 1, "channel": "ideal", "passed": passed}
    result["end_reason"] = "stop trigger"
    result |= {"criteria": [], "trace_hash": "0", "settings_sha256": settings}
    (folder / name / "result.json").write_text(json.dumps(result))
    if frames is not None:
        recorder = Recorder(folder / name / "recording.mcap", metadata={"scenario": "street", "seed": "1"})
        for frame in frames:
            recorder.observe(frame)
        recorder.close()
    return folder / name / "result.json"


def test_scenario_matrix_has_rate_per_scenario_and_channel() -> None:
    runs = [run("a", "ideal", seed, True) for seed in range(3)]
    runs += [run("a", "lossy", seed, seed == 0) for seed in range(4)]
    runs += [run("b", "ideal", seed, False) for seed in range(2)]
    matrix = scenario_matrix(group_runs(runs))
    assert matrix is not None
    assert matrix.columns == ("ideal", "lossy")
    rates = {name: [cell and (cell.successes, cell.trials) for cell in cells] for name, cells in matrix.rows}
    assert rates == {"a": [(3, 3), (1, 4)], "b": [(0, 2), None]}


def test_single_scenario_or_channel_has_no_matrix() -> None:
    assert scenario_matrix(group_runs([run("a", "ideal", 1, True), run("a", "lossy", 1, True)])) is None
    assert scenario_matrix(group_runs([run("a", "ideal", 1, True), run("b", "ideal", 1, True)])) is None


def test_parameter_matrix_sorts_values_as_numbers() -> None:
    runs = [
        run("a", "ideal", index, speed == "2", Speed=speed, Gap=gap)
        for index, (speed, gap) in enumerate(
            (speed, gap) for speed in ("10", "2") for gap in ("1.5", "0.5") for _ in range(3)
        )
    ]
    matrix = parameter_matrix(runs, ("Speed", "Gap"))
    assert matrix is not None
    assert matrix.columns == ("2", "10")
    assert [name for name, _ in matrix.rows] == ["0.5", "1.5"]
    assert [[cell and cell.share for cell in cells] for _, cells in matrix.rows] == [[1.0, 0.0], [1.0, 0.0]]


def test_parameter_matrix_distinguishes_large_numbers_of_small_differences() -> None:
    """Coordinates of a map projection: single ones that differ in the seventh digit, and ranges of 1 m."""
    single = [run("a", "ideal", n, n % 2 == 0, X=str(5812345.25 + n % 2)) for n in range(4)]
    matrix = parameter_matrix(single, ("X",))
    assert matrix is not None
    assert matrix.columns == ("5812345", "5812346")
    assert [cell and cell.successes for cell in matrix.rows[0][1]] == [2, 0]
    many = [run("a", "ideal", n, True, X=str(5812345 + n % 41 / 4)) for n in range(82)]
    matrix = parameter_matrix(many, ("X",))
    assert matrix is not None
    assert matrix.columns[:2] == ("5812345 … 5812346", "5812346 … 5812347")
    assert [cell and cell.trials for cell in matrix.rows[0][1]] == [8] * 9 + [10]


def test_drawn_parameters_have_no_matrix() -> None:
    runs = [run("a", "ideal", index, True, Speed=str(index + 0.5)) for index in range(6)]
    assert parameter_matrix(runs, ("Speed",)) is None
    assert parameter_matrix(runs, ("Speed", "Gap", "Mass")) is None


def test_report_links_replay_of_each_recorded_run(street: Play, tmp_path: Path) -> None:
    files = [stored_run(tmp_path, "a run", street(1)[:5]), stored_run(tmp_path, "bare", None)]
    runs, errors = read_runs(files)
    assert not errors
    linked, omitted = write_replays(runs, tmp_path / "out")
    assert not omitted
    runs_of_page = listed_runs(write_run_report(linked, tmp_path / "out"))
    assert [run["replay"] for run in runs_of_page] == ["replays/a%20run.html", ""]
    assert (tmp_path / "out" / "replays" / "a run.html").is_file()


def test_runs_of_equal_names_have_replays_of_their_own(street: Play, tmp_path: Path) -> None:
    (tmp_path / "x").mkdir()
    (tmp_path / "y").mkdir()
    files = [stored_run(tmp_path / part, "run", street(1)[:3]) for part in ("x", "y")]
    linked, _ = write_replays(read_runs(files)[0], tmp_path / "out")
    assert len({entry.replay for entry in linked}) == 2


def test_copies_of_a_run_share_one_replay(street: Play, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Run `a` is in two folders and in the store of a sweep; at most two replays are written."""
    monkeypatch.setattr("eidrive_scenario.reporting.replay.page.MOST", 2)
    files = [stored_run(tmp_path, name, street(1)[:3], settings=name[0]) for name in ("b", "a", "a copy")]
    runs, _ = read_runs(files)
    swept = runs[1].model_copy(update={"sweep": "s.db"})
    linked, omitted = write_replays([*runs, swept], tmp_path / "out")
    assert ([entry.replay for entry in linked], omitted) == (["replays/b.html", *["replays/a.html"] * 3], [])
    assert {path.name for path in (tmp_path / "out" / "replays").iterdir()} == {"a.html", "b.html", "three.js"}


def test_replays_of_a_report_share_one_file_of_three_js(street: Play, tmp_path: Path) -> None:
    files = [stored_run(tmp_path, name, street(1)[:3]) for name in ("a", "b")]
    linked, _ = write_replays(read_runs(files)[0], tmp_path / "out")
    folder = tmp_path / "out" / "replays"
    assert sorted(path.name for path in folder.iterdir()) == ["a.html", "b.html", "three.js"]
    alone = write_replay(files[0].with_name(RECORDING), tmp_path / "alone.html")
    shared = (folder / "three.js").read_text(encoding="utf-8")
    assert shared in alone.read_text(encoding="utf-8")
    for entry in linked:
        text = (tmp_path / "out" / entry.replay).read_text(encoding="utf-8")
        assert re.findall(r'src="([^"]*)"', text) == ["three.js"]
        assert "threeModules =" not in text
        assert len(text) < len(alone.read_text(encoding="utf-8")) - len(shared) + 100


def test_damaged_recording_is_reported_without_replay(tmp_path: Path) -> None:
    file = stored_run(tmp_path, "run", [])
    linked, omitted = write_replays(read_runs([file])[0], tmp_path / "out")
    assert [entry.replay for entry in linked] == [""]
    assert len(omitted) == 1
    assert "no readable frame" in omitted[0]


def test_failed_runs_have_replays_before_passed_ones(
    street: Play, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("eidrive_scenario.reporting.replay.page.MOST", 2)
    outcomes = {"a": True, "b": False, "c": True, "d": False}
    files = [stored_run(tmp_path, name, street(1)[:3], passed=passed) for name, passed in outcomes.items()]
    linked, omitted = write_replays(read_runs(files)[0], tmp_path / "out")
    assert [bool(entry.replay) for entry in linked] == [False, True, False, True]
    assert omitted == ["2 passed or later runs have no replay: `eidrive view` writes it"]
    _, omitted = write_replays(linked[:3], tmp_path / "out")
    assert omitted == ["1 passed or later run has no replay: `eidrive view` writes it"]


@pytest.mark.parametrize("field", ["folder", "replay"])
def test_result_cannot_set_fields_of_the_report(field: str) -> None:
    entry = parse_run({**run("a", "ideal", 1, True).model_dump(), field: "javascript:alert(1)"})
    assert not getattr(entry, field)
