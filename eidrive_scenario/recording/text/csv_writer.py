"""The motion of all actors as a table that any tool reads."""

from __future__ import annotations

import io
from pathlib import Path

from eidrive_scenario.files.atomic import create
from eidrive_scenario.recording.frame import Frame

COLUMNS = ("time", "name", "x", "y", "z", "h", "p", "r", "speed")


_FORMULA = tuple("=+-@\t\r\n\uff1d\uff0b\uff0d\uff20")
"""First characters by which a spreadsheet takes a cell for a formula; the last four are the full-width forms."""
_SEPARATORS = frozenset(',;|"\t\r\n')
"""Characters that end a cell in some spreadsheet, unless it is quoted."""


def neutralized(text: str) -> str:
    """A text that no spreadsheet takes for a formula: one that begins like a formula gets an apostrophe in front.

    So does one that begins with an apostrophe, so that `text_of_csv` can remove it without a doubt.
    """
    return f"'{text}" if text.startswith((*_FORMULA, "'")) else text


def csv_text(text: str) -> str:
    """A text from a scenario as a field of a CSV file: neutralized, and quoted where that is needed."""
    safe = neutralized(text)
    if text != text.strip() or not _SEPARATORS.isdisjoint(text):
        doubled = safe.replace('"', '""')
        return f'"{doubled}"'
    return safe


def text_of_csv(field: str) -> str:
    """The text of a field as a CSV reader gives it, without the apostrophe that `neutralized` has put in front."""
    return field.removeprefix("'")


class CsvWriter:
    """Writes `time,name,x,y,z,h,p,r,speed`, one row per actor and tick.

    Position of OpenSCENARIO's reference point [m], its heading, pitch and roll [rad], speed along the heading [m/s],
    each with six decimals. Names are written by `csv_text`. Raises SettingError if the file cannot be written.
    """

    def __init__(self, path: str | Path) -> None:
        self._file = io.TextIOWrapper(create(path), encoding="utf-8", newline="")
        self._fields: dict[str, str] = {}
        self._file.write(",".join(COLUMNS) + "\n")

    def observe(self, frame: Frame) -> None:
        """One row for each actor of this frame."""
        view = frame.view
        columns = (view.position.tolist(), view.yaw.tolist(), view.pitch.tolist(), view.roll.tolist())
        rows = []
        for name, position, yaw, pitch, roll, speed in zip(view.names, *columns, view.speed.tolist(), strict=True):
            field = self._fields.get(name)
            if field is None:
                field = self._fields[name] = csv_text(name)
            numbers = ",".join([f"{number:.6f}" for number in (*position, yaw, pitch, roll, speed)])
            rows.append(f"{view.time:.6f},{field},{numbers}\n")
        self._file.write("".join(rows))

    def close(self) -> None:
        """Finish the file."""
        self._file.close()
