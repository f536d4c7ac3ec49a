"""Rectangles around points of which a lidar measures one or two sides: L-shapes."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from eidrive_scenario.arrays import Array

HEADINGS = np.radians(np.arange(0.0, 90.0, 1.0))
"""Tested headings of the first axis [rad]."""
CLOSEST = 0.03
"""Minimum distance from an edge that counts [m]."""
MOST_POINTS = 300
"""Maximum number of points in the search for the heading; the extent uses all points."""
AS_GOOD = 0.9
"""Share of the best closeness from which a heading is equivalent: with few points there are several."""
MOST = 4
"""Maximum number of returned rectangles."""


class Rectangle(NamedTuple):
    """Rectangle in plan view: the heading of its first axis [rad], and its bounds along both axes [m]."""

    yaw: float
    low: tuple[float, float]
    high: tuple[float, float]

    @property
    def widest(self) -> float:
        """Length of the longer side [m]."""
        return max(self.high[0] - self.low[0], self.high[1] - self.low[1])


def rectangles(plan: Array) -> list[Rectangle]:
    """Return the rectangles around points (N, 2) whose edges are closest to them, the best first.

    Search by the closeness criterion: Zhang, Xu, Dong and Dolan, Efficient L-shape fitting for vehicle detection using
    laser scanners, IV 2017, algorithm 4. Other headings that are peaks of about the same closeness follow.
    """
    chosen = plan if len(plan) <= MOST_POINTS else plan[:: math.ceil(len(plan) / MOST_POINTS)]
    cos, sin = np.cos(HEADINGS)[:, None], np.sin(HEADINGS)[:, None]
    along, across = cos * chosen[:, 0] + sin * chosen[:, 1], cos * chosen[:, 1] - sin * chosen[:, 0]
    nearest = np.minimum(_to_edge(along), _to_edge(across))
    # The second term decides between headings that are equal by the criterion, by the distances of all points. Without
    # it the first one would be selected, and a mirrored object would not have a mirrored heading.
    closeness = np.sum(1.0 / np.maximum(nearest, CLOSEST), axis=1) + 1.0 / (1.0 + np.sum(nearest, axis=1))
    peaks = (closeness >= np.roll(closeness, 1)) & (closeness > np.roll(closeness, -1))
    peaks |= closeness == closeness.max()
    good = np.flatnonzero(peaks & (closeness >= AS_GOOD * closeness.max()))
    order = good[np.argsort(-closeness[good], kind="stable")][:MOST]
    return [bounds(plan, float(HEADINGS[number])) for number in order.tolist()]


def bounds(plan: Array, yaw: float) -> Rectangle:
    """Return the rectangle of a given heading around points (N, 2)."""
    along = math.cos(yaw) * plan[:, 0] + math.sin(yaw) * plan[:, 1]
    across = math.cos(yaw) * plan[:, 1] - math.sin(yaw) * plan[:, 0]
    return Rectangle(yaw, (float(along.min()), float(across.min())), (float(along.max()), float(across.max())))


def _to_edge(values: Array) -> Array:
    """Return the distance (H, N) of each value from the end of its row's range that is closer to the whole row."""
    to_high, to_low = values.max(axis=1, keepdims=True) - values, values - values.min(axis=1, keepdims=True)
    nearer_high = np.einsum("hn,hn->h", to_high, to_high) < np.einsum("hn,hn->h", to_low, to_low)
    nearest: Array = np.where(nearer_high[:, None], to_high, to_low)
    return nearest
