"""One row per actor and tick."""

import csv
import math
from collections.abc import Callable
from pathlib import Path

import pytest

from eidrive_scenario.errors import SettingError
from eidrive_scenario.recording import CsvWriter
from eidrive_scenario.recording.frame import Frame


def test_rows(tmp_path: Path, make_frame: Callable[..., Frame]) -> None:
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


def test_a_place_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    with pytest.raises(SettingError, match="cannot write: Is a directory"):
        CsvWriter(tmp_path)
