"""Report about files of runs: the input of `eidrive report` and of the pytest plugin."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from pathlib import Path

from eidrive_scenario.errors import Diagnostic, SettingError
from eidrive_scenario.experiments.reported_run import ReportedRun
from eidrive_scenario.experiments.sweeps.store import is_store
from eidrive_scenario.recording.run_files import RESULT, result_paths, unfinished_runs
from eidrive_scenario.reporting.drawing.vector_canvas import DEFAULT_SIZE, Size, write_figure
from eidrive_scenario.reporting.replay.page import write_replays
from eidrive_scenario.reporting.run_report.rates import rate_figures
from eidrive_scenario.reporting.run_report.report import write_run_report
from eidrive_scenario.reporting.run_report.reported_runs import read_runs, read_sweeps
from eidrive_scenario.reporting.run_report.run_groups import distinct_runs, group_runs

LONGEST_NAME = 200
"""Maximum length of the name of a figure [bytes]."""


def report_files(
    locations: Sequence[Path],
    out: Path,
    *,
    replays: bool = True,
    warn: Callable[[str], None] = lambda text: None,
    figures: Path | None = None,
    size: Size | None = None,
) -> Path:
    """Write the report about results, folders of runs and stores of sweeps, and return the path of its page.

    out      file of the page if it ends in `.html`, else the folder of `report.html`
    replays  whether the replay of each run with a recording is written beside the page
    warn     function that gets a line for each run or recording that the report omits
    figures  folder of the curves and heat maps as vector figures of a `size` [mm]

    Raise InputError without any result, and for a damaged file that `locations` names. Damaged files below folders are
    omitted.
    """
    stores = [path for path in locations if is_store(path)]
    results, errors = read_runs(result_paths([path for path in locations if path not in stores]))
    omitted = [f"{path}: the run did not end" for path in unfinished_runs(locations)]
    unjudged: list[str] = []
    if stores:
        swept, unjudged = read_sweeps(stores)
        results += swept
    given = {str(path) for path in locations}
    invalid = not results or any(error.source in given for error in errors)
    if not invalid:
        omitted += [f"{error.source}: {error.message}" for error in errors]
    for line in (*unjudged, *(f"{line}, the report omits it" for line in omitted)):
        warn(line)
    if invalid:
        hint = "give folders written by eidrive run --out, or stores of sweeps"
        raise SettingError(errors or Diagnostic(_missing(locations, stores, unjudged), hint))
    if replays:
        results, without = write_replays(results, out.parent if out.suffix == ".html" else out)
        for line in without:
            warn(line)
    if figures is not None and not write_rate_figures(results, figures, size or DEFAULT_SIZE):
        reason = "no number varies between its runs of sweeps (give their stores) and of distributions"
        warn(f"--figures: the report has no curve and no heat map: {reason}")
    return write_run_report(results, out, omitted=omitted, unjudged=unjudged)


def write_rate_figures(runs: Sequence[ReportedRun], folder: Path, size: Size) -> int:
    """Write the curves and heat maps of a report as SVG and PDF of a size [mm], and return their number."""
    names: list[str] = []
    for title, figure in rate_figures(group_runs(distinct_runs(runs)), size):
        name = re.sub(r"[^\w.-]+", "_", title).encode(errors="replace")[:LONGEST_NAME].decode(errors="ignore")
        while name in names:
            name += "-"
        names.append(name)
        for suffix in (".svg", ".pdf"):
            write_figure(figure, folder / f"{name}{suffix}")
    return len(names)


def _missing(locations: Sequence[Path], stores: Sequence[Path], unjudged: Sequence[str]) -> str:
    """Return the error of files without any result."""
    if unjudged:
        return "no run has a verdict"
    folders = [path for path in locations if path not in stores]
    parts = [f"no run in {', '.join(map(str, stores))}"] if stores else []
    parts += [f"no {RESULT} in {', '.join(map(str, folders))}"] if folders else []
    return ", and ".join(parts)
