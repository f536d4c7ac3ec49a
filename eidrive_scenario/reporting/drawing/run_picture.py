"""Small top view of a run as an image: roads, houses, actors at the start, and their paths."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from eidrive_scenario.reporting.drawing.canvas import Canvas, Image
from eidrive_scenario.reporting.drawing.top_view import RoadDrawing, Window

EGO, SENDER, OTHER, WALKER, TRAFFIC = "#2563eb", "#ea580c", "#334155", "#dc2626", "#94a3b8"
"""Colors of the ego, stations that send messages, other vehicles, pedestrians, and background traffic."""
MARGIN = 8.0
"""Distance of the shown actors from the edge of the picture [m]."""
LEAST_WIDTH = 60.0
"""Minimum width of the section that is shown [m]."""


@dataclass
class RunPaths:
    """Boxes (7,) of the actors at their first frame, and their positions (N, 2) over time, by name."""

    boxes: dict[str, tuple[float, ...]] = field(default_factory=dict)
    paths: dict[str, list[tuple[float, float]]] = field(default_factory=dict)

    def add(self, names: Sequence[str], boxes: Sequence[Sequence[float]]) -> None:
        """Append one frame; positions closer than half a meter to the last one are omitted."""
        for name, box in zip(names, boxes, strict=True):
            self.boxes.setdefault(name, tuple(box))
            path = self.paths.setdefault(name, [])
            if not path or np.hypot(box[0] - path[-1][0], box[1] - path[-1][1]) >= 0.5:
                path.append((box[0], box[1]))


def run_picture(
    run: RunPaths,
    roads: RoadDrawing,
    colors: Mapping[str, str],
    *,
    size: tuple[int, int] = (480, 300),
) -> Image:
    """Return the picture (height, width, 3) in the channel order of OpenCV.

    colors  color by actor; the last one is drawn on top, and its path is inside the section that is shown. Actors
            without a color belong to the background traffic: they have no path and do not determine that section
    size    width and height [pixels]
    """
    window = _window(run, colors, size[0] / size[1])
    canvas = Canvas(window, size)
    canvas.roads(roads)
    for name, color in colors.items():
        path = run.paths.get(name, ())
        if len(path) > 1:
            canvas.line(path, color, 0.45)
    for name in [*(other for other in run.boxes if other not in colors), *colors]:
        if name in run.boxes:
            canvas.body(run.boxes[name], colors.get(name, TRAFFIC))
    return canvas.image


def _window(run: RunPaths, colors: Mapping[str, str], ratio: float) -> Window:
    """Return the section with the actors and the path of the last one, in the ratio of width to height."""
    points = [box[:2] for name, box in run.boxes.items() if name in colors]
    points += run.paths.get(next(reversed(list(colors)), ""), [])
    found = Window.enclosing(points or [(0.0, 0.0)], MARGIN)
    width, height = found.right - found.left, found.top - found.bottom
    shown = max(width, ratio * height, LEAST_WIDTH)
    wider, higher = (shown - width) / 2.0, (shown / ratio - height) / 2.0
    return Window(found.left - wider, found.right + wider, found.bottom - higher, found.top + higher)
