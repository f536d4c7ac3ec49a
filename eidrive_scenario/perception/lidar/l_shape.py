"""Rectangles around points of which a LiDAR sees one side or two: L-shapes."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from eidrive_scenario.arrays import Array

HEADINGS = np.radians(np.arange(0.0, 90.0, 1.0))
CLOSEST = 0.03
"""Points nearer to an edge than this are on it [m]."""
MOST_POINTS = 300
"""In the search for the heading; the extent counts all."""
AS_GOOD = 0.9
"""A heading with this share of the best closeness is as good: few points leave several."""
MOST = 4


class Rectangle(NamedTuple):
    """A rectangle seen from above: the heading of its first axis [rad], and its bounds along both axes [m]."""

    yaw: float
    low: tuple[float, float]
    high: tuple[float, float]

    @property
    def widest(self) -> float:
        """The longer side [m]."""
        return max(self.high[0] - self.low[0], self.high[1] - self.low[1])


def rectangles(plan: Array) -> list[Rectangle]:
    """The rectangles around points (N, 2) whose edges lie closest to them, the best first.

    Search by the closeness criterion: Zhang, Xu, Dong and Dolan, Efficient L-shape fitting for vehicle detection using
    laser scanners, IV 2017, algorithm 4. Where other headings are peaks of about the same closeness, they follow.
    """
    chosen = plan if len(plan) <= MOST_POINTS else plan[:: math.ceil(len(plan) / MOST_POINTS)]
    cos, sin = np.cos(HEADINGS)[:, None], np.sin(HEADINGS)[:, None]
    along, across = cos * chosen[:, 0] + sin * chosen[:, 1], cos * chosen[:, 1] - sin * chosen[:, 0]
    nearest = np.minimum(_to_edge(along), _to_edge(across))
    # The second term only tells headings apart that are equal by the criterion: all points count, the nearer the
    # better. Without it the first one found would win, and a mirrored object would not have a mirrored heading.
    closeness = np.sum(1.0 / np.maximum(nearest, CLOSEST), axis=1) + 1.0 / (1.0 + np.sum(nearest, axis=1))
    peaks = (closeness >= np.roll(closeness, 1)) & (closeness > np.roll(closeness, -1))
    peaks |= closeness == closeness.max()
    good = np.flatnonzero(peaks & (closeness >= AS_GOOD * closeness.max()))
    order = good[np.argsort(-closeness[good], kind="stable")][:MOST]
    return [bounds(plan, float(HEADINGS[number])) for number in order.tolist()]


def bounds(plan: Array, yaw: float) -> Rectangle:
    """The rectangle of a heading around points (N, 2)."""
    along = math.cos(yaw) * plan[:, 0] + math.sin(yaw) * plan[:, 1]
    across = math.cos(yaw) * plan[:, 1] - math.sin(yaw) * plan[:, 0]
    return Rectangle(yaw, (float(along.min()), float(across.min())), (float(along.max()), float(across.max())))


def _to_edge(values: Array) -> Array:
    """(H, N) distance of each value from the end of its row's range to which the row as a whole lies nearer."""
    to_high, to_low = values.max(axis=1, keepdims=True) - values, values - values.min(axis=1, keepdims=True)
    nearer_high = np.einsum("hn,hn->h", to_high, to_high) < np.einsum("hn,hn->h", to_low, to_low)
    nearest: Array = np.where(nearer_high[:, None], to_high, to_low)
    return nearest
