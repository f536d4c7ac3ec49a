"""Rational B-splines (NURBS) in six dimensions: a place and a direction to look at."""

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

    order    of the spline: its degree and 1
    knots    one per control point, and `order` more
    control  poses of the control points, with their weights; angles are blended as coordinates are
    """

    order: int
    knots: Sequence[float]
    control: Sequence[tuple[Pose, float]]

    def sampled(self, count: int) -> list[Pose]:
        """Its poses at `count` even steps of the parameter, `count` + 1 in all."""
        coordinates = _unwound([pose for pose, _ in self.control])
        poses = []
        for number in range(count + 1):
            shares = self._shares(number / count)
            total = sum(share * weight for share, (_, weight) in zip(shares, self.control, strict=True))
            rational = [share * weight / total for share, (_, weight) in zip(shares, self.control, strict=True)]
            poses.append(
                Pose(*(sum(b * row[axis] for b, row in zip(rational, coordinates, strict=True)) for axis in range(6)))
            )
        return poses

    def peaks(self, count: int) -> list[int]:
        """By control point, in which of `count` even steps its basis function is largest: the first of equals."""
        rows = [self._shares(number / count) for number in range(count + 1)]
        return [max(range(count + 1), key=lambda number: rows[number][index]) for index in range(len(self.control))]

    def _shares(self, along: float) -> list[float]:
        """The basis functions at a share of the curve's range of the parameter."""
        degree, knots, count = self.order - 1, self.knots, len(self.control)
        low, high = knots[degree], knots[count]
        u = low + (high - low) * along
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
    """The same places, looking along the curve."""
    last, turned = len(poses) - 1, []
    for number, pose in enumerate(poses):
        a, b = poses[max(0, number - 1)], poses[min(last, number + 1)]
        turned.append(pose._replace(h=math.atan2(b.y - a.y, b.x - a.x), p=0.0, r=0.0))
    return turned


def _unwound(poses: Sequence[Pose]) -> list[Pose]:
    """The same poses, without whole turns between the angles of one and the next."""
    found = [poses[0]]
    for pose in poses[1:]:
        before = found[-1]
        h, p, r = (old + wrap_angle(new - old) for old, new in zip(before[3:], pose[3:], strict=True))
        found.append(pose._replace(h=h, p=p, r=r))
    return found
