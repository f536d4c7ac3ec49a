"""Runs that the page of a report contains as data."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from lxml import html


def report_data(page: Path) -> dict[str, Any]:
    """Return the data that the script of a report reads."""
    (script,) = html.fromstring(page.read_text(encoding="utf-8")).iterfind(".//script[@id='data']")
    found: dict[str, Any] = json.loads(script.text or "")
    return found


def listed_runs(page: Path) -> list[dict[str, Any]]:
    """Return each run of a report in the order of the table: its columns by title, and the content of its details."""
    data = report_data(page)
    text = data["texts"]
    runs = []
    for index, outcome in enumerate(data["outcomes"]):
        run: dict[str, Any] = {"outcome": ("failed", "did not finish", "not judged", "passed")[outcome]}
        for column in data["columns"] + data["facts"]:
            value = column["values"][data["groups"][index] if column.get("grouped") else index]
            run[column["title"]] = value if column["number"] else text[value]
        run["criteria"] = {
            data["kinds"][kind][0]: (bool(passed), value, *data["kinds"][kind][1:], text[reason])
            for kind, passed, value, reason, *_ in data["criteria"][index]
        }
        metrics, *values = data["metrics"][index]
        run["metrics"] = dict(zip(data["metricSets"][metrics], values, strict=True))
        number, *changes = data["settings"][index]
        settings = list(data["settingSets"][number]["values"])
        for position, value in zip(changes[::2], changes[1::2], strict=True):
            settings[position] = value
        paths = data["settingSets"][number]["paths"]
        run["settings of the run"] = {path: text[value] for path, value in zip(paths, settings, strict=True)}
        run["command"], run["replay"] = text[data["commands"][index]], text[data["replays"][index]]
        runs.append(run)
    return runs
