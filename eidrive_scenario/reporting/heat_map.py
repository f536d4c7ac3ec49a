"""Heat maps of outcomes over two parameters: `python -m eidrive_scenario.reporting.heat_map --out FOLDER`.

Each distribution yields one figure with a map per arm: no cooperation, cooperation, and cooperation with latency.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import matplotlib
import numpy as np
import typer
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from rich.console import Console

from eidrive_scenario.errors import InputError
from eidrive_scenario.experiments.outcome_grid import GridCell, OutcomeGrid, run_outcome_grid
from eidrive_scenario.files.atomic import write_atomically
from eidrive_scenario.library import from_library
from eidrive_scenario.reporting.drawing.heat_cells import heat_cells

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


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the distributions and draw their heat maps into a folder. Return 0, or 2 if an input is invalid."""
    parser = argparse.ArgumentParser(description="Draw outcomes over two parameters, by cooperation and latency.")
    parser.add_argument("distributions", nargs="*", default=DISTRIBUTIONS, help="files, or names in the library")
    parser.add_argument("--out", type=Path, default=Path("reports/heat_maps"))
    parser.add_argument("--param", action="append", default=[], metavar="NAME=VALUE", help="parameter of all runs")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=None, help="processes; all cores by default")
    options = parser.parse_args(arguments)
    if options.workers is not None and options.workers < 1:
        parser.error(f"--workers: not a positive number (got {options.workers})")
    invalid = [text for text in options.param if "=" not in text]
    if invalid:
        parser.error(f"--param: not NAME=VALUE (got {invalid[0]!r})")
    parameters = dict(text.split("=", 1) for text in options.param)
    for name in options.distributions:
        try:
            grid = run_outcome_grid(
                from_library(name),
                parameters=parameters,
                seed=options.seed,
                workers=options.workers,
                console=Console(stderr=True),
            )
            path = options.out / f"{grid.name}.png"
            with write_atomically(path) as stream:
                heat_map(grid).savefig(stream, format="png", dpi=130)
        except InputError as error:
            typer.echo(str(error), err=True)
            return 2
        typer.echo(f"wrote {path}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
