"""Tables of reports/detection.md."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.perception.learned.image_network import IMAGE_CLASSES, LIGHT, VEHICLES
from training.scoring import ROAD_USERS, EvaluatedImage, Part, as_one_light, mean_precision, score

Array = NDArray[np.float64]
Table = tuple[str, list[str], list[list[str]]]
"""Title, head and rows."""

DISTANCES = ((0.0, 20.0), (20.0, 40.0), (40.0, 60.0), (60.0, 100.0))
WEATHERS = ("clear", "overcast", "fog", "rain", "snow", "dusk", "night")


def number(value: float) -> str:
    """Return a score with three digits, - for NaN."""
    return "-" if np.isnan(value) else f"{value:.3f}"


def tables_of(evaluated: Mapping[str, list[EvaluatedImage]], of: str) -> list[Table]:
    """Return average precision and recall by weather, class and distance."""

    def row(name: str, part: Part, images: Callable[[str], list[EvaluatedImage]]) -> list[str]:
        cells = [name]
        for detector in evaluated:
            result = score(images(detector), part)
            cells += [number(result.precision), number(result.recall)]
        return [*cells, str(result.objects)]

    weathers = sorted({entry.weather for entry in next(iter(evaluated.values()))}, key=WEATHERS.index)
    head = [f"{name} {what}" for name in evaluated for what in ("AP50", "recall")] + ["objects"]
    everything = evaluated.__getitem__
    by_weather = [
        row(weather, Part(VEHICLES, farthest=40.0, height=15.0, weather=weather), everything) for weather in weathers
    ]
    by_weather += [
        row(f"clear, {name} only", Part((name,), farthest=40.0, height=15.0, weather="clear"), everything)
        for name in VEHICLES
    ]
    tables: list[Table] = [(f"{of}: vehicles within 40 m and at least 15 px high", ["weather", *head], by_weather)]
    for weather in [name for name in ("clear", "fog") if name in weathers]:
        rows = [row(name, Part((name,), weather=weather), everything) for name in IMAGE_CLASSES]
        lights = {name: as_one_light(entries) for name, entries in evaluated.items()}
        rows.append(row(f"{LIGHT}, any state", Part((LIGHT,), weather=weather), lights.__getitem__))
        mean = ["mean of classes"]
        for entries in evaluated.values():
            mean += [number(mean_precision(entries, IMAGE_CLASSES, weather)), ""]
        rows.append([*mean, ""])
        tables.append((f"{of}, {weather}: by class", ["class", *head], [r for r in rows if r[-1] != "0"]))
        by_distance = [
            row(f"{title} {near:.0f} to {far:.0f} m", Part(names, near, far, weather=weather), everything)
            for title, names in (("vehicles", VEHICLES), ("others", ROAD_USERS[3:]))
            for near, far in DISTANCES
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


def as_markdown(tables: Sequence[Table], notes: Mapping[str, str] | None = None) -> str:
    """Return tables as aligned Markdown; `notes` by title are inserted above their table."""
    lines = []
    for title, head, rows in tables:
        widths = [max(len(row[column]) for row in (head, *rows)) for column in range(len(head))]
        lines += [f"## {title}", ""]
        note = (notes or {}).get(title)
        if note:
            lines += [note, ""]
        for row in (head, ["-" * width for width in widths], *rows):
            lines.append("| " + " | ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) + " |")
        lines.append("")
    return "\n".join(lines)
