"""CSV and Parquet files of the tables of a run."""

from __future__ import annotations

import io
import math
from itertools import islice
from pathlib import Path
from typing import Any

from eidrive_scenario.export.recorded_run import RecordedRun
from eidrive_scenario.export.tables import TABLES, Columns
from eidrive_scenario.files.atomic import atomic_output, create
from eidrive_scenario.optional_imports import optional_import
from eidrive_scenario.recording.text.csv_writer import csv_text

_GROUP = 50_000
"""Number of rows of a row group of Parquet."""


def write_csv(run: RecordedRun, path: Path, table: str) -> None:
    """Write a table as CSV. Numbers keep all digits; an unknown value is an empty field.

    Texts that a spreadsheet would evaluate as formulas have a prefix, as in `csv_text`. Raise SettingError if the file
    cannot be written.
    """
    found = TABLES[table]
    with atomic_output(path) as partial, io.TextIOWrapper(create(partial), encoding="utf-8", newline="") as stream:
        stream.write(",".join(found.columns) + "\n")
        for row in found.rows(run):
            stream.write(",".join([_field(value) for value in row]) + "\n")


def write_parquet(run: RecordedRun, path: Path, table: str) -> None:
    """Write a table as Parquet; an unknown value is null.

    Raise SettingError if pyarrow is missing, or if the file cannot be written.
    """
    arrow, parquet = optional_import("pyarrow", "tables"), optional_import("pyarrow.parquet", "tables")
    found = TABLES[table]
    schema = _schema(arrow, found.columns)
    rows = found.rows(run)
    with (
        atomic_output(path) as partial,
        create(partial) as stream,
        parquet.ParquetWriter(stream, schema, compression="zstd") as writer,
    ):
        while group := list(islice(rows, _GROUP)):
            columns = [[_known(value) for value in column] for column in zip(*group, strict=True)]
            writer.write_table(arrow.table(columns, schema=schema))


def _schema(arrow: Any, columns: Columns) -> Any:
    types = {float: arrow.float64(), int: arrow.int64(), str: arrow.string(), bool: arrow.bool_()}
    return arrow.schema([(name, types[kind]) for name, kind in columns.items()])


def _known(value: Any) -> Any:
    return None if isinstance(value, float) and math.isnan(value) else value


def _field(value: Any) -> str:
    value = _known(value)
    if value is None:
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    return csv_text(value) if isinstance(value, str) else repr(value)
