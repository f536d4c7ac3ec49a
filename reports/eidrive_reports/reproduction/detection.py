"""Counts of detected objects in scenarios 3 and 4: with and without cooperation, over 400 time steps."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product

import numpy as np

from eidrive_reports.paper import COUNTS, EGO, RATIOS
from eidrive_reports.reproduction.episodes import Episode
from eidrive_reports.reproduction.layout import (
    REASON,
    Column,
    DataTable,
    PartReport,
    Row,
    Section,
    bounds,
    groups,
    plain,
    result_sections,
    where,
)
from eidrive_reports.reproduction.part import Case, Part, Runs, by_case
from eidrive_scenario.api.common import Array
from eidrive_scenario.api.experiments import interval_text, mean_interval, paired_difference, paired_ratio, summarize
from eidrive_scenario.api.run import RunSettings

SENDERS = {"coop/scenario_3": "vehicle", "coop/scenario_4": "rsu"}
"""Value of the parameter Participants with cooperation, by scenario."""
ARMS = ("none", "cooperation")
DETECTORS = ("oracle", "yolov5")
STEP = 0.03
"""Time step of EI-Drive's runs [s]."""
STEPS = 400
WINDOW = 10
"""Number of time steps of the moving average, as in the figure of the paper."""


def cases(detectors: Sequence[str]) -> list[Case]:
    """Return the runs of all cells."""
    return [
        Case(scenario, f"{detector} {arm}", _settings(detector, senders if arm == "cooperation" else "none"), EGO)
        for (scenario, senders), detector, arm in product(SENDERS.items(), detectors, ARMS)
    ]


def _settings(detector: str, senders: str) -> RunSettings:
    return RunSettings(detector=detector, dt=STEP, parameters={"Participants": senders})


def counts_of(episodes: Sequence[Episode]) -> Array:
    """Return the counts (episodes, time steps)."""
    return np.array([episode.counts[:STEPS] for episode in episodes], dtype=np.float64)


def moving_average(counts: Array, window: int = WINDOW) -> Array:
    """Return the mean of each count and those before it within the window, (episodes, time steps)."""
    total = np.cumsum(np.pad(counts, ((0, 0), (1, 0))), axis=1)
    end = np.arange(1, counts.shape[1] + 1)
    start = np.maximum(end - window, 0)
    averages: Array = (total[:, end] - total[:, start]) / (end - start)
    return averages


def _means(runs: Runs, scenario: str, detector: str, arm: str) -> list[float]:
    means: list[float] = counts_of(runs[scenario, f"{detector} {arm}"]).mean(axis=1).tolist()
    return means


def cell_row(runs: Runs, scenario: str, detector: str, arm: str) -> Row:
    """Return the fields of a cell beside those of the paper.

    mean, sd, low, high  mean count of an episode: mean, standard deviation and 95 % interval over the episodes; no
                         interval of one episode
    least, most          extremes over all time steps
    actors               mean number of different vehicles that the ego knows, without duplicates and false objects
    """
    mine = runs[scenario, f"{detector} {arm}"]
    counts, published = counts_of(mine), COUNTS[scenario, detector, arm]
    means = counts.mean(axis=1).tolist()
    interval = mean_interval(means)
    return {
        "scenario": scenario,
        "detector": detector,
        "arm": arm,
        "episodes": len(mine),
        "mean": interval.mean,
        "sd": summarize(means).population_sd,
        **bounds(interval),
        "least": int(counts.min()),
        "most": int(counts.max()),
        "actors": float(np.mean([episode.metrics[f"detection_count.{EGO}.mean"] for episode in mine])),
        "paper_mean": published.mean,
        "paper_least": published.least,
        "paper_most": published.most,
    }


def ratio_row(runs: Runs, scenario: str, detector: str) -> Row:
    """Return the ratio of the counts with and without cooperation; None if an episode counts nothing."""
    none, cooperation = (_means(runs, scenario, detector, arm) for arm in ARMS)
    ratio = paired_ratio(none, cooperation) if min(*none, *cooperation) > 0.0 else None
    return {
        "scenario": scenario,
        "detector": detector,
        "senders": SENDERS[scenario],
        "ratio": None if ratio is None else ratio.mean,
        **bounds(ratio),
        "more": float(np.mean(cooperation)) > float(np.mean(none)),
        "paper_ratio": RATIOS[scenario, detector],
    }


def series(runs: Runs, detectors: Sequence[str]) -> Iterator[Row]:
    """Yield mean and standard deviation over the episodes of the moving averages at each time step."""
    for scenario, detector, arm in product(SENDERS, detectors, ARMS):
        averages = moving_average(counts_of(runs[scenario, f"{detector} {arm}"]))
        key = {"scenario": scenario, "detector": detector, "arm": arm}
        for step, (mean, sd) in enumerate(np.stack([averages.mean(axis=0), averages.std(axis=0)], axis=1).tolist()):
            yield {**key, "step": step, "time": round(step * STEP, 6), "mean": mean, "sd": sd}


CELL_COLUMNS = (
    *map(plain, ("scenario", "detector", "arm")),
    Column("objects", "{mean:.1f} ± {sd:.1f}"),
    Column("95 %", "{low:.1f} to {high:.1f}"),
    Column("range", "{least} to {most}"),
    Column("paper (range)", "{paper_mean:.1f} ({paper_least} to {paper_most})"),
    plain("different vehicles", "actors", ".1f"),
)
RATIO_COLUMNS = (
    *map(plain, ("scenario", "senders", "detector")),
    plain("ratio", "ratio", ".2f"),
    Column("95 %", "{low:.2f} to {high:.2f}"),
    plain("paper", "paper_ratio", ".2f"),
)


def report(episodes: Sequence[Episode], detectors: Sequence[str]) -> PartReport:
    """Return the report: ratios, counts, and the moving averages as data."""
    runs = by_case(episodes)
    cells = [cell_row(runs, *key) for key in product(SENDERS, detectors, ARMS)]
    ratios = tuple(ratio_row(runs, *key) for key in product(SENDERS, detectors))
    sections = (
        Section("Set-up", _setup(cells[0]["episodes"])),
        *result_sections(_conclusions(runs, cells, ratios), DataTable("detection_ratios", RATIO_COLUMNS, ratios)),
        Section("Counts", (), DataTable("detection", CELL_COLUMNS, tuple(cells))),
        Section(
            "Moving averages",
            (f"Means over {WINDOW} time steps, and their standard deviation over the episodes: detection_series.csv.",),
            DataTable("detection_series", (), tuple(series(runs, detectors))),
        ),
    )
    return PartReport(PART.title, sections)


def _setup(episodes: int) -> tuple[str, ...]:
    return (
        f"Scenarios 3 and 4, {episodes} episodes a cell with seeds from 1, {STEPS} time steps of {STEP} s as in "
        "EI-Drive, without latency and loss. The parked ego counts its objects after fusion, except masts of roadside "
        "units. EI-Drive counts boxes in the same way, in one run per cell.",
        "Free parameters: the traffic of each seed (up to 32 vehicles in EI-Drive's eight ranges, whose models and "
        "motion are not recorded) and the signal cycle. The oracle of EI-Drive knows every vehicle within 50 m in the "
        "view of a camera behind the ego, unless the box of a nearer one contains its box on the screen; with "
        "cooperation it omits this test. Here the oracle needs a line of sight from the sensor.",
    )


def _conclusions(runs: Runs, cells: Sequence[Row], ratios: Sequence[Row]) -> tuple[str, ...]:
    more = len(where(ratios, more=True))
    listed = ", ".join(
        f"{row['scenario'].removeprefix('coop/')} {row['detector']} "
        + ("without a ratio" if row["ratio"] is None else f"{row['ratio']:.2f} (paper {row['paper_ratio']:.2f})")
        for row in ratios
    )
    texts = [f"Cooperation finds more objects in {more} of {len(ratios)} panels (paper: 4 of 4). Ratios: {listed}."]
    for detector in groups(ratios, "detector"):
        vehicle, units = (_means(runs, scenario, detector, "cooperation") for scenario in SENDERS)
        difference = paired_difference(vehicle, units)
        paper = [COUNTS[scenario, detector, "cooperation"].mean for scenario in SENDERS]
        texts.append(
            f"`{detector}`: with the roadside units the ego knows {difference.mean:+.1f} objects more than with the "
            f"vehicle (95 % interval: {interval_text(difference.low, difference.high, '+.1f')}; "
            f"paper {paper[1] - paper[0]:+.1f})."
        )
    fewer = [row for row in cells if row["mean"] < row["paper_mean"]]
    if fewer:
        texts.append(f"The counts are below the paper's in {len(fewer)} of {len(cells)} cells.")
        texts.append(
            f"{REASON} (low counts with the oracle): that of EI-Drive ignores most occlusions, so that it knows "
            "vehicles which no sensor sees."
        )
    return tuple(texts)


PART = Part(
    "detection",
    "Number of detected objects",
    (
        "How many more objects does a parked car know if a vehicle (scenario 3) or roadside units (scenario "
        "4) send what they detect?"
    ),
    5,
    DETECTORS,
    cases,
    report,
    has_replays=True,
)
