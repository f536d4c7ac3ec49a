"""Rational B-splines (NURBS) of poses: three coordinates and three angles."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass

from eidrive_scenario.geometry import wrap_angle
from eidrive_scenario.roads import Pose


@dataclass(frozen=True)
class Nurbs:
    """A rational B-spline by de Boor's recursion (Piegl and Tiller, The NURBS Book, ch. 4).

    order    degree + 1
    knots    one per control point, plus `order`
    control  poses and weights of the control points; angles are interpolated like coordinates
    """

    order: int
    knots: Sequence[float]
    control: Sequence[tuple[Pose, float]]

    def sampled(self, count: int) -> list[Pose]:
        """Return the poses at `count` + 1 equidistant parameters."""
        coordinates = _unwrapped([pose for pose, _ in self.control])
        poses = []
        for number in range(count + 1):
            basis = self._basis(number / count)
            total = sum(value * weight for value, (_, weight) in zip(basis, self.control, strict=True))
            rational = [value * weight / total for value, (_, weight) in zip(basis, self.control, strict=True)]
            poses.append(
                Pose(*(sum(b * row[axis] for b, row in zip(rational, coordinates, strict=True)) for axis in range(6)))
            )
        return poses

    def peaks(self, count: int) -> list[int]:
        """Return per control point the number of the step, of `count`, with the largest basis function."""
        rows = [self._basis(number / count) for number in range(count + 1)]
        return [max(range(count + 1), key=lambda number: rows[number][index]) for index in range(len(self.control))]

    def _basis(self, fraction: float) -> list[float]:
        """Return the basis functions at a fraction of the parameter range."""
        degree, knots, count = self.order - 1, self.knots, len(self.control)
        low, high = knots[degree], knots[count]
        u = low + (high - low) * fraction
        span = count - 1 if u >= high else min(max(bisect_right(knots, u) - 1, degree), count - 1)
        values = [0.0] * (len(knots) - 1)
        values[span] = 1.0
        for order in range(1, degree + 1):
            for index in range(len(knots) - order - 1):
                left = knots[index + order] - knots[index]
                right = knots[index + order + 1] - knots[index + 1]
                before = (u - knots[index]) / left * values[index] if left > 0.0 else 0.0
                after = (knots[index + order + 1] - u) / right * values[index + 1] if right > 0.0 else 0.0
                values[index] = before + after
        return values[:count]


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
