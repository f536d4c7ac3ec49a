"""Report of a session: the page of `eidrive report` about its runs, written once by the process that reports."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from eidrive_scenario.errors import InputError
from eidrive_scenario.files.encodable import printable
from eidrive_scenario.pytest_plugin.options import command_line_value, option_value

RUNS = "runs"
"""Folder of the files of runs beside the report, without --eidrive-out."""


def runs_folder(config: pytest.Config) -> Path | None:
    """Return the folder below which the files of runs are kept, or None."""
    below = _path(config, "out")
    if below is not None:
        return below
    page = _path(config, "report")
    return None if page is None else (page.parent if page.suffix == ".html" else page) / RUNS


def _path(config: pytest.Config, name: str) -> Path | None:
    """Return the path of an option: relative to the current folder, that of an ini option to the root."""
    if (given := command_line_value(config, name)) is not None:
        return Path(config.invocation_params.dir, given)
    listed = option_value(config, name)
    return None if listed is None else config.rootpath / listed


def show_report(terminalreporter: Any, config: pytest.Config) -> None:
    """Write the report about the runs of this session, and print its path and what it omits."""
    page = _path(config, "report")
    if page is None:
        return
    from eidrive_scenario.reporting.report_files import report_files

    locations = [path for path in _folders(terminalreporter) if path.is_dir()]
    terminalreporter.section("report", sep="-")
    if not locations:
        terminalreporter.line(f"{page}: not written, as no run has kept files")
        return
    try:
        written = report_files(locations, page, warn=lambda text: terminalreporter.line(printable(f"warning: {text}")))
    except InputError as error:
        terminalreporter.line(printable(f"{page}: not written: {error}"), red=True)
        return
    terminalreporter.line(str(written))


def _folders(terminalreporter: Any) -> list[Path]:
    """Return the folders of all runs, including those in the reports of workers of pytest-xdist, each once."""
    found: dict[Path, None] = {}
    for reports in terminalreporter.stats.values():
        for report in reports:
            facts = getattr(report, "eidrive", {})
            found.update(dict.fromkeys(Path(folder) for folder in facts.get("folders", ())))
            found.update(dict.fromkeys(Path(path).parent for path in facts.get("attachments", ())))
    return list(found)
