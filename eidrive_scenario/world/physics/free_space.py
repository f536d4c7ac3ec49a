"""Free space between two actors, found in plan view without rays."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from eidrive_scenario.world.actor import Vector3
from eidrive_scenario.world.physics.scenery import Scenery
from eidrive_scenario.world.view import WorldView

MARGIN = 0.1
"""Minimum distance of an object from free space [m]."""
APART = 1.0
"""Minimum distance between two actors with free space between them [m]."""


class FreeSpace:
    """Search for actors and static objects between two actors, in plan view and with circles around all bodies.

    The distance of the static objects from a line is computed again only when an end of it may have moved too near to
    one, or away from all.
    """

    def __init__(self, scenery: Scenery) -> None:
        self._scenery = scenery
        self._gaps: dict[tuple[str, str], tuple[float, float, float, float, float]] = {}
        """Ends of the line between two actors, and its distance from the nearest static object [m]."""

    def scenery_changed(self) -> None:
        """Forget the static objects."""
        self._gaps.clear()

    def is_free(self, view: WorldView, own: int, origin: Vector3, target: int) -> bool:
        """Return True if certainly nothing is between a point of one actor and the bounding box of another.

        own, target  rows of the actors in the view

        The result is False if roads are not in the plane z = 0, or if an actor is not upright.
        """
        boxes = view.plain_boxes
        body, other = boxes[own], boxes[target]
        if origin[2] <= 0.0 or other[2] < other[5] / 2.0 or not (self._scenery.level and view.is_upright):
            return False
        x, y = origin[0], origin[1]
        dx, dy = other[0] - x, other[1] - y
        square, width = dx * dx + dy * dy, _radius(other) + MARGIN
        if square <= (width + _radius(body) + APART + math.hypot(body[0] - x, body[1] - y)) ** 2:
            return False
        if not self._is_clear_of_scenery((view.names[own], view.names[target]), x, y, other[0], other[1], width):
            return False
        length = math.sqrt(square)
        ux, uy, sin = dx / length, dy / length, width / length
        cos = math.sqrt(1.0 - sin * sin)
        for row, box in enumerate(boxes):
            if row in (own, target):
                continue
            px, py, reach = box[0] - x, box[1] - y, _radius(box) + MARGIN
            ahead = px * ux + py * uy
            # Distance from the tangents to the target, and from the ends of the line
            if abs(py * ux - px * uy) * cos - ahead * sin > reach or (
                ahead <= 0.0 and px * px + py * py > reach * reach
            ):
                continue
            if ahead > length and (px - dx) ** 2 + (py - dy) ** 2 > (reach + width) ** 2:
                continue
            if not _is_separate(x, y, other, box):
                return False
        return True

    def _is_clear_of_scenery(
        self, pair: tuple[str, str], x: float, y: float, to_x: float, to_y: float, width: float
    ) -> bool:
        checked = self._gaps.get(pair)
        if checked is not None:
            old_x, old_y, old_to_x, old_to_y, gap = checked
            moved = max(math.hypot(x - old_x, y - old_y), math.hypot(to_x - old_to_x, to_y - old_to_y))
            if gap - moved > width:
                return True
            if gap + moved <= width:
                return False
        gap = self._gap(x, y, to_x, to_y)
        self._gaps[pair] = x, y, to_x, to_y, gap
        return gap > width

    def _gap(self, x: float, y: float, to_x: float, to_y: float) -> float:
        """Return the distance of a line from the nearest static object [m]."""
        center_x, center_y, radius, _ = self._scenery.circles
        if not len(radius):
            return math.inf
        px, py, dx, dy = center_x - x, center_y - y, to_x - x, to_y - y
        share = ((px * dx + py * dy) / (dx * dx + dy * dy)).clip(0.0, 1.0)
        return float((np.hypot(px - share * dx, py - share * dy) - radius).min())


def _is_separate(x: float, y: float, seen: Sequence[float], box: Sequence[float]) -> bool:
    """Return whether a line in plan view separates a box from a point and another box that is seen from there.

    The sides of the box and the tangents from the point to the other box are tried.
    """
    cos, sin = math.cos(box[6]), math.sin(box[6])
    offsets = [(px - box[0], py - box[1]) for px, py in ((x, y), *_corners(seen, 0.0))]
    for half, along in (
        (box[3] / 2.0 + MARGIN, [cos * dx + sin * dy for dx, dy in offsets]),
        (box[4] / 2.0 + MARGIN, [cos * dy - sin * dx for dx, dy in offsets]),
    ):
        if min(along) > half or max(along) < -half:
            return True
    ahead_x, ahead_y = seen[0] - x, seen[1] - y
    # Tangent of the angle of each corner from the direction to the center, which is ahead of the point
    sides = [
        ((ahead_x * (py - y) - ahead_y * (px - x)) / (ahead_x * (px - x) + ahead_y * (py - y)), px - x, py - y)
        for px, py in _corners(seen, MARGIN)
    ]
    corners = _corners(box, MARGIN)
    _, right_x, right_y = min(sides)
    if all(right_x * (py - y) - right_y * (px - x) < 0.0 for px, py in corners):
        return True
    _, left_x, left_y = max(sides)
    return all(left_x * (py - y) - left_y * (px - x) > 0.0 for px, py in corners)


def _corners(box: Sequence[float], margin: float) -> list[tuple[float, float]]:
    """Return the corners of the footprint of a box with a margin [m]."""
    x, y, _, length, width, _, yaw = box
    cos, sin = math.cos(yaw), math.sin(yaw)
    ahead_x, ahead_y = cos * (length / 2.0 + margin), sin * (length / 2.0 + margin)
    left_x, left_y = -sin * (width / 2.0 + margin), cos * (width / 2.0 + margin)
    return [
        (x + ahead_x + left_x, y + ahead_y + left_y),
        (x + ahead_x - left_x, y + ahead_y - left_y),
        (x - ahead_x - left_x, y - ahead_y - left_y),
        (x - ahead_x + left_x, y - ahead_y + left_y),
    ]


def _radius(box: Sequence[float]) -> float:
    """Return the radius of the sphere around a box [m]."""
    return math.hypot(box[3], box[4], box[5]) / 2.0
