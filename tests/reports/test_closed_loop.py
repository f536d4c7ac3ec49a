"""Table of learned detectors in closed loop."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

import pytest
from eidrive_reports import closed_loop
from eidrive_reports.closed_loop import ClosedLoopRun, jobs, main, table


def row(seed: int, collisions: int, **given: object) -> ClosedLoopRun:
    values = {"scenario": "coop/scenario_1", "detector": "oracle", "channel": "none", "distance": 1.0, **given}
    tracks = {"false_tracks": 2.0 * seed, "brakings": 2, "without_cause": seed % 2}
    return ClosedLoopRun(seed=seed, collisions=collisions, **tracks, **values)  # type: ignore[arg-type]


def test_table_has_one_line_per_arm_with_counts_and_means() -> None:
    """The 95 % Wilson interval of 1 of 2 is 0.09 to 0.91."""
    lines = table([row(1, 0), row(2, 3), row(1, 0, channel="ideal")]).splitlines()
    assert lines[2:] == [
        "| `oracle` | scenario_1 | `none` | 1 of 2 | 0.09 to 0.91 | 3.0 | 1 of 4 |",
        "| `oracle` | scenario_1 | `ideal` | 1 of 1 | 0.21 to 1.00 | 2.0 | 1 of 2 |",
    ]


def test_jobs_of_seed_contain_all_arms() -> None:
    assert len(jobs(("yolov5", "ssd"), ("none", "ideal"), 1)) == 8
    assert {job.settings.detector for job in jobs(("yolov5",), ("none",), 3)} == {"yolov5"}


def test_main_after_incomplete_last_line_repeats_only_that_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As a process leaves it that is killed while it writes the second of two runs."""
    monkeypatch.setattr(closed_loop, "SCENARIOS", ("coop/scenario_1",))
    monkeypatch.setattr(closed_loop, "run_of", lambda job: row(job.seed, 0, channel=job.settings.channel))
    record = tmp_path / "closed_loop.jsonl"
    first = json.dumps(asdict(row(1, 2))) + "\n"
    record.write_text(first + '{"scenario": "coop/sce')
    assert main(["--out", str(tmp_path), "--seeds", "1", "--detectors", "oracle", "--workers", "1"]) == 0
    runs = [ClosedLoopRun(**json.loads(line)) for line in record.read_text().splitlines()]
    assert runs == [row(1, 2), row(1, 0, channel="ideal")]


@pytest.mark.statistical
def test_main_with_oracle_avoids_collisions_only_by_cooperation(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The oracle detector replaces the networks. A second call adds no runs."""
    arguments = ["--out", str(tmp_path), "--seeds", "1", "--detectors", "oracle", "--workers", "1"]
    main(arguments)
    main(arguments)
    rows = [json.loads(line) for line in (tmp_path / "closed_loop.jsonl").read_text().splitlines()]
    assert len(rows) == 4
    assert {(one["channel"], one["collisions"] == 0) for one in rows} == {("none", False), ("ideal", True)}
    assert all(one["without_cause"] == 0 and one["false_tracks"] == 0.0 for one in rows)
    assert (tmp_path / "closed_loop.md").read_text() in capsys.readouterr().out
