"""Small top view of a run as an image: roads, houses, actors at the start, and their paths."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.arrays import Array
from eidrive_scenario.geometry import footprint
from eidrive_scenario.reporting.drawing.top_view import GROUND, LANE, LANES, PAINT, TRUTH, WHITE, RoadDrawing, Window

Image = NDArray[np.uint8]
EGO, SENDER, OTHER, WALKER, TRAFFIC, HOUSE = "#2563eb", "#ea580c", "#334155", "#dc2626", "#94a3b8", "#b8b2a7"
"""Colors of the ego, stations that send messages, other vehicles, pedestrians, background traffic, and houses."""
MARGIN = 8.0
"""Distance of the shown actors from the edge of the picture [m]."""
LEAST_WIDTH = 60.0
"""Minimum width of the section that is shown [m]."""
SMALLEST = 0.9
"""Minimum length and width at which an actor is drawn [m]: pedestrians and masts would be invisible."""
LEAST_PIXELS = 7.0
"""Minimum length and width at which an actor is drawn [pixels]."""
SHIFT = 4
"""Fractional bits of coordinates in OpenCV."""


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
    houses: Sequence[Array],
    colors: Mapping[str, str],
    *,
    size: tuple[int, int] = (480, 300),
) -> Image:
    """Return the picture (height, width, 3) in the channel order of OpenCV.

    houses  outlines (M, 2) [m]
    colors  color by actor; the last one is drawn on top, and its path is inside the section that is shown. Actors
            without a color belong to the background traffic: they have no path and do not determine that section
    size    width and height [pixels]
    """
    window = _window(run, colors, size[0] / size[1])
    canvas = _Canvas(window, size)
    for kind, polygon in roads.lanes:
        canvas.fill(polygon, LANES.get(kind, LANE))
    for _, color, line in roads.markings:
        canvas.line(line, PAINT.get(color, WHITE), 0.2)
    for house in houses:
        canvas.fill(house, HOUSE)
    for name, color in colors.items():
        path = run.paths.get(name, ())
        if len(path) > 1:
            canvas.line(path, color, 0.45)
    for name in [*(other for other in run.boxes if other not in colors), *colors]:
        if name in run.boxes:
            canvas.box(run.boxes[name], colors.get(name, TRAFFIC))
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


class _Canvas:
    """Image with world coordinates."""

    def __init__(self, window: Window, size: tuple[int, int]) -> None:
        self._window = window
        self._scale = size[0] / (window.right - window.left)
        self.image: Image = np.full((size[1], size[0], 3), _bgr(GROUND), dtype=np.uint8)

    def fill(self, polygon: Array | Sequence[Sequence[float]], color: str) -> None:
        cv2.fillPoly(self.image, [self._pixels(polygon)], _bgr(color), cv2.LINE_AA, SHIFT)

    def line(self, points: Array | Sequence[Sequence[float]], color: str, width: float) -> None:
        thickness = max(1, round(width * self._scale))
        cv2.polylines(self.image, [self._pixels(points)], False, _bgr(color), thickness, cv2.LINE_AA, SHIFT)

    def box(self, box: Sequence[float], color: str) -> None:
        """Draw a body with a dark outline and a light bar behind its front."""
        drawn = np.array(box)
        drawn[3:5] = np.maximum(drawn[3:5], max(SMALLEST, LEAST_PIXELS / self._scale))
        corners = footprint(drawn)
        self.fill(corners, color)
        outline = np.concatenate([corners, corners[:1]])
        self.line(outline, TRUTH, 0.0)
        front = corners[[0, 3]]
        self.line(front + 0.2 * (corners[[1, 2]] - front), WHITE, 0.0)

    def _pixels(self, points: Array | Sequence[Sequence[float]]) -> NDArray[np.int32]:
        plan = np.asarray(points, dtype=np.float64)[:, :2]
        x = (plan[:, 0] - self._window.left) * self._scale
        y = (self._window.top - plan[:, 1]) * self._scale
        return np.round(np.column_stack([x, y]) * (1 << SHIFT)).astype(np.int32)


def _bgr(color: str) -> tuple[int, int, int]:
    return int(color[5:7], 16), int(color[3:5], 16), int(color[1:3], 16)
