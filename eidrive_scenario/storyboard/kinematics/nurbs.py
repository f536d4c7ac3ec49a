"""Rational B-splines (NURBS) of poses: three coordinates and three angles."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from eidrive_scenario.arrays import Array, Integers
from eidrive_scenario.geometry import wrap_angle
from eidrive_scenario.roads import Pose


@dataclass(frozen=True)
class Nurbs:
    """A rational B-spline by de Boor's recursion (Piegl and Tiller, The NURBS Book, ch. 2 and 4).

    Only the `order` basis functions that are not zero are evaluated, for all parameters together: the time grows
    linearly with the number of control points and of parameters.

    order    degree + 1
    knots    one per control point, plus `order`
    control  poses and weights of the control points; angles are interpolated like coordinates
    """

    order: int
    knots: Sequence[float]
    control: Sequence[tuple[Pose, float]]

    def sampled(self, count: int) -> list[Pose]:
        """Return the poses at `count` + 1 equidistant parameters."""
        coordinates = np.array(_unwrapped([pose for pose, _ in self.control]))
        weights = np.array([weight for _, weight in self.control])
        points, basis = self._basis(count)
        weighted = basis * weights[points]
        # Sums over the few functions one after another: their rounding does not depend on the array
        total = sum(weighted[:, number] for number in range(self.order))
        rational = weighted / np.reshape(total, (-1, 1))
        rows = sum(rational[:, number, None] * coordinates[points[:, number]] for number in range(self.order))
        return [Pose(*row) for row in np.asarray(rows).tolist()]

    def peaks(self, count: int) -> list[int | None]:
        """Return per control point the number of the step, of `count`, with the largest basis function.

        None for a control point whose basis function is zero at all steps.
        """
        points, basis = self._basis(count)
        steps = np.repeat(np.arange(count + 1), self.order)
        order = np.lexsort((steps, -basis.ravel(), points.ravel()))
        owners, first = np.unique(points.ravel()[order], return_index=True)
        peaks: list[int | None] = [None] * len(self.control)
        for owner, position in zip(owners.tolist(), order[first].tolist(), strict=True):
            if basis.flat[position] > 0.0:
                peaks[owner] = position // self.order
        return peaks

    def _basis(self, count: int) -> tuple[Integers, Array]:
        """Return the control points whose basis functions may not be zero, and these functions.

        Both are arrays of shape (`count` + 1, `order`), with one row for each of equidistant parameters.
        """
        degree, knots = self.order - 1, np.asarray(self.knots, dtype=np.float64)
        low, high = knots[degree], knots[len(self.control)]
        u = np.minimum(low + (high - low) * (np.arange(count + 1) / count), high)
        # The last parameter belongs to the last span that is not empty
        span = np.minimum(np.searchsorted(knots, u, side="right"), np.searchsorted(knots, high)) - 1
        points = span[:, None] + np.arange(-degree, 1)
        values = np.zeros((count + 1, self.order + 1))
        values[:, degree] = 1.0
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            for level in range(1, self.order):
                first = degree - level
                index = points[:, first:]
                own, after = values[:, first:-1], values[:, first + 1 :]
                rising = (u[:, None] - knots[index]) / (knots[index + level] - knots[index]) * own
                end = knots[index + level + 1]
                falling = (end - u[:, None]) / (end - knots[index + 1]) * after
                # A function that is zero may have an empty interval
                values[:, first:-1] = np.where(own > 0.0, rising, 0.0) + np.where(after > 0.0, falling, 0.0)
        return points, values[:, :-1]


def along_the_curve(poses: Sequence[Pose]) -> list[Pose]:
    """Return the same positions with headings and pitches along the curve."""
    last, aligned = len(poses) - 1, []
    for number, pose in enumerate(poses):
        a, b = poses[max(0, number - 1)], poses[min(last, number + 1)]
        pitch = math.atan2(a.z - b.z, math.hypot(b.x - a.x, b.y - a.y))
        aligned.append(pose._replace(h=math.atan2(b.y - a.y, b.x - a.x), p=pitch, r=0.0))
    return aligned


def _unwrapped(poses: Sequence[Pose]) -> list[Pose]:
    """Return the same poses with unwrapped angles: consecutive ones differ by less than π."""
    found = [poses[0]]
    for pose in poses[1:]:
        before = found[-1]
        h, p, r = (old + wrap_angle(new - old) for old, new in zip(before[3:], pose[3:], strict=True))
        found.append(pose._replace(h=h, p=p, r=r))
    return found
