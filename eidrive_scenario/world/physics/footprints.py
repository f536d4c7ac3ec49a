"""Footprints of many bodies in arrays, and the pairs of them that are near each other."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from eidrive_scenario.arrays import Array, Bools, Integers
from eidrive_scenario.world.physics.bodies import Body

ROUNDING = 1e-6
"""Least distance beyond a gap at which footprints certainly have it [m]."""


class Footprints(NamedTuple):
    """Boxes of bodies in plan view, each array (N,).

    x y          centers [m]
    cos sin      of the headings
    half_length half_width radius  of the boxes and of the circles around them [m]
    moved        whether the last step changed the pose
    """

    x: Array
    y: Array
    cos: Array
    sin: Array
    half_length: Array
    half_width: Array
    radius: Array
    moved: Bools

    @classmethod
    def of(cls, bodies: Sequence[Body]) -> Footprints:
        """Return the footprints of bodies."""
        rows = [
            (b.center_x, b.center_y, math.cos(b.yaw), math.sin(b.yaw), b.spec.size[0] / 2, b.spec.size[1] / 2, b.radius)
            for b in bodies
        ]
        x, y, cos, sin, half_length, half_width, radius = np.array(rows, dtype=float).reshape(-1, 7).T
        moved = np.array([body.moved for body in bodies], dtype=bool)
        return cls(x, y, cos, sin, half_length, half_width, radius, moved)

    def near_pairs(self, gap: float) -> list[tuple[int, int]]:
        """Return the pairs of rows with a moved body that may be at most `gap` [m] apart, in the order of the rows.

        Candidates are found by a sweep along x, as only consecutive footprints in x can be near.
        """
        x, y, radius, moved = self.x, self.y, self.radius, self.moved
        order = np.argsort(x, kind="stable")
        sorted_x = x[order]
        last = sorted_x.searchsorted(sorted_x + radius[order] + radius.max() + gap, side="right")
        counts = last - np.arange(len(x)) - 1
        left = np.arange(len(x)).repeat(counts)
        within = np.arange(len(left)) - (counts.cumsum() - counts).repeat(counts)
        first, second = order[left], order[left + within + 1]
        near = np.hypot(x[first] - x[second], y[first] - y[second]) <= radius[first] + radius[second] + gap
        near &= moved[first] | moved[second]
        near[near] = ~self._are_apart(first[near], second[near], gap)
        pairs = np.sort(np.stack([first[near], second[near]], axis=1), axis=1)
        return [(row, other) for row, other in pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))].tolist()]

    def _are_apart(self, first: Integers, second: Integers, gap: float) -> Bools:
        """Return whether an axis of one of two boxes separates them by more than the gap, for pairs of rows."""
        rows = np.stack([first, second])
        x, y, cos, sin, half_length, half_width = (column[rows] for column in self[:6])
        dx, dy = x[1] - x[0], y[1] - y[0]
        turn_cos, turn_sin = abs(cos[0] * cos[1] + sin[0] * sin[1]), abs(cos[0] * sin[1] - sin[0] * cos[1])
        along = abs(dx * cos + dy * sin) - half_length - turn_cos * half_length[::-1] - turn_sin * half_width[::-1]
        across = abs(dy * cos - dx * sin) - half_width - turn_sin * half_length[::-1] - turn_cos * half_width[::-1]
        apart: Bools = (np.maximum(along, across) > gap + ROUNDING).any(axis=0)
        return apart


def near_rows(x: Array, y: Array, reach: Array, of: Iterable[Body], margin: float) -> Iterator[list[int]]:
    """Yield, for each of some bodies, the rows of circles around x, y (N,) at most `margin` [m] from its own circle.

    reach  (N,) radii with the displacement of this step [m], as `Body.travel`
    """
    for body in of:
        dx, dy = x - body.center_x, y - body.center_y
        limit = reach + (body.radius + body.travel + margin + ROUNDING)
        rows: list[int] = np.flatnonzero(dx * dx + dy * dy <= limit * limit).tolist()
        yield rows
