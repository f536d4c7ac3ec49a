"""Clothoids, splines of clothoids, and Nurbs of trajectories."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from eidrive_scenario.arrays import Array, Integers
from eidrive_scenario.geometry import wrap_angle
from eidrive_scenario.openscenario import model
from eidrive_scenario.roads import Pose

SPACING = 0.1
"""Distance between samples of curved shapes [m]."""
MAX_POINTS = 20_000
"""Maximum number of samples of a curve, besides one per segment; beyond 2 km their distance is larger."""

Course = tuple[list[float], list[Pose], tuple[float, ...] | None]
"""Samples of a curve: arc lengths [m], poses, and times [s] or None."""


def clothoid(shape: model.Clothoid, start: Pose) -> Course:
    """Return the samples of a clothoid from its start pose."""
    change = shape.curvature_prime if shape.curvature_prime is not None else shape.curvature_dot or 0.0
    s, poses = _spiral(start, shape.curvature, shape.curvature + change * shape.length, shape.length)
    times = None
    if shape.start_time is not None and shape.stop_time is not None:
        times = _linear_times(s, shape.start_time, shape.stop_time)
    return s, poses, times


def clothoid_spline(
    shape: model.ClothoidSpline, resolve: Callable[[model.Position], Pose], here: Pose | None
) -> Course:
    """Return the samples of consecutive clothoids; `here` is the start if the first segment has no position."""
    s: list[float] = [0.0]
    poses: list[Pose] = []
    spacing = max(SPACING, sum(segment.length for segment in shape.clothoid_spline_segment) / MAX_POINTS)
    for segment in shape.clothoid_spline_segment:
        if segment.position_start is not None:
            here = resolve(segment.position_start)
        if here is None:
            here = Pose(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        here = here.turned(segment.h_offset or 0.0)
        distances, samples = _spiral(here, segment.curvature_start, segment.curvature_end, segment.length, spacing)
        base = s[-1]
        s += [base + distance for distance in distances]
        poses += samples
        here = samples[-1]
    return s[1:], poses, _spline_times(shape, s[1:])


def _spline_times(shape: model.ClothoidSpline, s: Sequence[float]) -> tuple[float, ...] | None:
    """Return the times at the samples [s]: constant speed between segments with a start time; the first starts at 0."""
    if shape.time_end is None:
        return None
    known, begin = {0.0: 0.0}, 0.0
    for segment in shape.clothoid_spline_segment:
        if segment.time_start is not None:
            known[begin] = segment.time_start
        begin += segment.length
    known[begin] = shape.time_end
    return tuple(np.interp(s, list(known), list(known.values())).tolist())


def _spiral(
    start: Pose, first: float, last: float, length: float, spacing: float = SPACING
) -> tuple[list[float], list[Pose]]:
    """Sample a curve whose curvature changes linearly from `first` to `last` [1/m], by the midpoint rule.

    It lies in the plane of the start pose, so that a curve that starts on a slope climbs.
    """
    count = min(max(1, math.ceil(length / spacing)), MAX_POINTS)
    step = length / count
    s, poses, x, y, z = [0.0], [start], start.x, start.y, start.z
    for number in range(count):
        middle = (number + 0.5) * step
        h = start.h + first * middle + 0.5 * (last - first) / length * middle * middle
        x, y = x + step * math.cos(h), y + step * math.sin(h)
        z -= step * math.tan(_pitch_in_plane(start, h - start.h))
        end = (number + 1) * step
        h = start.h + first * end + 0.5 * (last - first) / length * end * end
        s.append(end)
        pitch = _pitch_in_plane(start, h - start.h)
        poses.append(start.turned(h - start.h)._replace(x=x, y=y, z=z, h=h, p=pitch))
    return s, poses


def _pitch_in_plane(start: Pose, turn: float) -> float:
    """Return the pitch [rad] in the plane of a pose, at a horizontal turn from its heading [rad].

    The plane rises by -tan p ahead and by tan r / cos p to the left.
    """
    if start.p == 0.0 and start.r == 0.0:
        return 0.0
    rise = -math.tan(start.p) * math.cos(turn) + math.tan(start.r) / math.cos(start.p) * math.sin(turn)
    return -math.atan(rise)


def _linear_times(s: Sequence[float], first: float, last: float) -> tuple[float, ...]:
    length = s[-1] if s[-1] > 0.0 else 1.0
    return tuple(first + (last - first) * distance / length for distance in s)


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
