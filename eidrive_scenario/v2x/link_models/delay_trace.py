"""Measured delays, from a list or a file."""

from __future__ import annotations

import csv
import math
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, NonNegativeFloat, model_validator

from eidrive_scenario.errors import quoted, shortened
from eidrive_scenario.files.bounded import MIB, read_regular_file, reason_of
from eidrive_scenario.settings import Settings

MAX_BYTES = 32 * MIB
"""Size of a file of measured delays."""
UNITS = {"s": 1.0, "ms": 1e-3}


class TraceDelay(Settings):
    """Delays that somebody measured.

    seconds  the values [s]; or
    file     a CSV file, relative to the profile, with
    column   the name of its column in the first row, or its number from 0 on, and
    unit     `s` or `ms`
    replay   false: drawn from the values, with straight lines between neighboring ones; true: message n of a link
             takes value n, and begins anew at the end
    """

    kind: Literal["trace"]
    seconds: Annotated[tuple[NonNegativeFloat, ...], Field(min_length=1, repr=False)]
    file: Path | None = None
    column: str | int = 0
    unit: Literal["s", "ms"] = "s"
    replay: bool = False

    @model_validator(mode="before")
    @classmethod
    def _read(cls, data: Any) -> Any:
        if not isinstance(data, dict):
            return data
        if data.get("file") is None:
            idle = [name for name in ("column", "unit") if name in data]
            if idle:
                raise ValueError(f"{idle[0]} belongs to a file; the list of seconds has none")
            return data
        if data.get("seconds") is not None:
            raise ValueError("give either seconds or a file")
        scale = UNITS.get(str(data.get("unit", "s")), 1.0)
        values = _column(Path(str(data["file"])), data.get("column", 0))
        return {**data, "seconds": [scale * value for value in values]}

    @cached_property
    def _ascending(self) -> list[float]:
        return sorted(self.seconds)

    @property
    def random(self) -> bool:
        """Whether a draw decides."""
        return not self.replay

    def quantile(self, u: float) -> float:
        """The delay that a share `u` of all messages does not exceed [s]."""
        ascending = self._ascending
        place = u * (len(ascending) - 1)
        below = min(int(place), len(ascending) - 1)
        above = min(below + 1, len(ascending) - 1)
        return ascending[below] + (place - below) * (ascending[above] - ascending[below])

    def at(self, number: int) -> float:
        """The delay of message `number` of a link, where the trace is replayed [s]."""
        return self.seconds[number % len(self.seconds)]


def _column(path: Path, column: object) -> list[float]:
    """The numbers in a column of a CSV file; a first row of words names the columns. Raises ValueError."""
    if not isinstance(column, str | int) or isinstance(column, bool):
        raise ValueError(f"the column is {quoted(column)}; give its name, or its number from 0 on")
    try:
        text = read_regular_file(path, MAX_BYTES).decode("utf-8")
        reader = csv.reader(text.splitlines(keepends=True))
        rows = [(reader.line_num, row) for row in reader if row]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        reason = "it is not text in UTF-8" if isinstance(error, UnicodeDecodeError) else reason_of(error)
        raise ValueError(f"cannot read {_shown(path)}: {reason}") from error
    if not rows:
        raise ValueError(f"{_shown(path)} is empty")
    header = [cell.strip() for cell in rows[0][1]]
    if isinstance(column, str):
        if column not in header:
            raise ValueError(f"{_shown(path)} has no column {quoted(column)} in its first row")
        place = header.index(column)
    else:
        place = column
    if not 0 <= place < len(header):
        raise ValueError(f"{_shown(path)} has no column {quoted(place)}; it has {len(header)}, from 0 on")
    body = rows[1:] if isinstance(column, str) or not _is_number(header[place]) else rows
    if not body:
        raise ValueError(f"{_shown(path)} has no delays")
    values = []
    for number, row in body:
        # The row is not quoted: the path may lead to a file of another kind.
        if place >= len(row) or not _is_number(row[place]):
            raise ValueError(f"{_shown(path)}:{number}: column {place} holds no delay")
        if float(row[place]) < 0.0:
            raise ValueError(f"{_shown(path)}:{number}: a delay is negative")
        values.append(float(row[place]))
    return values


def _shown(path: Path) -> str:
    return shortened(str(path), 200)


def _is_number(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False
