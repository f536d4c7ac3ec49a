"""The motion of all actors as a table that any tool reads."""

from __future__ import annotations

import csv
import io
from pathlib import Path

from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.recording.output import create

COLUMNS = ("time", "name", "x", "y", "z", "h", "p", "r", "speed")


class CsvWriter:
    """Writes `time,name,x,y,z,h,p,r,speed`, one row per actor and tick.

    Position of OpenSCENARIO's reference point [m], its heading, pitch and roll [rad], speed along the heading [m/s],
    each with six decimals. Raises SettingError if the file cannot be written.
    """

    def __init__(self, path: str | Path) -> None:
        self._file = io.TextIOWrapper(create(path), encoding="utf-8", newline="")
        self._rows = csv.writer(self._file, lineterminator="\n")
        self._rows.writerow(COLUMNS)

    def observe(self, frame: Frame) -> None:
        """One row for each actor of this frame."""
        view = frame.view
        time = f"{view.time:.6f}"
        columns = (view.position.tolist(), view.yaw.tolist(), view.pitch.tolist(), view.roll.tolist())
        for name, position, yaw, pitch, roll, speed in zip(view.names, *columns, view.speed.tolist(), strict=True):
            self._rows.writerow([time, name, *(f"{number:.6f}" for number in (*position, yaw, pitch, roll, speed))])

    def close(self) -> None:
        """Finish the file."""
        self._file.close()
