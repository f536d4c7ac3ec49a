"""Figure of the sensitivity: maps of the probability of a collision, and curves over the latency."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from eidrive_scenario.experiments.reproduction.layout import Row
from eidrive_scenario.experiments.reproduction.rows import number, scenario_title
from eidrive_scenario.experiments.reproduction.sensitivity_text import LIBRARY, ORIGINAL
from eidrive_scenario.reporting.drawing.heat_cells import heat_cells

COLORS = "YlOrBr"
"""Color map of the probability of a collision, from 0 (light) to 1 (dark); color-blind readers can distinguish it."""
MARKS = (("s", "start of EI-Drive", ORIGINAL), ("o", "start of the library", LIBRARY))
"""Marks on the maps: symbol, label and places."""
PAPER_LATENCY = 0.3
"""Latency of the arm `latency` of the paper [s]."""


def sensitivity_figure(data: Mapping[str, Sequence[Row]]) -> Figure:
    """Draw one map per planner, scenario and arm, and the curve over the latency beside them."""
    cells, curve = data["sensitivity"], data["sensitivity_latency"]
    arms = list(dict.fromkeys(str(row["arm"]) for row in cells))
    lines = list(dict.fromkeys((str(row["planner"]), str(row["scenario"])) for row in cells))
    figure = Figure(figsize=(2.1 * len(arms) + 3.6, 2.7 * len(lines)), layout="constrained")
    panels = figure.subplots(len(lines), len(arms) + 1, squeeze=False, width_ratios=[1.0] * len(arms) + [1.5])
    for (planner, scenario), line in zip(lines, panels, strict=True):
        for arm, axes in zip(arms, line[:-1], strict=True):
            mine = [row for row in cells if (row["planner"], row["scenario"], row["arm"]) == (planner, scenario, arm)]
            image = _map(axes, mine)
            _marks(axes, scenario)
            axes.set_title(f"{scenario_title(scenario)}, {arm}", fontsize=8)
            axes.tick_params(labelsize=7, labelleft=arm == arms[0])
        line[0].set_ylabel(f"{planner}\nspeed of the ego [m/s]", fontsize=8)
        _curve(line[-1], [row for row in curve if (row["planner"], row["scenario"]) == (planner, scenario)])
        line[-1].set_title(f"{scenario_title(scenario)}, start of the library", fontsize=8)
    for axes in panels[-1][:-1]:
        axes.set_xlabel("start of the hidden car [m]", fontsize=7)
    panels[-1][-1].set_xlabel("latency [s]", fontsize=8)
    panels[0][0].legend(fontsize=6, loc="upper left")
    figure.colorbar(image, ax=list(panels[:, :-1].ravel()), pad=0.01).set_label(
        "share of runs with a collision", fontsize=8
    )
    return figure


def _map(axes: Axes, rows: Sequence[Row]) -> QuadMesh:
    starts, speeds = (sorted({number(row, name) for row in rows}) for name in ("start", "speed"))
    shares = np.full((len(speeds), len(starts)), np.nan)
    for row in rows:
        place = speeds.index(number(row, "speed")), starts.index(number(row, "start"))
        shares[place] = number(row, "collisions") / number(row, "episodes")
    return heat_cells(axes, starts, speeds, shares, colors=COLORS, scale=Normalize(0.0, 1.0), line=0.0)


def _marks(axes: Axes, scenario: str) -> None:
    for symbol, label, places in MARKS:
        start, speed = places[scenario]
        axes.plot(start, speed, symbol, ms=5, mfc="none", mec="black", label=label)


def _curve(axes: Axes, rows: Sequence[Row]) -> None:
    latency, low, share, high = ([number(row, name) for row in rows] for name in ("latency", "low", "share", "high"))
    axes.fill_between(latency, low, high, color="#0b6e99", alpha=0.2, lw=0)
    axes.plot(latency, share, "o-", color="#0b6e99", ms=3, lw=1)
    axes.axvline(PAPER_LATENCY, color="black", lw=0.8, ls="--")
    axes.set_ylim(-0.03, 1.03)
    axes.tick_params(labelsize=7)
