"""Section of the world that is drawn from above: roads, bodies and labels, on an image or a figure."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence

import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.geometry import footprint
from eidrive_scenario.reporting.drawing.top_view import (
    LANE,
    LANES,
    PAINT,
    TRUTH,
    WHITE,
    RoadDrawing,
    Window,
    is_broken,
)

HOUSE = "#b8b2a7"
"""Color of houses."""
SMALLEST = 0.9
"""Minimum length and width at which an actor is drawn [m]: pedestrians and masts would be invisible."""
STROKE = 3.0
"""Length of the strokes and gaps of a broken road mark [m]."""
MARK_WIDTH = 0.2
"""Width of road marks [m]."""
LONGEST_LABEL = 200
"""Maximum number of characters of a label."""

Points = Array | Sequence[Sequence[float]]


class Canvas(ABC):
    """Drawing of a section of the world. Positions on it are in units from its upper left corner.

    size   width and height [units]
    scale  units per meter
    """

    smallest: float
    """Minimum length and width at which an actor is drawn [units]."""
    reserved: tuple[tuple[float, float, float, float], ...] = ()
    """Rectangles (left, top, right, bottom) that labels do not cover [units]."""

    def __init__(self, window: Window, size: tuple[float, float]) -> None:
        self.window = window
        self.size = size
        self.scale = size[0] / (window.right - window.left)

    def roads(self, roads: RoadDrawing) -> None:
        """Draw the roads and houses inside the section."""
        for level in roads.levels:
            for kind, polygon in level.lanes:
                if self.window.reaches(polygon):
                    self.fill(polygon, LANES.get(kind, LANE))
            for kind, color, line in level.markings:
                if self.window.reaches(line):
                    self.line(line, PAINT.get(color, WHITE), MARK_WIDTH, stroke=STROKE if is_broken(kind) else 0.0)
        for house, _ in roads.houses:
            if self.window.reaches(house):
                self.fill(house, HOUSE)

    @abstractmethod
    def fill(self, polygon: Points, color: str, opacity: float = 1.0, *, legend: str = "") -> None:
        """Fill a polygon (M, 2) [m].

        legend  what it is, for a canvas with a legend
        """

    @abstractmethod
    def line(
        self,
        points: Points,
        color: str,
        width: float,
        *,
        closed: bool = False,
        stroke: float = 0.0,
        legend: str = "",
    ) -> None:
        """Draw a line (M, 2) [m] of a width [m], at least the thinnest one.

        stroke  length of the strokes and gaps of a broken line [m]; 0 for a solid line
        legend  what it is, for a canvas with a legend
        """

    def body(self, box: Sequence[float], color: str, opacity: float = 1.0, *, legend: str = "") -> None:
        """Draw a body (7,) with a dark outline and a light bar behind its front."""
        drawn = np.array(box, dtype=float)
        drawn[3:5] = np.maximum(drawn[3:5], max(SMALLEST, self.smallest / self.scale))
        corners = footprint(drawn)
        self.fill(corners, color, opacity, legend=legend)
        self.line(corners, TRUTH, 0.0, closed=True)
        front = corners[[0, 3]]
        self.line(front + 0.2 * (corners[[1, 2]] - front), WHITE if opacity >= 1.0 else TRUTH, 0.0)

    def ellipse(
        self, center: Sequence[float], axes: tuple[float, float], angle: float, color: str, *, legend: str = ""
    ) -> None:
        """Draw an ellipse with semi-axes [m] and the direction [rad] of the first."""
        turn = np.linspace(0.0, 2.0 * np.pi, 37)[:, None]
        along, across = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
        points = np.asarray(center)[:2] + axes[0] * np.cos(turn) * along + axes[1] * np.sin(turn) * across
        self.line(points, color, 0.0, legend=legend)

    @abstractmethod
    def label(self, text: str, left: float, base: float, size: float = 1.0, color: str = TRUTH) -> None:
        """Write a text with a light outline at a position [units]; nothing outside of the canvas.

        size  in sizes of the label of an actor
        """

    @abstractmethod
    def label_size(self, text: str, size: float = 1.0) -> tuple[float, float]:
        """Return width and height of a text [units]."""

    def position(self, point: Sequence[float]) -> tuple[float, float]:
        """Return the position of a point [units]."""
        return (point[0] - self.window.left) * self.scale, (self.window.top - point[1]) * self.scale


COVERED = math.sqrt(-2.0 * math.log(0.05))
"""Semi-axes of the ellipse that contains 95 % of a normal distribution in the plane, in standard deviations."""


def ellipse_of_95_percent(covariance: Array) -> tuple[float, float, float] | None:
    """Return the semi-axes [m] and the direction of the longer one [rad] of the ellipse that contains 95 %.

    covariance  (2, 2) of the position [m²]; None if it is unknown or no covariance
    """
    if not np.isfinite(covariance).all():
        return None
    (xx, xy), (_, yy) = covariance.tolist()
    middle, spread = (xx + yy) / 2.0, math.hypot((xx - yy) / 2.0, xy)
    if middle - spread < 0.0:
        return None
    long, short = COVERED * math.sqrt(middle + spread), COVERED * math.sqrt(middle - spread)
    return long, short, math.atan2(2.0 * xy, xx - yy) / 2.0
