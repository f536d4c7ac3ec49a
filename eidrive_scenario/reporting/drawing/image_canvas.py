"""Canvas on an image, drawn by OpenCV: pictures of films and of environments, which need a few milliseconds each."""

from __future__ import annotations

import itertools
import math

import cv2
import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.reporting.drawing.canvas import LONGEST_LABEL, Canvas, Points
from eidrive_scenario.reporting.drawing.top_view import GROUND, TRUTH, WHITE, Window

Image = NDArray[np.uint8]
SHIFT = 4
"""Fractional bits of coordinates in OpenCV."""
FAR = 30_000
"""Maximum distance of a drawn point from the image [pixels]; OpenCV overflows beyond."""
FONT, FONT_SCALE = cv2.FONT_HERSHEY_SIMPLEX, 0.45
"""Font of labels and its scale for the label of an actor."""


class ImageCanvas(Canvas):
    """Image (height, width, 3) of a section of the world, in the channel order of OpenCV; units are pixels."""

    smallest = 7.0

    def __init__(self, window: Window, size: tuple[int, int]) -> None:
        super().__init__(window, size)
        self.image: Image = np.full((size[1], size[0], 3), _bgr(GROUND), dtype=np.uint8)

    def fill(self, polygon: Points, color: str, opacity: float = 1.0, *, legend: str = "") -> None:
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
        strokes = self._strokes(points, stroke) if stroke else [points]
        thickness = max(1, round(width * self.scale))
        pixels = [self._pixels(part) for part in strokes]
        cv2.polylines(self.image, pixels, closed, _bgr(color), thickness, cv2.LINE_AA, SHIFT)

    def _strokes(self, points: Points, stroke: float) -> list[Points]:
        """Return the strokes of a broken line that may be inside of the section."""
        window = self.window
        reach = math.hypot(window.right - window.left, window.top - window.bottom)
        middle = np.array([window.left + window.right, window.bottom + window.top]) / 2.0
        plan = np.asarray(points, dtype=float)[:, :2]
        strokes: list[Points] = []
        for first, end in itertools.pairwise(plan):
            way = end - first
            length = float(np.hypot(*way))
            nearest = float((middle - first) @ way / length) if length else 0.0
            begins = np.arange(0.0, length, 2.0 * stroke)
            for begin in begins[np.abs(begins - nearest) <= reach]:
                strokes.append(first + np.array([[begin], [min(begin + stroke, length)]]) / length * way)
        return strokes

    def label(self, text: str, left: float, base: float, size: float = 1.0, color: str = TRUTH) -> None:
        height, width = self.image.shape[:2]
        if not (-width < left < width and 0 <= base < 2 * height):
            return  # OpenCV crashes far away
        text, origin = _drawable(text), (round(left), round(base))
        for ink, thickness in ((WHITE, 3), (color, 1)):
            cv2.putText(self.image, text, origin, FONT, FONT_SCALE * size, _bgr(ink), thickness, cv2.LINE_AA)

    def label_size(self, text: str, size: float = 1.0) -> tuple[float, float]:
        (width, height), _ = cv2.getTextSize(_drawable(text), FONT, FONT_SCALE * size, 1)
        return width, height

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
    return "".join([letter if " " <= letter <= "~" else "?" for letter in text[:LONGEST_LABEL]])
