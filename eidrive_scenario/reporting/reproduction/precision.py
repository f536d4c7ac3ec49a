"""Figure of cooperative perception: average precision over faults, range and volume, and recall of hidden objects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from eidrive_scenario.experiments.reproduction.layout import Row
from eidrive_scenario.experiments.reproduction.rows import limits, number

COLORS = {
    "none": "#6b7280",
    "average": "#c2410c",
    "covariance_intersection": "#0b6e99",
    "early": "#15803d",
}
"""Color of each arm."""
UNITS = {"pose error": "pose error [m], and 1° at 0.6 m", "pose drift": "pose drift [m], and 1° at 0.6 m"}
UNITS |= {"latency": "latency [s]", "loss": "share of lost messages"}
OVERLAPS = (0.5, 0.7)
HIDDEN_AXES = ("pose error", "loss")


def perception_figure(data: Mapping[str, Sequence[Row]]) -> Figure:
    """Draw the curves over each axis at two overlaps, then range, hidden objects and volume."""
    curves, hidden, volumes = data["perception"], data["perception_hidden"], data["perception_volume"]
    axes_names = list(dict.fromkeys(str(row["axis"]) for row in curves))
    figure = Figure(figsize=(3.4 * len(axes_names), 9.0), layout="constrained")
    panels = figure.subplots(len(OVERLAPS) + 1, len(axes_names), squeeze=False)
    for overlap, line in zip(OVERLAPS, panels, strict=False):
        mine = [row for row in curves if row["range"] == "all" and row["iou"] == overlap]
        top = 1.05 * max(limits(mine, "ap")[1])
        for name, axes in zip(axes_names, line, strict=True):
            _curves(axes, [row for row in mine if row["axis"] == name], "ap")
            axes.set_xlabel(UNITS.get(name, name), fontsize=8)
            axes.set_ylim(0.0, top)
        line[0].set_ylabel(f"average precision at {overlap:g}", fontsize=8)
    panels[0][0].legend(fontsize=7)
    last = panels[-1]
    _ranges(last[0], [row for row in curves if row["axis"] == "latency" and row["value"] == 0.0])
    for name, axes in zip(HIDDEN_AXES, last[1:], strict=False):
        _curves(axes, [row for row in hidden if row["axis"] == name and row["iou"] == OVERLAPS[0]], "recall")
        axes.set_xlabel(UNITS[name], fontsize=8)
        axes.set_ylabel("recall of hidden objects at 0.5", fontsize=8)
        axes.set_ylim(0.0, 1.0)
    _volumes(last[3], volumes)
    for axes in panels.ravel():
        axes.tick_params(labelsize=7)
        axes.grid(alpha=0.3, lw=0.5)
    return figure


def _curves(axes: Axes, rows: Sequence[Row], name: str) -> None:
    """Draw one curve per arm with its interval."""
    for arm, color in COLORS.items():
        mine = [row for row in rows if row["arm"] == arm]
        at, middle = ([number(row, field) for row in mine] for field in ("value", name))
        axes.fill_between(at, *limits(mine, name), color=color, alpha=0.12, lw=0)
        axes.plot(at, middle, "o-", color=color, ms=3, lw=1.2, label=f"{arm}, 95 %")


def _ranges(axes: Axes, rows: Sequence[Row]) -> None:
    """Draw the average precision by range and arm."""
    mine = [row for row in rows if row["iou"] == OVERLAPS[0] and row["range"] != "all"]
    places = list(dict.fromkeys(str(row["range"]) for row in mine))
    width = 0.8 / len(COLORS)
    for place, (arm, color) in enumerate(COLORS.items()):
        some = [row for row in mine if row["arm"] == arm]
        at = [places.index(str(row["range"])) + width * (place - (len(COLORS) - 1) / 2) for row in some]
        values = [number(row, "ap") for row in some]
        errors = [[abs(end - value) for value, end in zip(values, ends, strict=True)] for ends in limits(some, "ap")]
        axes.bar(at, values, width, color=color, yerr=errors, error_kw={"lw": 0.8})
    axes.set_xticks(range(len(places)), labels=places)
    axes.set_xlabel("distance from the ego, without faults", fontsize=8)
    axes.set_ylabel(f"average precision at {OVERLAPS[0]:g}", fontsize=8)


def _volumes(axes: Axes, rows: Sequence[Row]) -> None:
    """Draw the average precision over the size of the messages; the ego alone is a horizontal line."""
    for arm, color in COLORS.items():
        mine = sorted((row for row in rows if row["arm"] == arm), key=lambda row: number(row, "megabytes_per_second"))
        for overlap, style in zip(OVERLAPS, ("o-", "s--"), strict=True):
            values = [number(row, f"ap_{round(100.0 * overlap)}") for row in mine]
            if arm == "none":
                axes.axhline(values[0], color=color, lw=1, ls=style[1:])
                continue
            at = [number(row, "megabytes_per_second") for row in mine]
            label = f"at {overlap:g}" if arm == "early" else None
            axes.plot(at, values, style, color=color, ms=3, lw=1.2, label=label)
    axes.set_xscale("log")
    axes.set_xlabel("all messages [MB/s]", fontsize=8)
    axes.set_ylabel("average precision", fontsize=8)
    axes.legend(fontsize=7)
