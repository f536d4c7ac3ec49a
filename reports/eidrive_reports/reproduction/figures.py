"""Figures of the parts: measured values with 95 % intervals beside those of the paper."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from eidrive_reports.paper import COUNTS, TABLE_2
from eidrive_reports.reproduction.layout import PartReport, Row, groups, limits, number, numbers, scenario_title, where
from eidrive_reports.reproduction.sensitivity import LIBRARY, ORIGINAL
from eidrive_scenario.api.pages import heat_cells, write_figure

Tables = Mapping[str, Sequence[Row]]
"""Rows of the tables of a part by the name of their file."""
FAULT_STYLES = {"independent": ("#0072b2", "o"), "bursty": ("#d55e00", "s"), "radio": ("#009e73", "^")}
"""Colors of Okabe and Ito, which color-blind readers can distinguish, and markers."""
ACCESS_STYLES = tuple(FAULT_STYLES.values())


def channels_figure(data: Tables) -> Figure:
    """Draw success over latency and over received messages by scenario and planner, and the effects of the load."""
    columns = groups(data["channels"], "scenario", "planner")
    figure = Figure(figsize=(3.4 * len(columns) + 0.6, 8.4), layout="constrained")
    panels = figure.subplots(3, len(columns), squeeze=False)
    for ((scenario, planner), rows), column in zip(columns.items(), panels.T, strict=True):
        line = where(rows, fault="latency")
        _rate_curve(column[0], [row["value"] for row in line], line, "#0072b2", "o", "latency, 95 %")
        column[0].set_xlabel("latency [s]", fontsize=8)
        for fault, style in FAULT_STYLES.items():
            line = sorted(where(rows, fault=fault), key=lambda row: number(row, "reception"))
            _rate_curve(column[1], numbers(line, "reception"), line, *style, fault)
        column[1].set_xlabel("received share of the messages", fontsize=8)
        (without,) = where(rows, fault="none")
        for axes in column[:2]:
            axes.axhline(without["share"], color="black", lw=0.8, ls="--", label="no cooperation")
        column[0].set_title(f"{scenario_title(scenario)}, {planner}", fontsize=9)
    for axes in panels[:2, 0]:
        axes.set_ylabel("share of runs without a collision", fontsize=8)
    panels[0, 0].legend(fontsize=7, loc="upper right")
    panels[1, 0].legend(fontsize=7, loc="upper left")
    _load(panels[2], data["channels_load"])
    for axes in panels.ravel():
        axes.tick_params(labelsize=7)
    return figure


def _rate_curve(axes: Axes, at: Sequence[float], rows: Sequence[Row], color: str, marker: str, label: str) -> None:
    axes.fill_between(at, numbers(rows, "low"), numbers(rows, "high"), color=color, alpha=0.15, lw=0)
    axes.plot(at, numbers(rows, "share"), marker=marker, color=color, ms=4, lw=1, label=label)
    axes.set_ylim(-0.03, 1.03)


def _load(panels: Sequence[Axes], rows: Sequence[Row]) -> None:
    """Draw busy ratio and received share, age of information, and success over the number of stations."""
    busy, age, success = panels[:3]
    for (access, mine), (color, marker) in zip(groups(rows, "access").items(), ACCESS_STYLES, strict=False):
        at = numbers(mine, "stations")
        look: dict[str, Any] = {"marker": marker, "color": color, "ms": 4, "lw": 1}
        busy.plot(at, numbers(mine, "busy"), label=access, **look)
        busy.plot(at, numbers(mine, "reception"), mfc="none", ls=":", **look)
        age.plot(at, numbers(mine, "age"), label="mean", **look)
        age.plot(at, numbers(mine, "p95_age"), mfc="none", ls=":", label="95 % of the time below", **look)
        _rate_curve(success, at, mine, color, marker, access)
    busy.set_ylabel("busy ratio (solid), received (dotted)", fontsize=8)
    age.set_ylabel("age of information [s]", fontsize=8)
    success.set_ylabel("share of runs without a collision", fontsize=8)
    busy.legend(fontsize=7)
    age.legend(fontsize=6)
    busy.set_ylim(-0.03, 1.03)
    age.set_ylim(bottom=0.0)
    for axes in panels:
        axes.set_xlabel("stations, scenario 1", fontsize=8)


MAP_COLORS = "YlOrBr"
"""Color map of the probability of a collision, from 0 (light) to 1 (dark); color-blind readers can distinguish it."""
MARKS = (("s", "start of EI-Drive", ORIGINAL), ("o", "start of the library", LIBRARY))
"""Marks on the maps: symbol, label and places."""
PAPER_LATENCY = 0.3
"""Latency of the arm `latency` of the paper [s]."""


def sensitivity_figure(data: Tables) -> Figure:
    """Draw one map per planner, scenario and arm, and the curve over the latency beside them."""
    lines = groups(data["sensitivity"], "planner", "scenario")
    arms = list(groups(data["sensitivity"], "arm"))
    figure = Figure(figsize=(2.1 * len(arms) + 3.6, 2.7 * len(lines)), layout="constrained")
    panels = figure.subplots(len(lines), len(arms) + 1, squeeze=False, width_ratios=[1.0] * len(arms) + [1.5])
    for ((planner, scenario), cells), line in zip(lines.items(), panels, strict=True):
        for (arm, mine), axes in zip(groups(cells, "arm").items(), line[:-1], strict=True):
            image = _map(axes, mine)
            for symbol, label, places in MARKS:
                axes.plot(*places[scenario], symbol, ms=5, mfc="none", mec="black", label=label)
            axes.set_title(f"{scenario_title(scenario)}, {arm}", fontsize=8)
            axes.tick_params(labelsize=7, labelleft=arm == arms[0])
        line[0].set_ylabel(f"{planner}\nspeed of the ego [m/s]", fontsize=8)
        _latency_curve(line[-1], where(data["sensitivity_latency"], planner=planner, scenario=scenario))
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
    starts, speeds = (sorted(groups(rows, name)) for name in ("start", "speed"))
    shares = np.full((len(speeds), len(starts)), np.nan)
    for row in rows:
        shares[speeds.index(row["speed"]), starts.index(row["start"])] = row["collisions"] / row["episodes"]
    return heat_cells(axes, starts, speeds, shares, colors=MAP_COLORS, scale=Normalize(0.0, 1.0), line=0.0)


def _latency_curve(axes: Axes, rows: Sequence[Row]) -> None:
    latency, low, share, high = (numbers(rows, name) for name in ("latency", "low", "share", "high"))
    axes.fill_between(latency, low, high, color="#0b6e99", alpha=0.2, lw=0)
    axes.plot(latency, share, "o-", color="#0b6e99", ms=3, lw=1)
    axes.axvline(PAPER_LATENCY, color="black", lw=0.8, ls="--")
    axes.set_ylim(-0.03, 1.03)
    axes.tick_params(labelsize=7)


ARM_STYLES = {
    "none": ("#6b7280", "-"),
    "average": ("#c2410c", "-"),
    "covariance_intersection": ("#0b6e99", "-"),
    "covariance_intersection, aligned": ("#0b6e99", "--"),
    "early": ("#15803d", "-"),
    "attention": ("#7e22ce", "-"),
    "attention, aligned": ("#7e22ce", "--"),
    "where2comm": ("#db2777", "-"),
}
"""Color and style of the line of each arm."""
AXIS_LABELS = {
    "pose error": "pose error [m], and 1° at 0.6 m",
    "pose drift": "pose drift [m], and 1° at 0.6 m",
    "latency": "latency [s]",
    "loss": "share of lost messages",
}
"""Axes that are drawn, in order."""
OVERLAPS = (0.7, 0.5)
INTERVALS = 0.25
"""Opacity of the 95 % intervals of curves."""


def precision_figure(data: Tables, part: str) -> Figure:
    """Draw the precision at two overlaps and the recall of hidden objects over each axis, then volume and ranges."""
    curves, hidden, volumes = data[part], data[f"{part}_hidden"], data[f"{part}_volume"]
    names = [name for name in AXIS_LABELS if name in groups(curves, "axis")]
    figure = Figure(figsize=(7.6, 2.0 * (len(names) + 1) + 0.7), layout="constrained")
    panels = figure.subplots(len(names) + 1, len(OVERLAPS) + 1, squeeze=False)
    whole = where(curves, range="all")
    for name, line in zip(names, panels, strict=False):
        for overlap, axes in zip(OVERLAPS, line, strict=False):
            _curves(axes, _on_axis(whole, name, overlap), "ap")
        _curves(line[-1], _on_axis(hidden, name, 0.5), "recall")
        for axes in line:
            axes.set_xlabel(AXIS_LABELS[name], fontsize=8)
            axes.set_ylim(0.0, 1.0)
    for overlap, column in zip(OVERLAPS, panels.T, strict=False):
        top = 1.05 * max(limits(where(whole, iou=overlap), "ap")[1])
        for axes in column[:-1]:
            axes.set_ylim(0.0, min(1.0, top))
        column[0].set_title(f"average precision at {overlap:g}", fontsize=9)
        _volumes(column[-1], volumes, overlap)
    panels[0][-1].set_title("recall of hidden objects at 0.5", fontsize=9)
    _ranges(panels[-1][-1], where(curves, axis="latency", value=0.0))
    for axes in panels.ravel():
        axes.tick_params(labelsize=7)
        axes.grid(axis="y", color="#e5e7eb", lw=0.5)
        axes.set_axisbelow(True)
    shares = {_volume_curve(row) for row in volumes}
    styles = {**_present(curves), **{name: style for name, style in VOLUME_CURVES.items() if name in shares}}
    handles = [
        Line2D([], [], color=color, ls=style, marker="o", ms=3, lw=1.2, label=name)
        for name, (color, style) in styles.items()
    ]
    figure.legend(handles=handles, loc="outside upper center", ncols=3, fontsize=8, frameon=False)
    return figure


def _on_axis(rows: Sequence[Row], axis: str, overlap: float) -> list[Row]:
    """Return the rows of an axis; those of aligned poses only if poses have errors, as they do not differ otherwise."""
    mine = where(rows, axis=axis, iou=overlap)
    return mine if axis.startswith("pose") else _without_alignment(mine)


def _without_alignment(rows: Sequence[Row]) -> list[Row]:
    return [row for row in rows if not row["arm"].endswith("aligned")]


def _present(rows: Sequence[Row]) -> dict[str, tuple[str, str]]:
    """Return color and style of the arms of these rows."""
    names = groups(rows, "arm")
    return {arm: style for arm, style in ARM_STYLES.items() if arm in names}


def _curves(axes: Axes, rows: Sequence[Row], name: str) -> None:
    """Draw one curve per arm, with its intervals side by side."""
    styles = _present(rows)
    step = 0.008 * max((row["value"] for row in rows), default=0.0)
    for index, (arm, (color, style)) in enumerate(styles.items()):
        mine = where(rows, arm=arm)
        at = numbers(mine, "value")
        shift = step * (index - (len(styles) - 1) / 2.0)
        axes.vlines([value + shift for value in at], *limits(mine, name), color=color, alpha=INTERVALS, lw=1.2)
        axes.plot(at, numbers(mine, name), "o", ls=style, color=color, ms=2.5, lw=1.3)


def _ranges(axes: Axes, rows: Sequence[Row]) -> None:
    """Draw the average precision by range and arm; aligned poses do not differ without errors."""
    mine = [row for row in _without_alignment(where(rows, iou=0.5)) if row["range"] != "all"]
    ranges, styles = list(groups(mine, "range")), _present(mine)
    width = 0.8 / len(styles)
    for index, (arm, (color, _)) in enumerate(styles.items()):
        some = where(mine, arm=arm)
        at = [ranges.index(row["range"]) + width * (index - (len(styles) - 1) / 2.0) for row in some]
        axes.bar(at, numbers(some, "ap"), width, color=color)
        axes.vlines(at, *limits(some, "ap"), color="black", lw=0.6)
    axes.set_xticks(range(len(ranges)), labels=ranges)
    axes.set_xlabel("distance from the ego, without faults", fontsize=8)
    axes.set_ylabel("average precision at 0.5", fontsize=8)


VOLUME = "megabytes_per_second"
VOLUME_CURVES = {
    "bytes: features and boxes": ("#7e22ce", "-"),
    "bytes: features only": ("#a16207", "-"),
    "bytes: features as codes, and boxes": ("#7e22ce", ":"),
}
"""Curves over the volume with one point per share of the cells; each other arm is a curve or a point."""


def _volumes(axes: Axes, rows: Sequence[Row], overlap: float) -> None:
    """Draw the average precision over the size of the messages; the ego alone is a horizontal line."""
    styles = {**_present(rows), **VOLUME_CURVES}
    for curve in dict.fromkeys(_volume_curve(row) for row in rows):
        mine = sorted((row for row in rows if _volume_curve(row) == curve), key=lambda row: number(row, VOLUME))
        if curve not in styles:
            continue
        color, style = styles[curve]
        values = numbers(mine, f"ap_{round(100.0 * overlap)}")
        if curve == "none":
            axes.axhline(values[0], color=color, lw=1.3, ls=style)
        else:
            axes.plot(numbers(mine, VOLUME), values, "o", ls=style, color=color, ms=2.5, lw=1.3)
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter("{x:g}")
    axes.set_xlabel("all messages [MB/s]", fontsize=8)


def _volume_curve(row: Row) -> str:
    """Return the curve over the volume to which a row belongs."""
    arm: str = row["arm"]
    if row["share"] is None or arm in ("max", "attention, aligned"):
        return arm
    if row["encoding"] == "codes":
        return "bytes: features as codes, and boxes"
    return "bytes: features only" if arm.startswith("features only") else "bytes: features and boxes"


ORDERED_COLORS = ("#0b6e99", "#c2410c")
PAPER = "#111827"
"""Color of the values of the paper."""


def table_2_figure(data: Tables) -> Figure:
    """Draw the means of the minimum distance by arm: one panel per planner and column of the paper."""
    rows = data["table2"]
    planners, columns = groups(rows, "planner"), list(groups(rows, "scenario", "detector"))
    arms = list(groups(rows, "arm"))
    figure = Figure(figsize=(2.9 * len(columns) + 1.2, 3.2 * len(planners)), layout="constrained")
    panels = figure.subplots(len(planners), len(columns), sharex=True, sharey="row", squeeze=False)
    for planner, line in zip(planners, panels, strict=True):
        for (scenario, detector), axes in zip(columns, line, strict=True):
            mine = groups(where(rows, planner=planner, scenario=scenario, detector=detector), "channel")
            for shift, ((rule, some), color) in enumerate(zip(mine.items(), ORDERED_COLORS, strict=False)):
                at = [arms.index(row["arm"]) - 0.2 + 0.2 * shift for row in some]
                low, high = limits(some, "mean")
                _interval(axes, at, low, numbers(some, "mean"), high, color, f"{rule}, 95 %")
            _paper_points(axes, arms, scenario, detector)
            axes.set_title(f"{scenario_title(scenario)}, {detector}\n{planner}", fontsize=9)
            axes.set_xticks(range(len(arms)), labels=arms, fontsize=8, rotation=20)
        line[0].set_ylabel("minimum distance of centers [m]", fontsize=8)
    panels[0][0].legend(fontsize=7)
    return figure


def _paper_points(axes: Axes, arms: Sequence[str], scenario: str, detector: str) -> None:
    """Draw mean, standard deviation and the episodes of the paper."""
    for index, arm in enumerate(arms):
        published = TABLE_2[scenario, detector, arm]
        at = index + 0.25
        label = "paper: mean ± sd, episodes" if index == 0 else None
        _paper_values(axes, [at], [published.mean], [published.sd], label)
        axes.plot([at + 0.12] * len(published.episodes), published.episodes, "_", ms=5, color=PAPER, alpha=0.5)


def _paper_values(
    axes: Axes, at: Sequence[float], values: Sequence[float], spread: Sequence[float], label: str | None
) -> None:
    """Draw values of the paper with their standard deviations."""
    axes.errorbar(at, values, yerr=spread, fmt="D", ms=5, mfc="none", color=PAPER, capsize=2, lw=1, label=label)


def table_3_figure(data: Tables) -> Figure:
    """Draw the success rates by senders: one panel per scenario and detector."""
    rows = data["table3"]
    scenarios, detectors, senders = (list(groups(rows, name)) for name in ("scenario", "detector", "senders"))
    figure = Figure(figsize=(2.6 * len(scenarios) + 1.0, 3.0 * len(detectors)), layout="constrained")
    panels = figure.subplots(len(detectors), len(scenarios), sharex=True, sharey=True, squeeze=False)
    for detector, line in zip(detectors, panels, strict=True):
        for scenario, axes in zip(scenarios, line, strict=True):
            mine = where(rows, scenario=scenario, detector=detector)
            at = [senders.index(row["senders"]) for row in mine]
            low, rate, high = (numbers(mine, name) for name in ("rate_low", "rate", "rate_high"))
            _interval(axes, [index - 0.1 for index in at], low, rate, high, ORDERED_COLORS[0], "measured, 95 %")
            paper, spread = (numbers(mine, name) for name in ("paper_rate", "paper_rate_sd"))
            _paper_values(axes, [index + 0.1 for index in at], paper, spread, "paper ± sd")
            axes.set_title(f"{scenario_title(scenario)}, {detector}", fontsize=9)
            axes.set_xticks(range(len(senders)), labels=senders, fontsize=8)
            axes.set_xlim(-0.5, len(senders) - 0.5)
            axes.set_ylim(-0.05, 1.05)
        line[0].set_ylabel("share of runs without a collision", fontsize=8)
    panels[0][0].legend(fontsize=7, loc="lower left")
    return figure


def detection_figure(data: Tables) -> Figure:
    """Draw the moving averages of the counts over time, with and without cooperation: one panel per column."""
    rows = data["detection_series"]
    scenarios, detectors = (groups(rows, name) for name in ("scenario", "detector"))
    figure = Figure(figsize=(3.6 * len(detectors) + 1.0, 2.6 * len(scenarios)), layout="constrained")
    panels = figure.subplots(len(scenarios), len(detectors), sharex=True, sharey=True, squeeze=False)
    for scenario, line in zip(scenarios, panels, strict=True):
        for detector, axes in zip(detectors, line, strict=True):
            mine = groups(where(rows, scenario=scenario, detector=detector), "arm")
            for (arm, some), color in zip(mine.items(), ORDERED_COLORS, strict=False):
                time, mean, sd = np.array([numbers(some, name) for name in ("time", "mean", "sd")])
                axes.plot(time, mean, color=color, lw=1.2, label=arm)
                axes.fill_between(time, mean - sd, mean + sd, color=color, alpha=0.2, lw=0)
                paper = COUNTS[scenario, detector, arm].mean
                axes.axhline(paper, color=color, lw=1, ls="--", label=f"{arm}, mean of the paper")
            axes.set_title(f"{scenario_title(scenario)}, {detector}", fontsize=9)
            axes.set_ylim(0, 20)
        line[0].set_ylabel("objects", fontsize=8)
    for axes in panels[-1]:
        axes.set_xlabel("time [s]", fontsize=8)
    panels[0][0].legend(fontsize=6, loc="upper left", ncols=2)
    return figure


FIGURES: Mapping[str, Callable[[Tables], Figure]] = {
    "table2": table_2_figure,
    "table3": table_3_figure,
    "detection": detection_figure,
    "sensitivity": sensitivity_figure,
    "channels": channels_figure,
    "perception": partial(precision_figure, part="perception"),
    "learned": partial(precision_figure, part="learned"),
}
"""Figure of a part, by the name of the part. The others have none."""


RESOLUTION = 110
"""Resolution of PNG files [dots per inch]."""


def draw(part: str, report: PartReport, out: Path) -> Path | None:
    """Draw the figure of a part into a folder as PNG and PDF; return the path of the PNG, None without a figure.

    Raise SettingError if the file cannot be written.
    """
    if part not in FIGURES:
        return None
    figure, path = FIGURES[part](report.data()), out / f"{part}.png"
    for suffix in (".png", ".pdf"):
        write_figure(figure, path.with_suffix(suffix), RESOLUTION)
    return path


def _interval(
    axes: Axes,
    at: Sequence[float],
    low: Sequence[float],
    middle: Sequence[float],
    high: Sequence[float],
    color: str,
    label: str,
) -> None:
    errors = np.maximum(0.0, [np.subtract(middle, low), np.subtract(high, middle)])
    axes.errorbar(at, middle, yerr=errors, fmt="o", ms=4, color=color, capsize=3, lw=1, label=label)
