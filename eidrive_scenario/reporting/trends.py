"""Figures of known trends, measured and expected: `python -m eidrive_scenario.reporting.trends --out FOLDER`."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import typer
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from eidrive_scenario.errors import InputError
from eidrive_scenario.experiments.trends import (
    Curve,
    age_by_burst,
    largest_shift,
    precision_by_delay,
    reception_by_distance,
)
from eidrive_scenario.files.atomic import write_atomically

COLORS = ("#0b6e99", "#c2410c", "#4d7c0f", "#7e22ce")
SPEEDS = (5.0, 10.0, 15.0)
DELAYS = tuple(round(0.005 + 0.01 * step, 3) for step in range(40))
"""Message delays [s], between the knees, which are near multiples of 0.01 s."""
DISTANCES = (100, 200, 300, 400, 500, 600, 700, 800, 1000, 1200, 1500, 1800, 2100, 2500, 3000)
BURSTS = (1 / 0.7, 2.0, 3.0, 5.0, 7.0, 10.0, 15.0, 20.0)


def precision_figure() -> Figure:
    """Draw average precision over message delay, for three speeds and two IoU thresholds."""
    figure = Figure(figsize=(9.0, 6.5), layout="constrained")
    for axes, iou in zip(figure.subplots(2, 1, sharex=True), (0.7, 0.5), strict=True):
        for color, speed, size in zip(COLORS, SPEEDS, (11, 8, 5), strict=False):
            curve = precision_by_delay(speed, iou, DELAYS)
            look = {"ms": size, "mfc": "none", "lw": 1, "color": color}
            axes.plot(1e3 * curve.x, curve.measured, "o-", label=f"{speed:g} m/s, as received", **look)
            knee = 1e3 * largest_shift(iou) / speed
            axes.axvline(knee, color=color, lw=1, ls="--")
            axes.text(knee, 1.09, f"{knee:.0f} ms", color=color, ha="center", fontsize=8)
        predicted = precision_by_delay(SPEEDS[-1], iou, DELAYS, compensated=True)
        label = f"{SPEEDS[-1]:g} m/s, predicted to the current time"
        axes.plot(1e3 * predicted.x, predicted.measured, "x", ms=4, color=COLORS[3], label=label)
        axes.set_title(f"IoU {iou:g}: limit of speed times delay at {largest_shift(iou):.2f} m (dashed)", pad=16)
        axes.set_ylabel("average precision")
        axes.set_ylim(-0.05, 1.05)
    axes.set_xlabel("message delay [ms]")
    axes.legend(fontsize=8, loc="center right")
    return figure


def reception_figure() -> Figure:
    """Draw the packet reception ratio over distance, with and without the firetruck."""
    figure = Figure(figsize=(8.0, 4.5), layout="constrained")
    axes = figure.subplots()
    curves = [reception_by_distance(DISTANCES, truck=truck) for truck in (False, True)]
    _draw(axes, curves)
    axes.set_xscale("log")
    axes.set_xticks([100, 200, 500, 1000, 2000, 3000], labels=["100", "200", "500", "1000", "2000", "3000"])
    axes.minorticks_off()
    axes.set_xlabel("distance between antennas at 1.5 m height [m]")
    axes.set_ylabel("packet reception ratio")
    axes.set_title("IEEE 802.11p, TR 37.885 highway, 350 bytes; 300 messages at each distance")
    axes.legend(fontsize=8)
    return figure


def age_figure() -> Figure:
    """Draw the age of information over the mean length of loss bursts."""
    figure = Figure(figsize=(8.0, 4.5), layout="constrained")
    axes = figure.subplots()
    _draw(axes, age_by_burst(BURSTS))
    axes.set_xlabel("mean length of loss bursts [messages]")
    axes.set_ylabel("age of information [s]")
    axes.set_ylim(bottom=0.0)
    axes.set_title("Loss 30 %, period 0.1 s, delay 0.02 s: bursts increase the mean age, not the mean peak age")
    axes.legend(fontsize=8)
    return figure


def _draw(axes: Axes, curves: Sequence[Curve]) -> None:
    for color, curve in zip(COLORS, curves, strict=False):
        axes.plot(curve.x, curve.expected, "--", lw=1.2, color=color, label=f"{curve.label}, expected")
        if curve.chance is not None:
            low, high = curve.expected - curve.chance, curve.expected + curve.chance
            axes.fill_between(curve.x, low, high, color=color, alpha=0.15, lw=0, label="  95 % of all samples")
        axes.plot(curve.x, curve.measured, "o", ms=4, color=color, label=f"{curve.label}, measured")
        off = float(np.max(np.abs(curve.measured - curve.expected)))
        axes.plot([], [], " ", label=f"  largest difference {off:.3f}")


FIGURES = {
    "precision_by_delay": precision_figure,
    "reception_by_distance": reception_figure,
    "age_by_burst": age_figure,
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Draw all figures into a folder. Return 0, or 2 if the folder cannot be written."""
    parser = argparse.ArgumentParser(description="Draw known trends, measured and expected.")
    parser.add_argument("--out", type=Path, default=Path("reports/trends"))
    folder: Path = parser.parse_args(arguments).out
    for name, figure in FIGURES.items():
        path = folder / f"{name}.png"
        try:
            with write_atomically(path) as stream:
                figure().savefig(stream, format="png", dpi=130)
        except InputError as error:
            typer.echo(str(error), err=True)
            return 2
        typer.echo(f"wrote {path}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
