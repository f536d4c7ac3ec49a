"""Records of driven files: interrupted and damaged ones, other planners, and files of the same name."""

from __future__ import annotations

from pathlib import Path

import pytest
from eidrive_reports import driven_files, driven_runs
from eidrive_reports.driven_runs import STACK, DrivenJob, DrivenRecord, DrivenRun, run_recorded
from rich.console import Console

from eidrive_scenario.errors import SettingError
from eidrive_scenario.simulation import RunSettings


def job(number: int, planner: str = "behavior", drive: str = "Ego") -> DrivenJob:
    return DrivenJob("a.xosc", STACK, 1, RunSettings(), "a.xosc", number, drive, planner=planner)


@pytest.fixture
def done(monkeypatch: pytest.MonkeyPatch) -> list[DrivenJob]:
    """Return the jobs that were run, without a simulation; their distance is their number."""
    jobs: list[DrivenJob] = []

    def run_of(one: DrivenJob) -> DrivenRun:
        jobs.append(one)
        error = f"run {one.number}\u2028without a result"
        return DrivenRun(one.file, one.number, one.arm, one.seed, error=error, planner=one.planner, drive=one.drive)

    monkeypatch.setattr(driven_runs, "run_of", run_of)
    return jobs


def recorded(jobs: list[DrivenJob], record: Path) -> list[DrivenRun]:
    return run_recorded(jobs, record, workers=1, console=Console(quiet=True), title="x")


def read(record: Path) -> list[DrivenRun]:
    with DrivenRecord.open(record) as driven:
        return list(driven.runs.values())


def test_interrupted_record_is_continued(tmp_path: Path, done: list[DrivenJob]) -> None:
    record = tmp_path / "record.jsonl"
    runs = recorded([job(0), job(1)], record)
    record.write_bytes(record.read_bytes()[:-20])
    assert read(record) == runs[:1]
    assert recorded([job(0), job(1)], record) == runs
    assert [one.number for one in done] == [0, 1, 1]
    assert read(record) == runs


@pytest.mark.parametrize("line", ["{}", "[]", "damaged", '{"file": "a.xosc", "failed": [], "unstarted": [], "x": 1}'])
def test_damaged_line_is_an_error_with_its_number(tmp_path: Path, done: list[DrivenJob], line: str) -> None:
    record = tmp_path / "record.jsonl"
    recorded([job(0)], record)
    with record.open("a") as lines:
        lines.write(f"{line}\n")
    with pytest.raises(SettingError, match=r"record.jsonl:2: the record is damaged"):
        recorded([job(0)], record)


def test_runs_of_another_planner_or_vehicle_are_not_taken_from_the_record(
    tmp_path: Path, done: list[DrivenJob]
) -> None:
    record = tmp_path / "record.jsonl"
    for wanted in (job(0), job(0, "route"), job(0, drive="Truck")):
        (run,) = recorded([wanted], record)
        assert (run.planner, run.drive) == (wanted.planner, wanted.drive)
    assert len(done) == 3


def test_files_of_the_same_name_are_an_error(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        driven_files.main(["one/a.xosc", "b.xosc", "two/a.xosc", "--out", str(tmp_path)])
    assert "two files have the name a.xosc" in capsys.readouterr().err
