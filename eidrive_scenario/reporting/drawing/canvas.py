"""Image with world coordinates, drawn by OpenCV."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.geometry import footprint
from eidrive_scenario.reporting.drawing.top_view import (
    GROUND,
    LANE,
    LANES,
    PAINT,
    TRUTH,
    WHITE,
    RoadDrawing,
    Window,
    is_broken,
)

Image = NDArray[np.uint8]
HOUSE = "#b8b2a7"
"""Color of houses."""
SMALLEST = 0.9
"""Minimum length and width at which an actor is drawn [m]: pedestrians and masts would be invisible."""
LEAST_PIXELS = 7.0
"""Minimum length and width at which an actor is drawn [pixels]."""
SHIFT = 4
"""Fractional bits of coordinates in OpenCV."""
STROKE = 3.0
"""Length of the strokes and gaps of a broken road mark [m]."""
FAR = 30_000
"""Maximum distance of a drawn point from the image [pixels]; OpenCV overflows beyond."""
_LONGEST = 200
"""Maximum number of characters of a label."""
FONT = cv2.FONT_HERSHEY_SIMPLEX

Points = Array | Sequence[Sequence[float]]


class Canvas:
    """Image (height, width, 3) of a section of the world, in the channel order of OpenCV.

    size  width and height [pixels]
    """

    def __init__(self, window: Window, size: tuple[int, int]) -> None:
        self.window = window
        self.scale = size[0] / (window.right - window.left)
        """Pixels per meter."""
        self.image: Image = np.full((size[1], size[0], 3), _bgr(GROUND), dtype=np.uint8)

    def roads(self, roads: RoadDrawing) -> None:
        """Draw the roads and houses inside the section."""
        for level in roads.levels:
            self._level(level)
        for house, _ in roads.houses:
            if self._shows(house):
                self.fill(house, HOUSE)

    def _level(self, roads: RoadDrawing) -> None:
        """Draw lanes and road marks of one level."""
        for kind, polygon in roads.lanes:
            if self._shows(polygon):
                self.fill(polygon, LANES.get(kind, LANE))
        for kind, color, line in roads.markings:
            if self._shows(line):
                paint = PAINT.get(color, WHITE)
                if is_broken(kind):
                    for start, end in itertools.pairwise(line):
                        self.dashes(start, end, paint, 0.2, STROKE)
                else:
                    self.line(line, paint, 0.2)

    def fill(self, polygon: Points, color: str, opacity: float = 1.0) -> None:
        """Fill a polygon (M, 2) [m]."""
        pixels = self._pixels(polygon)
        if opacity >= 1.0:
            cv2.fillPoly(self.image, [pixels], _bgr(color), cv2.LINE_AA, SHIFT)
            return
        height, width = self.image.shape[:2]
        low, high = pixels.min(axis=0) >> SHIFT, (pixels.max(axis=0) >> SHIFT) + 1
        left, top = np.clip(low - 1, 0, (width, height)).tolist()
        right, bottom = np.clip(high + 1, 0, (width, height)).tolist()
        if right > left and bottom > top:
            part = self.image[top:bottom, left:right]
            filled = part.copy()
            cv2.fillPoly(filled, [pixels - (left << SHIFT, top << SHIFT)], _bgr(color), cv2.LINE_AA, SHIFT)
            cv2.addWeighted(filled, opacity, part, 1.0 - opacity, 0.0, dst=part)

    def line(self, points: Points, color: str, width: float, *, closed: bool = False) -> None:
        """Draw a line (M, 2) [m] of a width [m], at least one pixel."""
        thickness = max(1, round(width * self.scale))
        cv2.polylines(self.image, [self._pixels(points)], closed, _bgr(color), thickness, cv2.LINE_AA, SHIFT)

    def dashes(self, start: Sequence[float], end: Sequence[float], color: str, width: float, stroke: float) -> None:
        """Draw a straight broken line with strokes and gaps of a length [m]."""
        first, way = np.asarray(start, dtype=float)[:2], np.subtract(end, start)[:2]
        length = float(np.hypot(*way))
        reach = math.hypot(self.window.right - self.window.left, self.window.top - self.window.bottom)
        middle = np.array([self.window.left + self.window.right, self.window.bottom + self.window.top]) / 2.0
        nearest = float((middle - first) @ way / length) if length else 0.0
        begins = np.arange(0.0, length, 2.0 * stroke)
        for begin in begins[np.abs(begins - nearest) <= reach]:
            parts = np.array([[begin], [min(begin + stroke, length)]]) / length
            self.line(first + parts * way, color, width)

    def body(self, box: Sequence[float], color: str, opacity: float = 1.0) -> None:
        """Draw a body (7,) with a dark outline and a light bar behind its front."""
        drawn = np.array(box, dtype=float)
        drawn[3:5] = np.maximum(drawn[3:5], max(SMALLEST, LEAST_PIXELS / self.scale))
        corners = footprint(drawn)
        self.fill(corners, color, opacity)
        self.line(corners, TRUTH, 0.0, closed=True)
        front = corners[[0, 3]]
        self.line(front + 0.2 * (corners[[1, 2]] - front), WHITE if opacity >= 1.0 else TRUTH, 0.0)

    def ellipse(self, center: Sequence[float], axes: tuple[float, float], angle: float, color: str) -> None:
        """Draw an ellipse with semi-axes [m] and the direction [rad] of the first."""
        turn = np.linspace(0.0, 2.0 * np.pi, 37)[:, None]
        along, across = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
        points = np.asarray(center)[:2] + axes[0] * np.cos(turn) * along + axes[1] * np.sin(turn) * across
        self.line(points, color, 0.0)

    def label(self, text: str, left: int, base: int, size: float = 0.45, color: str = TRUTH) -> None:
        """Write a text with a light outline at a position [pixels]; nothing outside of the image."""
        height, width = self.image.shape[:2]
        if not (-width < left < width and 0 <= base < 2 * height):
            return  # OpenCV crashes far away
        text = _drawable(text)
        cv2.putText(self.image, text, (left, base), FONT, size, _bgr(WHITE), 3, cv2.LINE_AA)
        cv2.putText(self.image, text, (left, base), FONT, size, _bgr(color), 1, cv2.LINE_AA)

    def label_size(self, text: str, size: float = 0.45) -> tuple[int, int]:
        """Return width and height of a text [pixels]."""
        (width, height), _ = cv2.getTextSize(_drawable(text), FONT, size, 1)
        return width, height

    def pixel(self, point: Sequence[float]) -> tuple[int, int]:
        """Return the position of a point [pixels]."""
        x, y = (self._pixels([point])[0] >> SHIFT).tolist()
        return x, y

    def _shows(self, points: Array) -> bool:
        (left, bottom), (right, top) = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
        window = self.window
        return bool(left <= window.right and right >= window.left and bottom <= window.top and top >= window.bottom)

    def _pixels(self, points: Points) -> NDArray[np.int32]:
        plan = np.asarray(points, dtype=np.float64)[:, :2]
        x = (plan[:, 0] - self.window.left) * self.scale
        y = (self.window.top - plan[:, 1]) * self.scale
        pixels = np.clip(np.column_stack([x, y]), -FAR, FAR)
        return np.round(pixels * (1 << SHIFT)).astype(np.int32)


def _bgr(color: str) -> tuple[int, int, int]:
    return int(color[5:7], 16), int(color[3:5], 16), int(color[1:3], 16)


def _drawable(text: str) -> str:
    """Return the text with the characters that the fonts of OpenCV have."""
    return "".join([letter if " " <= letter <= "~" else "?" for letter in text[:_LONGEST]])


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
