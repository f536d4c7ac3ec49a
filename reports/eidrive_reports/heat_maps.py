"""Heat maps of outcomes over two parameters: `python -m eidrive_reports.heat_maps --out FOLDER`.

Each distribution yields one figure with a map per arm: no cooperation, cooperation, and cooperation with latency.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib
import numpy as np
import typer
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from rich.console import Console

from eidrive_reports.studies import check_different, command, study_options
from eidrive_scenario.api.common import Diagnostic, SettingError, quoted
from eidrive_scenario.api.experiments import Job, from_library, run_jobs
from eidrive_scenario.api.pages import heat_cells, write_figure
from eidrive_scenario.api.run import ConcreteRun, RunSettings, load_distribution, run_file

ARMS: Mapping[str, Mapping[str, str]] = {
    "no cooperation": {"Participants": "none"},
    "cooperation": {"Participants": "both"},
    "latency 0.1 s": {"Participants": "both", "Latency": "0.1"},
    "latency 0.3 s": {"Participants": "both", "Latency": "0.3"},
    "latency 0.5 s": {"Participants": "both", "Latency": "0.5"},
}
"""Parameters of the runs of each arm."""


@dataclass(frozen=True)
class GridCell:
    """Outcome of one run: whether it passed, and the relative speed at its first collision [m/s] or None."""

    x: float
    y: float
    passed: bool
    impact_speed: float | None


@dataclass(frozen=True)
class OutcomeGrid:
    """Outcomes over the parameters `x_name` and `y_name`; cells of an arm are in the order of the distribution."""

    name: str
    x_name: str
    y_name: str
    arms: Mapping[str, tuple[GridCell, ...]]

    def collisions(self, arm: str) -> int:
        """Return the number of runs with a collision."""
        return sum(cell.impact_speed is not None for cell in self.arms[arm])


def run_outcome_grid(
    distribution: Path,
    *,
    arms: Mapping[str, Mapping[str, str]] = ARMS,
    parameters: Mapping[str, str] | None = None,
    seed: int = 1,
    workers: int | None = None,
    console: Console | None = None,
) -> OutcomeGrid:
    """Run all values of a distribution over two parameters in all arms.

    arms        parameters by arm, with precedence over `parameters` of all runs
    Raise SettingError if the distribution does not vary exactly two parameters, or a value is not a number.
    """
    runs = tuple(load_distribution(distribution, seed=seed))
    names = tuple(runs[0].parameters)
    if len(names) != 2:
        message = f"the distribution varies {len(names)} parameters (expected 2, the axes of the grid)"
        raise SettingError(Diagnostic(message, "use a distribution over two parameters", str(distribution)))
    x_name, y_name = names
    points = [(_number(distribution, run, x_name), _number(distribution, run, y_name)) for run in runs]
    jobs = [
        Job(str(run.scenario), arm, seed, RunSettings(parameters={**(parameters or {}), **values, **run.parameters}))
        for arm, values in arms.items()
        for run in runs
    ]
    outcomes = run_jobs(jobs, _outcome, workers=workers, console=console, title=distribution.stem)
    cells = [GridCell(*point, *outcome) for point, outcome in zip(points * len(arms), outcomes, strict=True)]
    by_arm = {arm: tuple(cells[n * len(runs) : (n + 1) * len(runs)]) for n, arm in enumerate(arms)}
    return OutcomeGrid(distribution.stem, x_name, y_name, by_arm)


def _outcome(job: Job) -> tuple[bool, float | None]:
    result = run_file(job.scenario, seed=job.seed, settings=job.settings)
    speed = result.metrics.get("collision.impact_speed")
    return result.passed, None if speed is None else float(speed)


def _number(distribution: Path, run: ConcreteRun, name: str) -> float:
    assignment = run.assignments[name]
    try:
        return float(assignment.text)
    except ValueError:
        message = f"parameter {quoted(name)}: not a number (got {quoted(assignment.text)})"
        hint = "use a distribution over numbers"
        raise SettingError(
            Diagnostic(message, hint, str(distribution), assignment.origin.line if assignment.origin else None)
        ) from None


DISTRIBUTIONS = ("ncap/crossing_car_grid", "ncap/crossing_child_grid")
"""Distributions of the library that are drawn by default."""
AVOIDED, UNFINISHED = "#d5e8d4", "#c9c9c9"
"""Colors of runs without a collision: passed, and failed by another criterion."""
COLLISION = "YlOrRd"
"""Color map of the speed at the collision."""
KMH = 3.6
"""Kilometers per hour in one meter per second."""


def heat_map(grid: OutcomeGrid) -> Figure:
    """Draw one map per arm. The color of a collision is its relative speed."""
    hits = [cell.impact_speed for cells in grid.arms.values() for cell in cells if cell.impact_speed is not None]
    scale = Normalize(0.0, KMH * max(hits, default=1.0))
    colors = matplotlib.colormaps[COLLISION]
    figure = Figure(figsize=(2.6 * len(grid.arms) + 1.4, 3.6), layout="constrained")
    maps = np.atleast_1d(figure.subplots(1, len(grid.arms), sharex=True, sharey=True))
    for axes, (arm, cells) in zip(maps, grid.arms.items(), strict=True):
        _draw(axes, cells, scale)
        axes.set_title(f"{arm}\n{grid.collisions(arm)} of {len(cells)} collide", fontsize=9)
        axes.set_xlabel(grid.x_name)
    maps[0].set_ylabel(grid.y_name)
    bar = figure.colorbar(matplotlib.cm.ScalarMappable(scale, colors), ax=list(maps))
    bar.set_label("relative speed at the collision [km/h]")
    return figure


def _draw(axes: Axes, cells: Sequence[GridCell], scale: Normalize) -> None:
    xs, ys = sorted({cell.x for cell in cells}), sorted({cell.y for cell in cells})
    speeds, others = np.full((2, len(ys), len(xs)), np.nan)
    for cell in cells:
        row, column = ys.index(cell.y), xs.index(cell.x)
        if cell.impact_speed is not None:
            speeds[row, column] = KMH * cell.impact_speed
        others[row, column] = float(not cell.passed)
    base = matplotlib.colors.ListedColormap([AVOIDED, UNFINISHED])
    heat_cells(axes, xs, ys, others, colors=base, scale=Normalize(0.0, 1.0))
    heat_cells(axes, xs, ys, speeds, colors=COLLISION, scale=scale)


@command
def main(arguments: Sequence[str] | None = None) -> None:
    """Run the distributions and draw their heat maps into a folder."""
    parser = argparse.ArgumentParser(description="Draw outcomes over two parameters, by cooperation and latency.")
    parser.add_argument("distributions", nargs="*", default=DISTRIBUTIONS, help="files, or names in the library")
    parser.add_argument("--param", action="append", default=[], metavar="NAME=VALUE", help="parameter of all runs")
    parser.add_argument("--seed", type=int, default=1)
    options = study_options(parser, arguments, out="reports/heat_maps")
    invalid = [text for text in options.param if "=" not in text]
    if invalid:
        parser.error(f"--param: not NAME=VALUE (got {invalid[0]!r})")
    check_different(parser, [Path(name).stem for name in options.distributions])
    parameters = dict(text.split("=", 1) for text in options.param)
    for name in options.distributions:
        grid = run_outcome_grid(
            from_library(name),
            parameters=parameters,
            seed=options.seed,
            workers=options.workers,
            console=Console(stderr=True),
        )
        path = options.out / f"{grid.name}.png"
        figure = heat_map(grid)
        for suffix in (".png", ".pdf"):
            write_figure(figure, path.with_suffix(suffix), 130)
        typer.echo(f"wrote {path}")


if __name__ == "__main__":
    sys.exit(main())
