"""Tables and texts of a part: Markdown for readers, CSV and JSON with all digits for programs."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

Value = str | int | float | bool | None
Row = Mapping[str, Value]

NO_VALUE = "-"
"""Text of a table cell without a value."""


@dataclass(frozen=True)
class Column:
    """Column of the Markdown table: a format of fields of a row, such as `{low:.2f} to {high:.2f}`.

    fields  fields of the format; if one is None, the cell is empty
    """

    title: str
    template: str
    fields: tuple[str, ...]

    def text(self, row: Row) -> str:
        """Return the cell of a row."""
        values = {name: row[name] for name in self.fields}
        return NO_VALUE if None in values.values() else self.template.format(**values)


@dataclass(frozen=True)
class DataTable:
    """Table with rows of equal fields.

    name     name of its CSV file, which tables with equal fields may share
    columns  columns of the Markdown table; empty for a table that is in its CSV file only
    """

    name: str
    columns: tuple[Column, ...]
    rows: tuple[Row, ...]

    def markdown(self) -> str:
        """Return the table as Markdown."""
        lines = ["| " + " | ".join(column.title for column in self.columns) + " |", "|---" * len(self.columns) + "|"]
        lines += ["| " + " | ".join(column.text(row) for column in self.columns) + " |" for row in self.rows]
        return "\n".join(lines) + "\n"


def as_csv(rows: Sequence[Row]) -> str:
    """Return rows of equal fields as CSV with all digits; missing values are empty."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    if rows:
        writer.writerow(rows[0])
        writer.writerows([_exact(value) for value in row.values()] for row in rows)
    return out.getvalue()


def _exact(value: Value) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    return repr(value) if isinstance(value, float) else str(value)


@dataclass(frozen=True)
class Section:
    """Section of the report: paragraphs, then a table."""

    title: str
    paragraphs: tuple[str, ...] = ()
    table: DataTable | None = None

    @property
    def columns(self) -> tuple[Column, ...]:
        """Columns of the table; empty without a table."""
        return () if self.table is None else self.table.columns

    def cells(self) -> list[list[str]]:
        """Return the formatted cells of the table by row; empty for a table without columns."""
        if self.table is None or not self.columns:
            return []
        return [[column.text(row) for column in self.columns] for row in self.table.rows]

    def markdown(self, level: int = 2) -> str:
        """Return the section as Markdown with a heading of this level."""
        parts = [f"{'#' * level} {self.title}\n", *(f"{text}\n" for text in self.paragraphs)]
        if self.table is not None and self.columns:
            parts.append(self.table.markdown())
        return "\n".join(parts)


REASON = "Likely reason"
"""Start of paragraphs that explain a difference from the paper."""


def result_sections(paragraphs: Sequence[str], table: DataTable | None = None) -> tuple[Section, ...]:
    """Return the section of the result, and one of the likely reasons of differences if there are any."""
    reasons = tuple(text for text in paragraphs if text.startswith(REASON))
    result = Section("Result", tuple(text for text in paragraphs if not text.startswith(REASON)), table)
    return (result, Section("Reasons of differences", reasons)) if reasons else (result,)


@dataclass(frozen=True)
class PartReport:
    """Report of a part: title and sections."""

    title: str
    sections: tuple[Section, ...]

    def data(self, *, shown: bool = False) -> dict[str, list[Row]]:
        """Return the rows of all tables by the name of their file, in order; of those with columns, if `shown`."""
        rows: dict[str, list[Row]] = {}
        for section in self.sections:
            if section.table is not None and (section.table.columns or not shown):
                rows.setdefault(section.table.name, []).extend(section.table.rows)
        return rows

    def as_json(self) -> dict[str, Any]:
        """Return the texts of the sections, and the rows of the tables that the report shows with all digits."""
        sections = [
            {
                "title": section.title,
                "paragraphs": list(section.paragraphs),
                "columns": [column.title for column in section.columns],
                "rows": section.cells(),
            }
            for section in self.sections
        ]
        return {"title": self.title, "sections": sections, "tables": self.data(shown=True)}

    def markdown(self) -> str:
        """Return the report as Markdown."""
        return "\n".join([f"# {self.title}\n", *(section.markdown() for section in self.sections)])


def plain(title: str, field: str, form: str = "") -> Column:
    """Return a column of one field with a format specification such as `.2f`."""
    return Column(title, f"{{{field}:{form}}}", (field,))


def number(row: Row, name: str) -> float:
    """Return a field as number; 0 if it is empty."""
    return float(row[name] or 0.0)


def finite(value: float) -> float | None:
    """Return a number, or None for NaN: an undefined value is an empty field."""
    return None if math.isnan(value) else value


def limits(rows: Sequence[Row], name: str, low: str = "low", high: str = "high") -> tuple[list[float], list[float]]:
    """Return the limits of the intervals of a field; the value itself where there is none."""
    ends = [[number(row, name if row[end] is None else end) for row in rows] for end in (low, high)]
    return ends[0], ends[1]


def distinct(rows: Sequence[Row], name: str) -> list[str]:
    """Return the values of a field as texts, in the order of their first rows."""
    return list(dict.fromkeys(str(row[name]) for row in rows))


def scenario_title(scenario: str) -> str:
    """Return the name of a scenario of the library as text."""
    return scenario.removeprefix("coop/").replace("_", " ")
