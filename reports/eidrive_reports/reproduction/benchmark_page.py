"""Page of the benchmark: success by method and channel, ranks, success by scenario, and all cells with commands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from eidrive_reports.reproduction.benchmark import CELLS, NAME, RANKS
from eidrive_reports.reproduction.benchmark_arms import NO_COOPERATION
from eidrive_reports.reproduction.page import origin_texts, text_with_code
from eidrive_reports.reproduction.provenance import read_provenance
from eidrive_scenario.api.common import Diagnostic, SettingError, load_json
from eidrive_scenario.api.pages import write_page

PAGE = f"{NAME}.html"
"""Name of the page in the folder of the results."""

_Row = Mapping[str, Any]


def write_benchmark_page(out: Path) -> Path:
    """Write the page of the benchmark from its JSON file in a folder. Return its path.

    Raise SettingError if the file is damaged, or if the page cannot be written.
    """
    path = out / f"{NAME}.json"
    try:
        report = load_json(path.read_bytes())
        ranks, cells = report["tables"][RANKS], report["tables"][CELLS]
        texts = {section["title"]: list(map(text_with_code, section["paragraphs"])) for section in report["sections"]}
        channels = {row["channel"]: row["channel_title"] for row in ranks}
        choices = {name: list(_groups(cells, name)) for name in ("scenario", "method", "channel")}
        values = {
            "title": str(report["title"]),
            "question": texts["Question"],
            "setup": texts["Set-up"],
            "channels": channels,
            "ranks": _groups(ranks, "channel_title"),
            "overall": _matrix(choices["method"], list(channels), ranks),
            "scenarios": {
                name: _matrix(choices["method"], list(channels), rows)
                for name, rows in _groups(cells, "scenario").items()
            },
            "cells": cells,
            "choices": choices,
        }
    except (OSError, ValueError, KeyError, TypeError) as error:
        hint = f"run `eidrive reproduce {NAME}` again"
        raise SettingError(Diagnostic(f"the file is damaged: {error!r}", hint, str(path))) from error
    origin = ", ".join(origin_texts(read_provenance(out).get(NAME, {})))
    return write_page(out / PAGE, Path(__file__).with_name("benchmark.html.jinja"), origin=origin, **values)


def _groups(rows: Sequence[_Row], field: str) -> dict[str, list[_Row]]:
    """Return rows by the value of a field, in the order of their first rows."""
    groups: dict[str, list[_Row]] = {}
    for row in rows:
        groups.setdefault(row[field], []).append(row)
    return groups


def _matrix(
    methods: Sequence[str], channels: Sequence[str], rows: Sequence[_Row]
) -> list[tuple[str, list[_Row | None]]]:
    """Return the rows of each method on each channel; that of no cooperation is equal on all channels."""
    at = {(row["method"], row["channel"]): row for row in rows}
    return [
        (method, [at.get((method, channel), at.get((method, NO_COOPERATION))) for channel in channels])
        for method in methods
    ]
