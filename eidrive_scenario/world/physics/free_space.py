"""Free space between two actors, found without rays."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from eidrive_scenario.arrays import Array
from eidrive_scenario.world.physics.scenery import Scenery
from eidrive_scenario.world.view import WorldView

Point = tuple[float, float, float]

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
        self._circles: Array | None = None
        self._upright: tuple[WorldView, bool] | None = None
        self._gaps: dict[tuple[str, str], tuple[float, float, float, float, float]] = {}
        """Ends of the line between two actors, and its distance from the nearest static object [m]."""

    def scenery_changed(self) -> None:
        """Forget the static objects."""
        self._circles = None
        self._gaps.clear()

    def is_free(self, view: WorldView, own: int, origin: Point, target: int) -> bool:
        """Return True if certainly nothing is between a point of one actor and the bounding box of another.

        own, target  rows of the actors in the view

        The result is False if roads are not in the plane z = 0, or if an actor is not upright.
        """
        boxes = view.plain_boxes
        body, other = boxes[own], boxes[target]
        if origin[2] <= 0.0 or other[2] < other[5] / 2.0 or not (self._scenery.level and self._is_upright(view)):
            return False
        x, y = origin[0], origin[1]
        dx, dy = other[0] - x, other[1] - y
        square, width = dx * dx + dy * dy, _radius(other) + MARGIN
        if square <= (width + _radius(body) + APART + math.hypot(body[0] - x, body[1] - y)) ** 2:
            return False
        if not self._is_clear_of_scenery((view.names[own], view.names[target]), x, y, other[0], other[1], width):
            return False
        for row, box in enumerate(boxes):
            if row in (own, target):
                continue
            px, py, reach = box[0] - x, box[1] - y, width + _radius(box)
            share = (px * dx + py * dy) / square
            if share > 0.0:
                share = min(share, 1.0)
                px, py = px - share * dx, py - share * dy
            if px * px + py * py <= reach * reach:
                return False
        return True

    def _is_upright(self, view: WorldView) -> bool:
        """Whether the pitch and roll of all actors are 0, so that their bodies are in their bounding boxes."""
        if self._upright is None or self._upright[0] is not view:
            self._upright = view, not view.kinematics[:, 4:6].any()
        return self._upright[1]

    def _is_clear_of_scenery(
        self, pair: tuple[str, str], x: float, y: float, to_x: float, to_y: float, width: float
    ) -> bool:
        known = self._gaps.get(pair)
        if known is not None:
            old_x, old_y, old_to_x, old_to_y, gap = known
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
        if self._circles is None:
            self._circles = self._scenery.circles()
        center_x, center_y, radius = self._circles
        if not len(radius):
            return math.inf
        px, py, dx, dy = center_x - x, center_y - y, to_x - x, to_y - y
        share = ((px * dx + py * dy) / (dx * dx + dy * dy)).clip(0.0, 1.0)
        return float((np.hypot(px - share * dx, py - share * dy) - radius).min())


def _radius(box: Sequence[float]) -> float:
    """Return the radius of the sphere around a box [m]."""
    return math.hypot(box[3], box[4], box[5]) / 2.0
