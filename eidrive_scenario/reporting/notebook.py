"""Runs and scenarios in a notebook: verdicts with a replay, and pictures; pages of runs."""

from __future__ import annotations

import html
import io
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from tempfile import TemporaryDirectory

from matplotlib.figure import Figure

from eidrive_scenario.extensions.library import resolve_scenario
from eidrive_scenario.files.bounded import path_argument
from eidrive_scenario.openscenario import Scenario
from eidrive_scenario.recording.recording import open_recording
from eidrive_scenario.recording.run_files import recording_in
from eidrive_scenario.reporting.drawing.scenario_picture import is_road_file, source_figure
from eidrive_scenario.reporting.drawing.vector_canvas import DEFAULT_SIZE, Size, checked_size, paper_style, write_figure
from eidrive_scenario.reporting.replay.page import make_replay
from eidrive_scenario.reporting.report_files import report_files
from eidrive_scenario.simulation import RunResult

HEIGHT = 900
"""Default height of a replay in a notebook [px]."""


@dataclass(frozen=True)
class RunDisplay:
    """Content that a notebook displays as HTML, and a console as text."""

    html: str
    text: str

    def _repr_html_(self) -> str:
        return self.html

    def __repr__(self) -> str:
        return self.text


@dataclass(frozen=True)
class Picture:
    """Figure that a notebook displays as SVG; `write` writes an .svg, .pdf or .png file."""

    figure: Figure

    def write(self, path: str | PathLike[str]) -> None:
        """Write the figure in the format of the suffix of a path. Raise SettingError for another suffix."""
        write_figure(self.figure, path)

    def _repr_svg_(self) -> str:
        text = io.StringIO()
        with paper_style():
            self.figure.savefig(text, format="svg", metadata={"Date": None})
        return text.getvalue()


def show(run: RunResult | str | PathLike[str], height: int = HEIGHT) -> RunDisplay:
    """Return the verdicts of a run and, if it was recorded, its replay for the output of a notebook.

    run     result of a run, or the folder or recording of one
    height  of the replay [px]

    Raise InputError if there is no recording at a path, or none of its frames can be read, and for another object.
    """
    if isinstance(run, RunResult):
        recording, verdicts = run.recording, run._repr_html_()
        text = str(run)
    else:
        location = path_argument(run, "run", "the result of a run, its folder or its recording")
        recording, verdicts = recording_in(location), ""
        text = str(recording)
    return RunDisplay(verdicts + ("" if recording is None else _replay_frame(recording, height)), text)


def draw(source: str | PathLike[str] | Scenario, size: Size = DEFAULT_SIZE, station: str | None = None) -> Picture:
    """Return the picture of a scenario before its run, or of a road file.

    source   file .xosc or .xodr, name of a scenario of the library, or a loaded Scenario
    size     width and height [mm]
    station  whose view is shaded; by default the first that drives

    Raise InputError for an invalid file, SettingError for a station of a road file or another size.
    """
    if not isinstance(source, Scenario):
        path = path_argument(source, "source", "the path of a scenario or road file, a library name or a Scenario")
        source = path if is_road_file(path) else resolve_scenario(path)
    return Picture(source_figure(source, checked_size(size), station))


def write_report(*runs: str | PathLike[str], out: str | PathLike[str]) -> Path:
    """Write the report of runs, as `eidrive report` does, with a replay of each recorded run; return its path.

    runs  folders of runs, their parents, and stores of sweeps
    out   file of the page if it ends in `.html`, else the folder of `report.html`

    Raise InputError without any result.
    """
    locations = [path_argument(run, "runs", "paths, each as an argument") for run in runs]
    return report_files(locations, path_argument(out, "out"))


def write_replay(recording: str | PathLike[str], out: str | PathLike[str]) -> Path:
    """Write the replay of a run, as `eidrive view` does, and return its path.

    recording  a recording, or the folder of a run

    Raise InputError if no frame can be read.
    """
    location, page = path_argument(recording, "recording"), path_argument(out, "out")
    make_replay(open_recording(recording_in(location)), page)
    return page


def _replay_frame(recording: Path, height: int) -> str:
    """Return the replay as an element of HTML that contains its page."""
    with TemporaryDirectory() as folder:
        page = write_replay(recording, Path(folder, "replay.html")).read_text(encoding="utf-8")
    return f'<iframe style="width:100%;height:{height}px;border:0" srcdoc="{html.escape(page)}"></iframe>'
