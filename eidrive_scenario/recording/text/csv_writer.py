"""CSV table with the motion of all actors."""

from __future__ import annotations

import io
from pathlib import Path

from eidrive_scenario.files.atomic import create
from eidrive_scenario.recording.frame import Frame

COLUMNS = ("time", "name", "x", "y", "z", "h", "p", "r", "speed")


_FORMULA = tuple("=+-@\t\r\n\uff1d\uff0b\uff0d\uff20")
"""First characters that mark a cell as a formula in a spreadsheet; the last four are the full-width forms."""
_SEPARATORS = frozenset(',;|"\t\r\n')
"""Characters that end an unquoted cell in a spreadsheet."""


def neutralize_formula(text: str) -> str:
    """Return a text that no spreadsheet evaluates as a formula.

    A text that begins like a formula or with an apostrophe gets an apostrophe as prefix, so `text_of_csv` is the exact
    inverse.
    """
    return f"'{text}" if text.startswith((*_FORMULA, "'")) else text


def csv_text(text: str) -> str:
    """Return a text from a scenario as a CSV field: without formulas, and quoted if necessary."""
    safe = neutralize_formula(text)
    if text != text.strip() or not _SEPARATORS.isdisjoint(text):
        doubled = safe.replace('"', '""')
        return f'"{doubled}"'
    return safe


def text_of_csv(field: str) -> str:
    """Return the original text of a field of a CSV reader, without the prefix of `neutralize_formula`."""
    return field.removeprefix("'")


class CsvWriter:
    """Observer that writes `time,name,x,y,z,h,p,r,speed`, one row per actor and tick.

    The columns are the position of the OpenSCENARIO reference point [m], its heading, pitch and roll [rad], and the
    speed along the heading [m/s], with six decimals each. Names are written by `csv_text`. Raise SettingError if the
    file cannot be written.
    """

    def __init__(self, path: str | Path) -> None:
        self._file = io.TextIOWrapper(create(path), encoding="utf-8", newline="")
        self._file.write(",".join(COLUMNS) + "\n")

    def observe(self, frame: Frame) -> None:
        """Write one row for each actor of this frame."""
        view = frame.view
        columns = (view.position.tolist(), view.yaw.tolist(), view.pitch.tolist(), view.roll.tolist())
        rows = []
        for name, position, yaw, pitch, roll, speed in zip(view.names, *columns, view.speed.tolist(), strict=True):
            numbers = ",".join([f"{number:.6f}" for number in (*position, yaw, pitch, roll, speed)])
            rows.append(f"{view.time:.6f},{csv_text(name)},{numbers}\n")
        self._file.write("".join(rows))

    def close(self) -> None:
        """Close the file."""
        self._file.close()
