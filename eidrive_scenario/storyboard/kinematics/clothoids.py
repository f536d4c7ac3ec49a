"""Clothoids and clothoid splines as sampled points."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

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
