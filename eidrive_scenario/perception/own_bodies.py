"""Detections of the bodies of the station itself: of the vehicle, and of its trailers."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from eidrive_scenario.arrays import Array
from eidrive_scenario.detections import Detections

BODY_MARGIN = 0.9
"""Maximum distance of a detected box center from the outline of a body at which the box shows this body [m]. It is half
the width of a car: the center of another car is closer only after a collision."""


class Outline(NamedTuple):
    """Outline of a body with the margin: center [m], cosine and sine of its heading, half length and half width [m]."""

    x: float
    y: float
    cos: float
    sin: float
    half_length: float
    half_width: float


def outlines(bodies: Array) -> list[Outline]:
    """Return the outlines of bodies (K, 7)."""
    return [
        Outline(x, y, math.cos(yaw), math.sin(yaw), length / 2.0 + BODY_MARGIN, width / 2.0 + BODY_MARGIN)
        for x, y, _, length, width, _, yaw in bodies.tolist()
    ]


def rows_on_bodies(detections: Detections, bodies: Sequence[Outline]) -> list[int]:
    """Return the rows of the detections whose centers are on bodies, or within the margin of them."""
    rows = []
    for row, (bx, by) in enumerate(detections.boxes[:, :2].tolist()):
        for x, y, cos, sin, half_length, half_width in bodies:
            ahead, left = cos * (bx - x) + sin * (by - y), cos * (by - y) - sin * (bx - x)
            if abs(ahead) <= half_length and abs(left) <= half_width:
                rows.append(row)
                break
    return rows


def without_rows(detections: Detections, rows: Iterable[int]) -> Detections:
    """Return the detections without these rows."""
    removed = set(rows)
    if not removed:
        return detections
    return detections.subset([row for row in range(len(detections)) if row not in removed])
