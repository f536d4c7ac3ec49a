"""Pages of the results in a folder: the reports of all parts with their figures, and the benchmark."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from markupsafe import Markup, escape
from rich.console import Console

from eidrive_reports.reproduction import benchmark
from eidrive_reports.reproduction.benchmark_arms import NO_COOPERATION
from eidrive_reports.reproduction.episodes import EpisodeJob
from eidrive_reports.reproduction.layout import Row, groups
from eidrive_reports.reproduction.part import Part
from eidrive_reports.reproduction.parts import PARTS
from eidrive_reports.reproduction.provenance import read_provenance
from eidrive_scenario.api.common import Diagnostic, SettingError, load_json
from eidrive_scenario.api.experiments import resolve_scenario, run_jobs
from eidrive_scenario.api.pages import (
    ReportedRun,
    png_address,
    run_of_result,
    write_page,
    write_replays,
    write_run_report,
)
from eidrive_scenario.api.run import run_and_save


def replays_page(name: str) -> str:
    """Return the path of the report about the recorded runs of a part, in the folder of the results."""
    return f"replays_{name}/report.html"


def write_part_replays(
    part: Part, out: Path, detectors: Sequence[str], *, workers: int | None = None, console: Console | None = None
) -> Path:
    """Run each case with the seed 1 and a recording, and write a report with their replays. Return its path.

    Raise the exceptions of `run_jobs`, and SettingError if a file cannot be written.
    """
    page = out / replays_page(part.name)
    with TemporaryDirectory() as recordings:
        task = partial(_recorded_run, below=Path(recordings))
        runs = run_jobs(part.jobs(1, detectors), task, workers=workers, console=console, title=f"{part.name}, replays")
        linked, omitted = write_replays(runs, page.parent)
    return write_run_report(linked, page, omitted=omitted)


def _recorded_run(job: EpisodeJob, below: Path) -> ReportedRun:
    result = run_and_save(resolve_scenario(job.scenario), seed=job.seed, settings=job.settings, below=below)
    return run_of_result(result, job.scenario)


PAGE = "index.html"
"""Name of the page in the folder of the results."""


def write_paper_page(out: Path) -> Path:
    """Write the page of a folder from the JSON files and figures of its parts. Return its path.

    Raise SettingError if a JSON file is damaged, or if the page cannot be written.
    """
    origins = read_provenance(out)
    parts = [_part(out, name, origins.get(name, {})) for name in PARTS if (out / f"{name}.json").is_file()]
    title = "Reproduction of the EI-Drive paper"
    template = Path(__file__).with_name("reproduction.html.jinja")
    return write_page(out / PAGE, template, title=title, parts=parts, duration=_duration(origins))


def _duration(origins: Mapping[str, Mapping[str, Any]]) -> str:
    """Return the number of runs and the duration of all parts; empty if one was not computed in a single call."""
    parts = [origins[name] for name in PARTS if name in origins]
    if not parts or any(part.get("runs") != part.get("runs_of_last_call") for part in parts):
        return ""
    runs, seconds = (sum(float(part[name]) for part in parts) for name in ("runs", "last_call_s"))
    processes = max(int(part.get("processes") or 1) for part in parts)
    duration = f"{seconds:.0f} seconds" if seconds < 120.0 else f"{seconds / 60.0:.0f} minutes"
    return f"{runs:,.0f} runs in {duration} on {processes} process{'es' if processes > 1 else ''}"


@contextmanager
def _intact_report(out: Path, name: str) -> Iterator[dict[str, Any]]:
    """Yield the report of a part from its JSON file. Raise SettingError for a damaged file: if it cannot be read, or
    lacks what the block reads."""
    path = out / f"{name}.json"
    try:
        yield load_json(path.read_bytes())
    except (OSError, ValueError, KeyError, TypeError) as error:
        hint = f"run `eidrive reproduce {name}` again"
        raise SettingError(Diagnostic(f"the file is damaged: {error!r}", hint, str(path))) from error


def _part(out: Path, name: str, origin: Mapping[str, Any]) -> dict[str, Any]:
    figure = out / f"{name}.png"
    with _intact_report(out, name) as report:
        sections = [
            {
                "title": str(section["title"]),
                "paragraphs": [text_with_code(str(text)) for text in section["paragraphs"]],
                "columns": [str(title) for title in section["columns"]],
                "rows": [[str(cell) for cell in row] for row in section["rows"]],
            }
            for section in report["sections"]
        ]
        title = str(report["title"])
    return {
        "name": name,
        "title": title,
        "sections": sections,
        "figure": png_address(figure.read_bytes()) if figure.is_file() else "",
        "origin": ", ".join(origin_texts(origin)),
        "replays": replays_page(name) if (out / replays_page(name)).is_file() else "",
    }


def origin_texts(origin: Mapping[str, Any]) -> list[str]:
    """Return version, commit, seeds and durations as texts, without unknown ones."""
    texts = {
        "version": "eidrive-scenario {}",
        "commit": "commit {}",
        "seeds": "seeds {}",
        "runs": "{} runs",
        "all_runs_s": "{} s of one process",
        "runs_of_last_call": "last call {} runs",
        "last_call_s": "in {} s",
        "processes": "on {} processes",
    }
    return [text.format(origin[key]) for key, text in texts.items() if origin.get(key) is not None]


def text_with_code(text: str) -> Markup:
    """Return a paragraph as HTML, with words between backticks as code."""
    parts = text.split("`")
    return Markup("").join(
        Markup("<code>{}</code>").format(part) if number % 2 else escape(part) for number, part in enumerate(parts)
    )


def write_benchmark_page(out: Path) -> Path:
    """Write the page of the benchmark from its JSON file in a folder. Return its path.

    Raise SettingError if the file is damaged, or if the page cannot be written.
    """
    with _intact_report(out, benchmark.NAME) as report:
        ranks, cells = report["tables"][benchmark.RANKS], report["tables"][benchmark.CELLS]
        texts = {section["title"]: list(map(text_with_code, section["paragraphs"])) for section in report["sections"]}
        channels = {row["channel"]: row["channel_title"] for row in ranks}
        choices = {name: list(groups(cells, name)) for name in ("scenario", "method", "channel")}
        values = {
            "title": str(report["title"]),
            "question": texts["Question"],
            "setup": texts["Set-up"],
            "channels": channels,
            "ranks": groups(ranks, "channel_title"),
            "overall": _matrix(choices["method"], list(channels), ranks),
            "scenarios": {
                name: _matrix(choices["method"], list(channels), rows)
                for name, rows in groups(cells, "scenario").items()
            },
            "cells": cells,
            "choices": choices,
        }
    origin = ", ".join(origin_texts(read_provenance(out).get(benchmark.NAME, {})))
    template = Path(__file__).with_name("benchmark.html.jinja")
    return write_page(out / f"{benchmark.NAME}.html", template, origin=origin, **values)


def _matrix(methods: Sequence[str], channels: Sequence[str], rows: Sequence[Row]) -> list[tuple[str, list[Row | None]]]:
    """Return the rows of each method on each channel; that of no cooperation is equal on all channels."""
    at = {(row["method"], row["channel"]): row for row in rows}
    return [
        (method, [at.get((method, channel), at.get((method, NO_COOPERATION))) for channel in channels])
        for method in methods
    ]
