"""Tables of reports/detection.md."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.perception.learned.image_network import IMAGE_CLASSES, LIGHT, VEHICLES
from training.scoring import ROAD_USERS, EvaluatedImage, Part, as_one_light, mean_precision, score

Table = tuple[str, list[str], list[list[str]]]
"""Title, head and rows."""

DISTANCES = ((0.0, 20.0), (20.0, 40.0), (40.0, 60.0), (60.0, 100.0))
WEATHERS = ("clear", "overcast", "fog", "rain", "snow", "dusk", "night")


def number(value: float) -> str:
    """Return a score with three digits, - for NaN."""
    return "-" if np.isnan(value) else f"{value:.3f}"


def tables_of(evaluated: Mapping[str, list[EvaluatedImage]], of: str) -> list[Table]:
    """Return average precision and recall by weather, class and distance."""

    def row(name: str, part: Part, by_detector: Mapping[str, list[EvaluatedImage]] = evaluated) -> list[str]:
        scores = [score(images, part) for images in by_detector.values()]
        cells = [number(value) for each in scores for value in (each.precision, each.recall)]
        return [name, *cells, str(scores[-1].objects)]

    weathers = sorted({entry.weather for entry in next(iter(evaluated.values()))}, key=WEATHERS.index)
    head = [f"{name} {what}" for name in evaluated for what in ("AP50", "recall")] + ["objects"]
    near = partial(Part, farthest=40.0, height=15.0)
    by_weather = [row(weather, near(VEHICLES, weather=weather)) for weather in weathers]
    by_weather += [row(f"clear, {name} only", near((name,), weather="clear")) for name in VEHICLES]
    tables: list[Table] = [(f"{of}: vehicles within 40 m and at least 15 px high", ["weather", *head], by_weather)]
    for weather in [name for name in ("clear", "fog") if name in weathers]:
        rows = [row(name, Part((name,), weather=weather)) for name in IMAGE_CLASSES]
        lights = {name: as_one_light(images) for name, images in evaluated.items()}
        rows.append(row(f"{LIGHT}, any state", Part((LIGHT,), weather=weather), lights))
        means = [mean_precision(images, IMAGE_CLASSES, weather) for images in evaluated.values()]
        rows.append(["mean of classes", *(cell for mean in means for cell in (number(mean), "")), ""])
        tables.append((f"{of}, {weather}: by class", ["class", *head], [r for r in rows if r[-1] != "0"]))
        by_distance = [
            row(f"{title} {nearest:.0f} to {farthest:.0f} m", Part(names, nearest, farthest, weather=weather))
            for title, names in (("vehicles", VEHICLES), ("others", ROAD_USERS[3:]))
            for nearest, farthest in DISTANCES
        ]
        title = f"{of}, {weather}: road users by distance"
        tables.append((title, ["class and distance", *head], [r for r in by_distance if r[-1] != "0"]))
    return tables


def error_table(errors: Mapping[str, Array], of: str) -> Table:
    """Return medians of the errors of lifted centers."""
    bins = (
        ("all within 30 m", 0.0, 30.0),
        *((f"{a:.0f} to {b:.0f} m", a, b) for a, b in ((0, 10), (10, 20), (20, 30), (30, 50))),
    )
    rows = []
    for name, low, high in bins:
        cells = [name]
        for values in errors.values():
            inside = values[(values[:, 0] >= low) & (values[:, 0] < high), 1]
            if len(inside):
                cells += [f"{np.median(inside):.2f}", f"{np.percentile(inside, 90):.2f}", str(len(inside))]
            else:
                cells += ["-", "-", "0"]
        rows.append(cells)
    head = [f"{name} {what}" for name in errors for what in ("median", "90 %", "n")]
    return f"{of}: error of lifted centers in plan view [m]", ["distance", *head], rows


def as_markdown(tables: Sequence[Table]) -> str:
    """Return tables as aligned Markdown."""
    lines = []
    for title, head, rows in tables:
        widths = [max(len(row[column]) for row in (head, *rows)) for column in range(len(head))]
        lines += [f"## {title}", ""]
        for row in (head, ["-" * width for width in widths], *rows):
            lines.append("| " + " | ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) + " |")
        lines.append("")
    return "\n".join(lines)
