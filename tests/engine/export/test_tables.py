"""Tables of a run as CSV and Parquet, read by the csv module and by pyarrow."""

from __future__ import annotations

import csv
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import get_args

import pandas
import pyarrow.parquet as parquet
import pytest
from written_recording import Body, detected, step, view, write_run

from eidrive_scenario.cli.recordings import TableName
from eidrive_scenario.errors import SettingError
from eidrive_scenario.experiments.single_run import run_and_save
from eidrive_scenario.export.recorded_run import RecordedRun, open_run
from eidrive_scenario.export.tables import TABLES, write_csv, write_parquet
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.recording.recording import read_recording
from eidrive_scenario.recording.text.csv_writer import COLUMNS, text_of_csv
from eidrive_scenario.simulation import RunResult, RunSettings


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> tuple[RunResult, RecordedRun]:
    """Return a run of scenario 1 on a lossy channel, with its CSV table, and its recording."""
    folder = tmp_path_factory.mktemp("tables")
    settings = RunSettings(channel="error_30pct", time_limit=6.0)
    result = run_and_save("coop/scenario_1", settings=settings, out=folder, csv=folder / "live.csv")
    assert result.recording is not None
    return result, open_run(result.recording)


def rows_of(run: RecordedRun, path: Path, table: str) -> list[dict[str, str]]:
    write_csv(run, path, table)
    with path.open(newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


def live_rows(result: RunResult) -> Iterator[dict[str, str]]:
    assert result.folder is not None
    with (result.folder / "live.csv").open(newline="", encoding="utf-8") as stream:
        yield from csv.DictReader(stream)


def test_command_line_names_every_table() -> None:
    assert list(get_args(TableName)) == list(TABLES)


def test_actors_equal_the_table_of_the_run(recorded: tuple[RunResult, RecordedRun], tmp_path: Path) -> None:
    """The first columns are those of `eidrive run --csv`, which writes six decimals."""
    result, run = recorded
    exported = rows_of(run, tmp_path / "t.csv", "actors")
    assert list(exported[0])[: len(COLUMNS)] == list(COLUMNS)
    for first, second in zip(live_rows(result), exported, strict=True):
        assert first["name"] == second["name"]
        for column in COLUMNS:
            if column != "name":
                assert first[column] == f"{float(second[column]):.6f}"


@pytest.mark.parametrize("table", sorted(TABLES))
def test_parquet_and_csv_have_equal_values(recorded: tuple[RunResult, RecordedRun], tmp_path: Path, table: str) -> None:
    _, run = recorded
    rows = rows_of(run, tmp_path / "t.csv", table)
    write_parquet(run, tmp_path / "t.parquet", table)
    found = parquet.read_table(tmp_path / "t.parquet").to_pylist()
    assert len(found) == len(rows) > 0
    for text, values in zip(rows, found, strict=True):
        for name, value in values.items():
            if isinstance(value, str):
                assert text_of_csv(text[name]) == value
            elif value is None:
                assert text[name] == ""
            elif isinstance(value, bool):
                assert text[name] == str(value).lower()
            else:
                assert float(text[name]) == value


def test_tables_contain_the_frames_without_loss(recorded: tuple[RunResult, RecordedRun], tmp_path: Path) -> None:
    result, run = recorded
    assert result.recording is not None
    frames = list(read_recording(result.recording).frames())
    tables = {}
    for table in TABLES:
        write_parquet(run, tmp_path / f"{table}.parquet", table)
        tables[table] = pandas.read_parquet(tmp_path / f"{table}.parquet")
    ego = tables["actors"].query("name == 'Ego'")
    assert ego.x.tolist() == [frame.view.position[frame.view.row("Ego"), 0] for frame in frames]
    fused = tables["objects"].query("station == 'Ego' and list == 'fused'")
    assert len(fused) == sum(len(frame.steps["Ego"].fused) for frame in frames)
    events = [event for frame in frames for event in frame.links]
    assert tables["messages"].outcome.tolist() == [event.outcome for event in events]
    assert {"delivered", "lost"} == set(tables["messages"].outcome)
    assert tables["messages"].arrives.isna().sum() == sum(event.arrives is None for event in events)
    assert tables["verdicts"].value.tolist() == [verdict.value for verdict in result.criteria]
    states = ["; ".join(verdict.violation_state) for verdict in result.criteria]
    assert tables["verdicts"].violation_state.tolist() == states
    assert len(tables["transitions"]) == sum(len(frame.changes) for frame in frames)
    assert set(tables["plans"].station) == {"Ego"}


def test_names_like_formulas_are_neutralized(tmp_path: Path) -> None:
    names = ["=1+1", 'a,"b"', "Zug\n2", "車"]
    bodies: dict[str, Body] = {name: {} for name in names}
    rows = rows_of(write_run(tmp_path, [Frame(view(bodies))]), tmp_path / "t.csv", "actors")
    assert rows[0]["name"] == "'=1+1"
    assert [text_of_csv(row["name"]) for row in rows] == names


def test_unknown_velocity_is_empty(tmp_path: Path) -> None:
    own = detected(0.0, [(5.0, 0.0, 0.0, 4.0, 2.0, 1.5, 0.0)])
    run = write_run(tmp_path, [Frame(view({"A": {}}), {"A": step(own)})])
    row, _ = rows_of(run, tmp_path / "t.csv", "objects")
    assert (row["vx"], row["vy"], row["existence"], row["score"]) == ("", "", "", "0.9")


def test_table_without_rows_has_its_columns(tmp_path: Path) -> None:
    run = write_run(tmp_path, [Frame(view({"A": {}}))])
    assert rows_of(run, tmp_path / "t.csv", "messages") == []
    write_parquet(run, tmp_path / "t.parquet", "messages")
    assert parquet.read_table(tmp_path / "t.parquet").column_names == list(TABLES["messages"].columns)


def test_verdicts_of_unfinished_run_are_a_warning(tmp_path: Path) -> None:
    run = write_run(tmp_path, [Frame(view({"A": {}}))])
    assert rows_of(run, tmp_path / "t.csv", "verdicts") == []
    assert any("contains no verdicts" in warning for warning in run.warnings)


def test_missing_pyarrow_raises_error_with_install_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run = write_run(tmp_path, [Frame(view({"A": {}}))])
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(SettingError, match=r"pyarrow is not installed; install it: pip install .*\[tab"):
        write_parquet(run, tmp_path / "t.parquet", "actors")
    assert not (tmp_path / "t.parquet").exists()
