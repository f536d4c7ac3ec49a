"""Paths, and the level of a station on roads above each other."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from functools import cached_property
from itertools import accumulate
from typing import NamedTuple

import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.geometry import aligned_distances, distances_along, segment_distance
from eidrive_scenario.roads import OTHER_LEVEL, RoadNetwork

SPACING = 1.0
"""Distance between the points of a path [m]."""
LATERAL_ACCELERATION = 5.0
"""Maximum lateral acceleration [m/s²]: at curvature k the speed is at most sqrt(5 / |k|), as in EI-Drive."""
APPROACH_DECELERATION = 3.0
"""Deceleration before a curve or the end [m/s²]."""
SMOOTHING_PASSES = 4
"""Number of smoothing passes. Each pass averages a point with its neighbors (1 2 1)/4; four passes remove kinks of a
polyline and move a curve of radius R inwards by at most 1/R m²."""
REACH = 30
"""Number of segments among which the nearest one is searched."""
LEADS_AWAY = 5.0
"""Increase of the distance to a point that ends the search for its nearest segment [m]: a later approach of the path is
another curve or lap."""


class PathPart(NamedTuple):
    """Part of a path, at least one segment.

    points    (M, 2) [m]
    segments  start, vector and squared length of each segment (M - 1) [m]
    along     distance of each point from the beginning of the path (M) [m]
    """

    points: Array
    segments: Sequence[Sequence[float]]
    along: Sequence[float]


class PlannedPath:
    """Path with points (M, 2) [m], at least two, and speed limits (M,) [m/s] by lateral and approach acceleration."""

    def __init__(self, line: Array, *, ends: bool) -> None:
        """Build a path from a polyline (K, 2).

        ends  whether the vehicle stops at the last point; else the path continues beyond it

        Raise ValueError if the line has no length, or returns to its start within SPACING.
        """
        points = _resample(line)
        for _ in range(SMOOTHING_PASSES):  # the first and the last point are unchanged
            points[1:-1] = (points[:-2] + 2.0 * points[1:-1] + points[2:]) / 4.0
        self.points = _apart(points)
        self.ends = ends
        self.heights: Array | None = None
        """Heights of the road at the points (M,) [m], see `path_heights`; None until they are computed."""
        step = np.diff(self.points, axis=0)
        self.limits = _speed_limits(step, ends=ends)
        square = np.einsum("mi,mi->m", step, step)
        self._segments: list[list[float]] = np.column_stack([self.points[:-1], step, square]).tolist()
        """Start, vector and squared length of each segment."""

    @cached_property
    def _along(self) -> list[float]:
        """Distance of each point from the first one [m]."""
        return [*accumulate((math.sqrt(segment[4]) for segment in self._segments), initial=0.0)]

    def __len__(self) -> int:
        return len(self.points)

    def part(self, start: int, count: int) -> PathPart:
        """Return the part of `count` points from the point `start` on, fewer at the end, but at least one segment."""
        start = min(start, len(self._segments) - 1)
        end = start + max(count, 2)
        return PathPart(self.points[start:end], self._segments[start : end - 1], self._along[start:end])

    def project(self, x: float, y: float, start: int = 0) -> int:
        """Return the index of the nearest segment among the next REACH segments from `start` on."""
        return start + nearest_segment(self._segments[start : start + REACH], x, y)[0]

    def nearest(self, x: float, y: float, yaw: float) -> int:
        """Return the index of the nearest point of the whole path; points where it leads along `yaw` have priority."""
        away = aligned_distances(self.points, x, y, yaw)
        return int(np.argmin(away if np.isfinite(away).any() else np.hypot(*(self.points[:-1] - (x, y)).T)))

    def distance(self, x: float, y: float, index: int) -> float:
        """Return the distance of a point from the segment at an index [m]."""
        x0, y0, dx, dy, _ = self._segments[index]
        return segment_distance(x, y, x0, y0, x0 + dx, y0 + dy)


def nearest_segment(segments: Iterable[Sequence[float]], x: float, y: float) -> tuple[int, float]:
    """Return the index of the segment that is nearest to a point, and the share of it before its nearest place.

    The search ends where the distance has increased by LEADS_AWAY.

    segments  start, vector and squared length of each [m]. Raise ZeroDivisionError if one of them has no length
    """
    best, best_share, nearest, leads_away = 0, 0.0, math.inf, math.inf
    for index, (x0, y0, dx, dy, square) in enumerate(segments):
        ax, ay = x - x0, y - y0
        share = (ax * dx + ay * dy) / square
        share = 0.0 if share < 0.0 else 1.0 if share > 1.0 else share
        ax, ay = ax - share * dx, ay - share * dy
        gap = ax * ax + ay * ay
        if gap < nearest:
            # At a corner both segments are equally near: the later one has to be nearer by 1 nm.
            root = math.sqrt(gap)
            best, best_share, nearest, leads_away = index, share, gap - 2e-9 * root, (root + LEADS_AWAY) ** 2
        elif gap > leads_away:
            break
    return best, best_share


def _speed_limits(step: Array, *, ends: bool) -> Array:
    """Return the speed limits (M,) [m/s] of a path with these steps between its points (M - 1, 2) [m]."""
    length = np.hypot(step[:, 0], step[:, 1])
    heading = np.unwrap(np.arctan2(step[:, 1], step[:, 0]))
    curvature = np.zeros(len(step) + 1)
    curvature[1:-1] = np.abs(np.diff(heading)) / ((length[1:] + length[:-1]) / 2.0)
    limits = np.sqrt(LATERAL_ACCELERATION / np.maximum(curvature, 1e-6))
    if ends:
        limits[-1] = 0.0
    return approached(limits, length, APPROACH_DECELERATION)


def approached(limits: Array, lengths: Array, deceleration: float) -> Array:
    """Return speed limits (M,) [m/s] of points, lowered so that a vehicle slows down before lower ones.

    lengths  distances between the points (M - 1,) [m];  deceleration  before lower limits [m/s²]
    """
    speeds: list[float] = limits.tolist()
    gains: list[float] = (2.0 * deceleration * lengths).tolist()
    for index in range(len(gains) - 1, -1, -1):
        speeds[index] = min(speeds[index], math.sqrt(speeds[index + 1] ** 2 + gains[index]))
    return np.array(speeds)


def _resample(line: Array) -> Array:
    """Return points (M, 2) at equal distances of about SPACING along a polyline (K, 2), with its ends."""
    line = _apart(np.asarray(line, dtype=float)[:, :2])
    along = distances_along(line)
    stations = np.linspace(0.0, along[-1], max(2, round(along[-1] / SPACING) + 1))
    return np.stack([np.interp(stations, along, line[:, 0]), np.interp(stations, along, line[:, 1])], axis=1)


def _apart(points: Array) -> Array:
    """Return the points (M, 2) without consecutive duplicates: a line may turn back between two samples."""
    step = np.hypot(*np.diff(points, axis=0).T)
    kept: Array = points[np.concatenate([[True], step > 1e-6])]
    if len(kept) < 2:
        raise ValueError("a path needs two different points")
    return kept


NEAR_PATH = 30.0
"""Maximum distance from a path within which its height determines the level of an object [m]."""
SAME_PLACE = 5.0
"""Difference of distances below which several points of a path are at an object [m], where a path passes below itself.
"""


def path_heights(path: PlannedPath, roads: RoadNetwork | None, z: float) -> Array | None:
    """Return the heights of the road at the points (M,) of a path [m]; None if all roads are level.

    Each point is on the road of the one before or on one that continues it, where roads cross above each other.

    z  height of the vehicle at the start of the path [m]
    """
    if path.heights is None and roads is not None and not roads.is_level:
        location, heights = None, []
        for x, y in path.points.tolist():
            location = roads.locate_at(x, y, location, z, reach=5.0)
            z = z if location is None else roads.road_pose_at(location.road, location.s, location.t).z
            heights.append(z)
        path.heights = np.array(heights)
    return path.heights


def is_on_level(point: Array, points: Array, heights: Array) -> bool:
    """Return whether an object is on the level of a path (M, 2) with these heights (M,); True far from the path.

    point  x, y, and height of the lower side of the object [m]
    """
    gap = np.hypot(*(points - point[:2]).T)
    nearest = float(gap.min())
    there = heights[gap <= nearest + SAME_PLACE]
    return nearest > NEAR_PATH or bool(np.any(np.abs(there - point[2]) <= OTHER_LEVEL))
