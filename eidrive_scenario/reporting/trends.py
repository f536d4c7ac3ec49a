"""Pictures of known trends, measured and expected: `python -m eidrive_scenario.reporting.trends --out FOLDER`."""

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
from eidrive_scenario.files.atomic import create

COLORS = ("#0b6e99", "#c2410c", "#4d7c0f", "#7e22ce")
SPEEDS = (5.0, 10.0, 15.0)
DELAYS = tuple(round(0.005 + 0.01 * step, 3) for step in range(40))
"""Between the knees, which all lie at whole hundredths of a second or near them [s]."""
DISTANCES = (100, 200, 300, 400, 500, 600, 700, 800, 1000, 1200, 1500, 1800, 2100, 2500, 3000)
BURSTS = (1 / 0.7, 2.0, 3.0, 5.0, 7.0, 10.0, 15.0, 20.0)


def precision_picture() -> Figure:
    """Average precision over the delay, for three speeds and both usual thresholds."""
    figure = Figure(figsize=(9.0, 6.5), layout="constrained")
    for axes, iou in zip(figure.subplots(2, 1, sharex=True), (0.7, 0.5), strict=True):
        for color, speed, size in zip(COLORS, SPEEDS, (11, 8, 5), strict=False):
            curve = precision_by_delay(speed, iou, DELAYS)
            look = {"ms": size, "mfc": "none", "lw": 1, "color": color}
            axes.plot(1e3 * curve.x, curve.measured, "o-", label=f"{speed:g} m/s, as received", **look)
            knee = 1e3 * largest_shift(iou) / speed
            axes.axvline(knee, color=color, lw=1, ls="--")
            axes.text(knee, 1.09, f"{knee:.0f} ms", color=color, ha="center", fontsize=8)
        moved = precision_by_delay(SPEEDS[-1], iou, DELAYS, compensated=True)
        label = f"{SPEEDS[-1]:g} m/s, moved on to the present"
        axes.plot(1e3 * moved.x, moved.measured, "x", ms=4, color=COLORS[3], label=label)
        axes.set_title(f"IoU {iou:g}: lost where speed times delay passes {largest_shift(iou):.2f} m (dashed)", pad=16)
        axes.set_ylabel("average precision")
        axes.set_ylim(-0.05, 1.05)
    axes.set_xlabel("delay of the messages [ms]")
    axes.legend(fontsize=8, loc="center right")
    return figure


def reception_picture() -> Figure:
    """Packet reception over the distance, with and without the firetruck."""
    figure = Figure(figsize=(8.0, 4.5), layout="constrained")
    axes = figure.subplots()
    curves = [reception_by_distance(DISTANCES, truck=truck) for truck in (False, True)]
    _draw(axes, curves)
    axes.set_xscale("log")
    axes.set_xticks([100, 200, 500, 1000, 2000, 3000], labels=["100", "200", "500", "1000", "2000", "3000"])
    axes.minorticks_off()
    axes.set_xlabel("distance between the antennas, 1.5 m high [m]")
    axes.set_ylabel("packet reception ratio")
    axes.set_title("IEEE 802.11p, TR 37.885 highway, 350 bytes; 300 messages at each distance")
    axes.legend(fontsize=8)
    return figure


def age_picture() -> Figure:
    """Age of information over the length of bursts."""
    figure = Figure(figsize=(8.0, 4.5), layout="constrained")
    axes = figure.subplots()
    _draw(axes, age_by_burst(BURSTS))
    axes.set_xlabel("mean length of a burst of losses [messages]")
    axes.set_ylabel("age of information [s]")
    axes.set_ylim(bottom=0.0)
    axes.set_title("30 % of the messages lost, one every 0.1 s, 0.02 s late: bursts age, peaks do not tell")
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


PICTURES = {
    "precision_by_delay": precision_picture,
    "reception_by_distance": reception_picture,
    "age_by_burst": age_picture,
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Draw all pictures into a folder; 2 if nothing can be written there, else 0."""
    parser = argparse.ArgumentParser(description="Draw known trends, measured and expected.")
    parser.add_argument("--out", type=Path, default=Path("reports/trends"))
    folder: Path = parser.parse_args(arguments).out
    for name, picture in PICTURES.items():
        path = folder / f"{name}.png"
        try:
            with create(path) as stream:
                picture().savefig(stream, format="png", dpi=130)
        except InputError as error:
            typer.echo(str(error), err=True)
            return 2
        typer.echo(f"wrote {path}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
