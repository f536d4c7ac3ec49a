"""Tables and texts of a part: Markdown for readers, CSV and JSON with all digits for programs."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from operator import itemgetter
from string import Formatter
from typing import Any

from eidrive_reports.studies import group_by, markdown_table

Row = Mapping[str, Any]
"""Texts, numbers, booleans and None by the name of their field."""

NO_VALUE = "-"
"""Text of a table cell without a value."""


@dataclass(frozen=True)
class Column:
    """Column of the Markdown table: a format of fields of a row, such as `{low:.2f} to {high:.2f}`."""

    title: str
    template: str

    @cached_property
    def fields(self) -> tuple[str, ...]:
        """Fields of the format."""
        return tuple(field for _, field, _, _ in Formatter().parse(self.template) if field)

    def text(self, row: Row) -> str:
        """Return the cell of a row, which is empty if a field is None."""
        return NO_VALUE if any(row[name] is None for name in self.fields) else self.template.format_map(row)


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
        return markdown_table([column.title for column in self.columns], self.cells())

    def cells(self) -> list[list[str]]:
        """Return the formatted cells by row; empty for a table without columns."""
        return [[column.text(row) for column in self.columns] for row in self.rows] if self.columns else []


def as_csv(rows: Sequence[Row]) -> str:
    """Return rows of equal fields as CSV with all digits; missing values are empty."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    if rows:
        writer.writerow(rows[0])
        writer.writerows([_exact(value) for value in row.values()] for row in rows)
    return out.getvalue()


def _exact(value: object) -> str:
    if value is None:
        return ""
    return str(value).lower() if isinstance(value, bool) else str(value)


@dataclass(frozen=True)
class Section:
    """Section of the report: paragraphs, then a table."""

    title: str
    paragraphs: tuple[str, ...] = ()
    table: DataTable | None = None

    def markdown(self) -> str:
        """Return the section as Markdown."""
        parts = [f"## {self.title}\n", *(f"{text}\n" for text in self.paragraphs)]
        if self.table is not None and self.table.columns:
            parts.append(self.table.markdown())
        return "\n".join(parts)

    def as_json(self) -> dict[str, Any]:
        """Return the texts of the section and of its table."""
        return {
            "title": self.title,
            "paragraphs": list(self.paragraphs),
            "columns": [column.title for column in self.table.columns] if self.table else [],
            "rows": self.table.cells() if self.table else [],
        }


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
        sections = [section.as_json() for section in self.sections]
        return {"title": self.title, "sections": sections, "tables": self.data(shown=True)}

    def markdown(self) -> str:
        """Return the report as Markdown."""
        return "\n".join([f"# {self.title}\n", *(section.markdown() for section in self.sections)])


def plain(title: str, field: str = "", form: str = "") -> Column:
    """Return a column of one field, of the name of the title by default, with a format specification such as `.2f`."""
    return Column(title, f"{{{field or title}:{form}}}")


def number(row: Row, name: str) -> float:
    """Return a field as number; 0 if it is empty."""
    return float(row[name] or 0.0)


def numbers(rows: Iterable[Row], name: str) -> list[float]:
    """Return a field of rows as numbers; NaN where it is empty, so that figures have a gap there."""
    return [math.nan if row[name] is None else float(row[name]) for row in rows]


def where(rows: Iterable[Row], **fields: object) -> list[Row]:
    """Return the rows with these values of fields."""
    return [row for row in rows if all(row[name] == value for name, value in fields.items())]


def finite(value: float) -> float | None:
    """Return a number, or None for NaN: an undefined value is an empty field."""
    return None if math.isnan(value) else value


def bounds(interval: Any) -> dict[str, float | None]:
    """Return the limits `low` and `high` of an interval as fields; None for an undefined one, and without interval."""
    return {end: None if interval is None else finite(getattr(interval, end)) for end in ("low", "high")}


def limits(rows: Sequence[Row], name: str) -> tuple[list[float], list[float]]:
    """Return the limits of the intervals of a field; the value itself where there is none, NaN without a value."""
    below, above = (
        [number for row in rows for number in numbers([row], name if row[end] is None else end)]
        for end in ("low", "high")
    )
    return below, above


def groups(rows: Iterable[Row], *names: str) -> dict[Any, list[Row]]:
    """Return rows by the value of a field, or by the tuple of those of several, in the order of their first rows."""
    return group_by(rows, itemgetter(*names))


def scenario_title(scenario: str) -> str:
    """Return the name of a scenario of the library as text."""
    return scenario.removeprefix("coop/").replace("_", " ")
