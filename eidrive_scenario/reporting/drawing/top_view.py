"""Sections, roads and colors of top views."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from eidrive_scenario.base.arrays import Array

OWN, RECEIVED, LINK, LOST, AREA = "#2563eb", "#ea580c", "#0f9d58", "#dc2626", "#eab308"
FUSED, TRUTH, STATION = "#7c3aed", "#334155", "#0f172a"
PLAN, BRAKING = "#075985", "#831843"
LANES = {
    "sidewalk": "#e7e1d5",
    "median": "#dbe5d0",
    "shoulder": "#d8dce2",
    "border": "#d8dce2",
    "parking": "#cfd4dc",
    "bidirectional": "#c9ced7",
    "none": "#e4e9dd",
}
LANE, GROUND = "#c1c7d1", "#f1f3ee"
PAINT = {"yellow": "#f4c542"}
WHITE = "#ffffff"


@dataclass(frozen=True)
class Window:
    """Section of the world in a figure [m]."""

    left: float
    right: float
    bottom: float
    top: float

    @classmethod
    def enclosing(cls, points: Iterable[Sequence[float]], margin: float = 6.0) -> Window:
        """Return the smallest window that contains all points (x, y, …) with a margin [m]."""
        plan = np.array([tuple(point[:2]) for point in points], dtype=np.float64)
        low, high = plan.min(axis=0) - margin, plan.max(axis=0) + margin
        return cls(float(low[0]), float(high[0]), float(low[1]), float(high[1]))

    @classmethod
    def centered(cls, center: tuple[float, float], width: float, ratio: float) -> Window:
        """Return the window of this width [m] around a center [m], with a ratio of width to height."""
        across, along = width / 2.0, width / ratio / 2.0
        return cls(center[0] - across, center[0] + across, center[1] - along, center[1] + along)

    def widened(self, ratio: float, least: float) -> Window:
        """Return the smallest window around this one with a ratio of width to height, at least `least` wide [m]."""
        width = max(self.right - self.left, ratio * (self.top - self.bottom), least)
        return Window.centered(((self.left + self.right) / 2.0, (self.bottom + self.top) / 2.0), width, ratio)

    def reaches(self, points: Array) -> bool:
        """Return whether the rectangle around points (M, 2) reaches into this one."""
        (left, bottom), (right, top) = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
        return bool(left <= self.right and right >= self.left and bottom <= self.top and top >= self.bottom)


@dataclass(frozen=True)
class RoadDrawing:
    """Roads from above: lanes (type, polygon (M, 2)), road marks (type, color, polyline (M, 2)), and the houses beside
    them (outline (M, 2), height) [m]."""

    lanes: tuple[tuple[str, Array], ...] = ()
    markings: tuple[tuple[str, str, Array], ...] = ()
    houses: tuple[tuple[Array, float], ...] = ()
    above: tuple[RoadDrawing, ...] = ()
    """Parts of roads that pass above others, from low to high: they are drawn after those below them."""

    @property
    def levels(self) -> tuple[RoadDrawing, ...]:
        """Return the drawings of lanes and road marks in the order in which they cover each other."""
        return (self, *self.above)


def is_broken(kind: str) -> bool:
    """True if a road mark of this type is broken; for a double line, if both lines are."""
    return set(kind.split()) == {"broken"}
