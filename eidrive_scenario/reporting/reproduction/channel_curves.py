"""Figure of the part `channels`: success over latency, received messages and number of stations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from eidrive_scenario.experiments.reproduction.layout import Row
from eidrive_scenario.experiments.reproduction.rows import distinct, number, scenario_title

COLORS = {"independent": "#0072b2", "bursty": "#d55e00", "radio": "#009e73"}
"""Colors of Okabe and Ito, which color-blind readers can distinguish."""
MARKERS = {"independent": "o", "bursty": "s", "radio": "^"}


def channels_figure(data: Mapping[str, Sequence[Row]]) -> Figure:
    """Draw success over latency and over received messages by scenario and planner, and the effects of the load."""
    faults, loads = data["channels"], data["channels_load"]
    places = list(dict.fromkeys((str(row["scenario"]), str(row["planner"])) for row in faults))
    figure = Figure(figsize=(3.4 * len(places) + 0.6, 8.4), layout="constrained")
    panels = figure.subplots(3, len(places), squeeze=False)
    for (scenario, planner), column in zip(places, panels.T, strict=True):
        mine = [row for row in faults if (row["scenario"], row["planner"]) == (scenario, planner)]
        _latency(column[0], mine)
        _losses(column[1], mine)
        column[0].set_title(f"{scenario_title(scenario)}, {planner}", fontsize=9)
    for axes in panels[:2, 0]:
        axes.set_ylabel("share of runs without a collision", fontsize=8)
    panels[0, 0].legend(fontsize=7, loc="upper right")
    panels[1, 0].legend(fontsize=7, loc="upper left")
    _load(panels[2], loads)
    for axes in panels.ravel():
        axes.tick_params(labelsize=7)
    return figure


def _latency(axes: Axes, rows: Sequence[Row]) -> None:
    line = [row for row in rows if row["fault"] == "latency"]
    _curve(axes, [number(row, "value") for row in line], line, "#0072b2", "o", "latency, 95 %")
    _without_messages(axes, rows)
    axes.set_xlabel("latency [s]", fontsize=8)


def _losses(axes: Axes, rows: Sequence[Row]) -> None:
    for fault, color in COLORS.items():
        line = sorted((row for row in rows if row["fault"] == fault), key=lambda row: number(row, "reception"))
        _curve(axes, [number(row, "reception") for row in line], line, color, MARKERS[fault], fault)
    _without_messages(axes, rows)
    axes.set_xlabel("received share of the messages", fontsize=8)


def _curve(axes: Axes, at: Sequence[float], rows: Sequence[Row], color: str, marker: str, label: str) -> None:
    low, share, high = ([number(row, name) for row in rows] for name in ("low", "share", "high"))
    axes.fill_between(at, low, high, color=color, alpha=0.15, lw=0)
    axes.plot(at, share, marker=marker, color=color, ms=4, lw=1, label=label)
    axes.set_ylim(-0.03, 1.03)


def _without_messages(axes: Axes, rows: Sequence[Row]) -> None:
    (row,) = (row for row in rows if row["fault"] == "none")
    axes.axhline(number(row, "share"), color="black", lw=0.8, ls="--", label="no cooperation")


def _load(panels: Sequence[Axes], rows: Sequence[Row]) -> None:
    """Draw busy ratio and received share, age of information, and success over the number of stations."""
    busy, age, success = panels[:3]
    for (access, color), marker in zip(
        zip(distinct(rows, "access"), ("#0072b2", "#d55e00"), strict=False), "os", strict=False
    ):
        mine = [row for row in rows if row["access"] == access]
        at = [number(row, "stations") for row in mine]
        busy.plot(at, [number(row, "busy") for row in mine], marker=marker, color=color, ms=4, lw=1, label=access)
        received = [number(row, "reception") for row in mine]
        busy.plot(at, received, marker=marker, mfc="none", color=color, ms=4, lw=1, ls=":")
        age.plot(at, [number(row, "age") for row in mine], marker=marker, color=color, ms=4, lw=1, label="mean")
        late = [number(row, "p95_age") for row in mine]
        age.plot(at, late, marker=marker, mfc="none", color=color, ms=4, lw=1, ls=":", label="95 % of the time below")
        _curve(success, at, mine, color, marker, access)
    busy.set_ylabel("busy ratio (solid), received (dotted)", fontsize=8)
    age.set_ylabel("age of information [s]", fontsize=8)
    success.set_ylabel("share of runs without a collision", fontsize=8)
    busy.legend(fontsize=7)
    age.legend(fontsize=6)
    busy.set_ylim(-0.03, 1.03)
    age.set_ylim(bottom=0.0)
    for axes in panels:
        axes.set_xlabel("stations, scenario 1", fontsize=8)
