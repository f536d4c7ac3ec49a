"""CSV table with one row per actor and tick."""

import csv
import io
import math
from collections.abc import Callable
from pathlib import Path

import pytest
from msgspec.structs import replace

from eidrive_scenario.errors import SettingError
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.recording.text.csv_writer import CsvWriter, csv_text, text_of_csv


def test_csv_writer_writes_one_row_per_actor_and_tick(tmp_path: Path, make_frame: Callable[..., Frame]) -> None:
    path = tmp_path / "out" / "run.csv"
    writer = CsvWriter(path)
    frames = [make_frame(0), make_frame(1)]
    for frame in frames:
        writer.observe(frame)
    writer.close()
    with path.open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert path.read_text(encoding="utf-8").splitlines()[0] == "time,name,x,y,z,h,p,r,speed"
    assert [row["name"] for row in rows] == ["Ego", "Incoming", "Löschzug"] * 2
    view = frames[1].view
    row = rows[4]
    assert row["time"] == "0.050000"
    expected = [*view.position[1], view.yaw[1], view.pitch[1], view.roll[1], view.speed[1]]
    for column, value in zip(("x", "y", "z", "h", "p", "r", "speed"), expected, strict=True):
        assert math.isclose(float(row[column]), value, abs_tol=5e-7)


def test_csv_writer_of_folder_raises_setting_error(tmp_path: Path) -> None:
    with pytest.raises(SettingError, match="cannot write: Is a directory"):
        CsvWriter(tmp_path)


NAMES = [
    "=1+1",
    "=cmd|' /C calc'!A0",
    "+1",
    "-2+3",
    "@SUM(A1)",
    "\t=1",
    "\r=1",
    "\n=1",
    "\uff1d1+1",
    "'=1",
    "''",
    "a;=1+1",
    "a,=1",
    'a"b',
    " =1",
    "Ego",
    "it's",
    "",
]


@pytest.mark.parametrize("name", NAMES)
def test_csv_text_is_never_a_formula_and_is_reversible(name: str) -> None:
    line = f"0.0,{csv_text(name)},1.0\n"
    (row,) = csv.reader(io.StringIO(line, newline=""))
    assert len(row) == 3
    assert not row[1].startswith(("=", "+", "-", "@", "\t", "\r", "\n", "\uff1d"))
    assert text_of_csv(row[1]) == name


def test_csv_writer_neutralizes_formulas_in_actor_names(tmp_path: Path, make_frame: Callable[..., Frame]) -> None:
    frame = make_frame(0)
    named = replace(frame, view=replace(frame.view, names=("=1+1", "-x", *frame.view.names[2:])))
    writer = CsvWriter(tmp_path / "run.csv")
    writer.observe(named)
    writer.close()
    lines = (tmp_path / "run.csv").read_text(encoding="utf-8").splitlines()
    assert [line.split(",")[1] for line in lines[1:3]] == ["'=1+1", "'-x"]
