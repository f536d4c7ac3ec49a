"""Figures of the parts: measured values with 95 % intervals beside those of the paper."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from eidrive_scenario.experiments.published import COUNTS, TABLE_2
from eidrive_scenario.experiments.reproduction.layout import PartReport, Row
from eidrive_scenario.experiments.reproduction.rows import distinct, limits, number, scenario_title
from eidrive_scenario.files.atomic import write_atomically
from eidrive_scenario.reporting.reproduction.channel_curves import channels_figure
from eidrive_scenario.reporting.reproduction.maps import sensitivity_figure
from eidrive_scenario.reporting.reproduction.precision import perception_figure

COLORS = ("#0b6e99", "#c2410c")
PAPER = "#111827"
"""Color of the values of the paper."""
PaperRows = Mapping[str, Sequence[Row]]


def table_2_figure(data: PaperRows) -> Figure:
    """Draw the means of the minimum distance by arm: one panel per planner and column of the paper."""
    rows = data["table2"]
    planners, arms, rules = (distinct(rows, name) for name in ("planner", "arm", "channel"))
    columns = list(dict.fromkeys((str(row["scenario"]), str(row["detector"])) for row in rows))
    figure = Figure(figsize=(2.9 * len(columns) + 1.2, 3.2 * len(planners)), layout="constrained")
    panels = figure.subplots(len(planners), len(columns), sharex=True, sharey="row", squeeze=False)
    for planner, line in zip(planners, panels, strict=True):
        for (scenario, detector), axes in zip(columns, line, strict=True):
            mine = _select(rows, planner=planner, scenario=scenario, detector=detector)
            for shift, (rule, color) in enumerate(zip(rules, COLORS, strict=False)):
                some = _select(mine, channel=rule)
                _points(axes, [arms.index(str(row["arm"])) - 0.2 + 0.2 * shift for row in some], some, color, rule)
            _paper_points(axes, arms, scenario, detector)
            axes.set_title(f"{scenario_title(scenario)}, {detector}\n{planner}", fontsize=9)
            axes.set_xticks(range(len(arms)), labels=arms, fontsize=8, rotation=20)
        line[0].set_ylabel("minimum distance of centers [m]", fontsize=8)
    panels[0][0].legend(fontsize=7)
    return figure


def _paper_points(axes: Axes, arms: Sequence[str], scenario: str, detector: str) -> None:
    """Draw mean, standard deviation and the episodes of the paper."""
    for place, arm in enumerate(arms):
        published = TABLE_2[scenario, detector, arm]
        at = place + 0.25
        label = "paper: mean ± sd, episodes" if place == 0 else None
        _paper_values(axes, [at], [published.mean], [published.sd], label)
        axes.plot([at + 0.12] * len(published.episodes), published.episodes, "_", ms=5, color=PAPER, alpha=0.5)


def _paper_values(
    axes: Axes, at: Sequence[float], values: Sequence[float], spread: Sequence[float], label: str | None
) -> None:
    """Draw values of the paper with their standard deviations."""
    axes.errorbar(at, values, yerr=spread, fmt="D", ms=5, mfc="none", color=PAPER, capsize=2, lw=1, label=label)


def table_3_figure(data: PaperRows) -> Figure:
    """Draw the success rates by senders: one panel per scenario and detector."""
    rows = data["table3"]
    scenarios, detectors, senders = (distinct(rows, name) for name in ("scenario", "detector", "senders"))
    figure = Figure(figsize=(2.6 * len(scenarios) + 1.0, 3.0 * len(detectors)), layout="constrained")
    panels = figure.subplots(len(detectors), len(scenarios), sharex=True, sharey=True, squeeze=False)
    for detector, line in zip(detectors, panels, strict=True):
        for scenario, axes in zip(scenarios, line, strict=True):
            mine = _select(rows, scenario=scenario, detector=detector)
            at = [senders.index(str(row["senders"])) for row in mine]
            low, rate, high = ([number(row, name) for row in mine] for name in ("rate_low", "rate", "rate_high"))
            _interval(axes, [place - 0.1 for place in at], low, rate, high, COLORS[0], "measured, 95 %")
            paper, spread = ([number(row, name) for row in mine] for name in ("paper_rate", "paper_rate_sd"))
            _paper_values(axes, [place + 0.1 for place in at], paper, spread, "paper ± sd")
            axes.set_title(f"{scenario_title(scenario)}, {detector}", fontsize=9)
            axes.set_xticks(range(len(senders)), labels=senders, fontsize=8)
            axes.set_xlim(-0.5, len(senders) - 0.5)
            axes.set_ylim(-0.05, 1.05)
        line[0].set_ylabel("share of runs without a collision", fontsize=8)
    panels[0][0].legend(fontsize=7, loc="lower left")
    return figure


def detection_figure(data: PaperRows) -> Figure:
    """Draw the moving averages of the counts over time, with and without cooperation: one panel per column."""
    rows = data["detection_series"]
    scenarios, detectors, arms = (distinct(rows, name) for name in ("scenario", "detector", "arm"))
    figure = Figure(figsize=(3.6 * len(detectors) + 1.0, 2.6 * len(scenarios)), layout="constrained")
    panels = figure.subplots(len(scenarios), len(detectors), sharex=True, sharey=True, squeeze=False)
    for scenario, line in zip(scenarios, panels, strict=True):
        for detector, axes in zip(detectors, line, strict=True):
            for arm, color in zip(arms, COLORS, strict=False):
                mine = _select(rows, scenario=scenario, detector=detector, arm=arm)
                time, mean, sd = ([number(row, name) for row in mine] for name in ("time", "mean", "sd"))
                axes.plot(time, mean, color=color, lw=1.2, label=arm)
                band = [value - spread for value, spread in zip(mean, sd, strict=True)]
                top = [value + spread for value, spread in zip(mean, sd, strict=True)]
                axes.fill_between(time, band, top, color=color, alpha=0.2, lw=0)
                paper = COUNTS[scenario, detector, arm].mean
                axes.axhline(paper, color=color, lw=1, ls="--", label=f"{arm}, mean of the paper")
            axes.set_title(f"{scenario_title(scenario)}, {detector}", fontsize=9)
            axes.set_ylim(0, 20)
        line[0].set_ylabel("objects", fontsize=8)
    for axes in panels[-1]:
        axes.set_xlabel("time [s]", fontsize=8)
    panels[0][0].legend(fontsize=6, loc="upper left", ncols=2)
    return figure


FIGURES: Mapping[str, Callable[[PaperRows], Figure]] = {
    "table2": table_2_figure,
    "table3": table_3_figure,
    "detection": detection_figure,
    "sensitivity": sensitivity_figure,
    "channels": channels_figure,
    "perception": perception_figure,
}
"""Figure of a part, by the name of the part. The others have none."""


def draw(part: str, report: PartReport, out: Path) -> Path | None:
    """Draw the figure of a part into a folder and return its path; None for a part without a figure.

    Raise SettingError if the file cannot be written.
    """
    if part not in FIGURES:
        return None
    path = out / f"{part}.png"
    with write_atomically(path) as stream:
        # Without the version of matplotlib in the file, equal results give equal files
        FIGURES[part](report.data()).savefig(stream, format="png", dpi=130, metadata={"Software": None})
    return path


def _points(axes: Axes, at: Sequence[float], rows: Sequence[Row], color: str, label: str) -> None:
    low, high = limits(rows, "mean")
    _interval(axes, at, low, [number(row, "mean") for row in rows], high, color, f"{label}, 95 %")


def _interval(
    axes: Axes,
    at: Sequence[float],
    low: Sequence[float],
    middle: Sequence[float],
    high: Sequence[float],
    color: str,
    label: str,
) -> None:
    below = [value - end for value, end in zip(middle, low, strict=True)]
    above = [end - value for value, end in zip(middle, high, strict=True)]
    errors = [[max(0.0, one) for one in below], [max(0.0, one) for one in above]]
    axes.errorbar(at, middle, yerr=errors, fmt="o", ms=4, color=color, capsize=3, lw=1, label=label)


def _select(rows: Sequence[Row], **fields: str) -> list[Row]:
    return [row for row in rows if all(row[name] == value for name, value in fields.items())]
