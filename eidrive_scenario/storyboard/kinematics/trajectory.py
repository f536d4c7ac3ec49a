"""Trajectories: all shapes of the standard as curves by arc length, with times if they are given."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate, pairwise

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.geometry import wrap_angle
from eidrive_scenario.openscenario import model
from eidrive_scenario.roads import Pose
from eidrive_scenario.storyboard.kinematics.clothoids import MAX_POINTS, SPACING, Course, clothoid, clothoid_spline
from eidrive_scenario.storyboard.kinematics.nurbs import Nurbs, along_the_curve

ROUNDING = 2.0
"""Maximum distance from a corner of a polyline at which the heading turns [m]."""

SAME_PLACE = 1e-3
"""Tolerance of distances at which a trajectory passes a point several times [m]."""

Resolve = Callable[[model.Position], Pose]


@dataclass(frozen=True)
class TrajectoryCurve:
    """Trajectory as sampled poses by arc length.

    s         arc length of each sample [m]
    poses     pose of each sample
    times     times at the stations [s], None for a trajectory without times
    closed    whether the end continues at the start
    given     whether the file specifies headings
    stations  arc lengths that have times [m]; empty: all samples
    tangents  direction of the curve at each sample [rad]; empty: straight segments between samples
    """

    s: tuple[float, ...]
    poses: tuple[Pose, ...]
    times: tuple[float, ...] | None
    closed: bool = False
    given: bool = False
    stations: tuple[float, ...] = ()
    tangents: tuple[float, ...] = ()

    @property
    def timed(self) -> tuple[float, ...]:
        """Arc length at each of the times [m]."""
        return self.stations or self.s

    @property
    def length(self) -> float:
        """Total arc length [m]."""
        return self.s[-1]

    @property
    def start_time(self) -> float:
        """Time of the first point [s]; 0 without times."""
        return self.times[0] if self.times is not None else 0.0

    @property
    def end_time(self) -> float:
        """Time of the last point [s]; 0 without times."""
        return self.times[-1] if self.times is not None else 0.0

    def at(self, s: float) -> Pose:
        """Return the pose at arc length s [m]. Beyond an end it is that of the end; a closed trajectory is periodic."""
        index, share = self._interval(self.s, self._wrapped(s))
        return _blend(self.poses[index], self.poses[index + 1], share)

    def tangent(self, s: float) -> float:
        """Return the direction of the curve at arc length s [rad], independent of the headings of its poses."""
        index, share = self._interval(self.s, self._wrapped(s))
        if not self.tangents:
            return self._directions[index]
        return self.tangents[index] + share * wrap_angle(self.tangents[index + 1] - self.tangents[index])

    def extended(self, s: float) -> Pose:
        """Return the pose at arc length s [m]; an open trajectory is extended along its tangents."""
        pose = self.at(s)
        beyond = 0.0 if self.closed else s - min(max(s, 0.0), self.length)
        if beyond == 0.0:
            return pose
        along = self.tangent(s)
        return pose._replace(x=pose.x + beyond * math.cos(along), y=pose.y + beyond * math.sin(along))

    def _wrapped(self, s: float) -> float:
        return s % self.length if self.closed and self.length > 0.0 and not 0.0 <= s <= self.length else s

    @cached_property
    def _directions(self) -> tuple[float, ...]:
        """Direction of each segment [rad]; one of no length has that of the next, otherwise of the previous segment."""
        _, vectors, lengths = self._segments
        found: list[float | None] = [
            math.atan2(y, x) if length > 0.0 else None
            for (x, y), length in zip(vectors.tolist(), lengths.tolist(), strict=True)
        ]
        for order in (range(len(found) - 2, -1, -1), range(1, len(found))):
            for index in order:
                if found[index] is None:
                    found[index] = found[index + (1 if order.step < 0 else -1)]
        return tuple(pose.h if h is None else h for h, pose in zip(found, self.poses, strict=False))

    def at_time(self, time: float, speeds: Sequence[float] | None = None) -> float:
        """Return the arc length at a time [m]: at constant speed between points, or by the `speeds` at the points."""
        if self.times is None:
            return 0.0
        index, share = self._interval(self.times, time)
        s = self.timed
        way = s[index + 1] - s[index]
        if speeds is None:
            return s[index] + share * way
        span = self.times[index + 1] - self.times[index]
        return s[index] + share * (speeds[index] * span * (1.0 - share) + share * way)

    def time_at(self, s: float) -> float:
        """Return the time at an arc length [s]; 0 without times."""
        if self.times is None:
            return 0.0
        index, share = self._interval(self.timed, s)
        return self.times[index] + share * (self.times[index + 1] - self.times[index])

    def speeds_from(self, start: float) -> tuple[float, ...]:
        """Return the speeds at the points [m/s] that keep the times and change linearly over time from `start`.

        A segment after which the speed would be negative has its mean speed instead.
        """
        assert self.times is not None
        speeds, speed = [], start
        spans, lengths = np.diff(self.times).tolist(), np.diff(self.timed).tolist()
        for span, length in zip(spans, lengths, strict=True):
            mean = length / span if span > 0.0 else speed
            if 2.0 * mean - speed < -1e-6:
                speed = mean
            speeds.append(speed)
            speed = 2.0 * mean - speed
        return (*speeds, speed)

    def project(self, x: float, y: float, ahead_of: float | None = None) -> tuple[float, float]:
        """Project a point onto the trajectory: return its arc length and its lateral offset, left positive [m].

        An open trajectory is extended along its tangents. If it passes the point several times, the first time after
        `ahead_of` counts.
        """
        vertices, vectors, lengths = self._segments
        to = np.array([x, y]) - vertices
        along = np.einsum("ni,ni->n", to, vectors)
        clipped = np.clip(along, 0.0, lengths)
        if not self.closed:
            clipped[0], clipped[-1] = min(along[0], clipped[0]), max(along[-1], clipped[-1])
        perpendicular = to - clipped[:, None] * vectors
        square = np.einsum("ni,ni->n", perpendicular, perpendicular)
        nearest = int(np.argmin(square))
        if ahead_of is not None:
            candidates = np.flatnonzero(np.sqrt(square) <= math.sqrt(square[nearest]) + SAME_PLACE)
            later = [n for n in candidates.tolist() if self.s[n] + clipped[n] >= ahead_of - SAME_PLACE]
            nearest = later[0] if later else nearest
        (ahead, left), (dx, dy) = vectors[nearest].tolist(), to[nearest].tolist()
        return self.s[nearest] + float(clipped[nearest]), ahead * dy - left * dx

    @cached_property
    def _segments(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Segments between samples: start points (N, 2), unit vectors (N, 2), lengths (N,) [m]."""
        points = np.array([(pose.x, pose.y) for pose in self.poses])
        vectors = np.diff(points, axis=0)
        lengths = np.hypot(vectors[:, 0], vectors[:, 1])
        headings = np.array([pose.h for pose in self.poses[:-1]])
        degenerate = lengths < 1e-9
        vectors[degenerate] = np.stack([np.cos(headings), np.sin(headings)], axis=1)[degenerate]
        lengths[degenerate] = 1.0
        units = vectors / lengths[:, None]
        lengths[degenerate] = 0.0
        return points[:-1], units, lengths

    @staticmethod
    def _interval(grid: Sequence[float], value: float) -> tuple[int, float]:
        index = min(max(bisect_right(grid, value) - 1, 0), len(grid) - 2)
        span = grid[index + 1] - grid[index]
        return index, min(1.0, max(0.0, (value - grid[index]) / span)) if span > 0.0 else 1.0


class TrajectoryProgress:
    """Progress of an actor along the trajectory that it follows.

    layout  trajectory
    way     +1 if the actor drives forwards, -1 if it drives backwards
    """

    def __init__(self, layout: TrajectoryCurve, s: float) -> None:
        self.layout = layout
        self.way = 1
        self._tick, self._before, self._after = -2, s, s

    def move(self, tick: int, before: float, after: float) -> None:
        """Set the arc length in the view of a tick, and that in the next one [m]."""
        self._tick, self._before, self._after = tick, before, after

    def at(self, tick: int) -> float:
        """Return the arc length in the view of a tick [m]."""
        return self._after if tick > self._tick else self._before


def sample_trajectory(trajectory: model.Trajectory, resolve: Resolve, start: Pose | None = None) -> TrajectoryCurve:
    """Sample a trajectory in world coordinates. `resolve` returns the current pose of a position.

    A clothoid spline without a start position begins at `start`.
    """
    shape = trajectory.shape.chosen()
    if isinstance(shape, model.Polyline):
        return _polyline(shape, trajectory.closed, resolve)
    if isinstance(shape, model.Clothoid):
        return _curve_of(clothoid(shape, resolve(shape.position)), trajectory.closed)
    if isinstance(shape, model.ClothoidSpline):
        return _curve_of(clothoid_spline(shape, resolve, start), trajectory.closed)
    assert isinstance(shape, model.Nurbs)
    return _nurbs(shape, trajectory.closed, resolve)


def _curve_of(course: Course, closed: bool) -> TrajectoryCurve:
    s, poses, times = course
    return TrajectoryCurve(tuple(s), tuple(poses), times, closed, tangents=tuple(pose.h for pose in poses))


def _polyline(shape: model.Polyline, closed: bool, resolve: Resolve) -> TrajectoryCurve:
    vertices = [resolve(vertex.position) for vertex in shape.vertex]
    times = [vertex.time for vertex in shape.vertex]
    if closed and math.hypot(vertices[0].x - vertices[-1].x, vertices[0].y - vertices[-1].y) > 1e-3:
        vertices.append(vertices[0])
        times.append(None)
    point_times = _times(times)
    if any(has_heading(vertex.position) for vertex in shape.vertex):
        s = [0.0]
        for a, b in pairwise(vertices):
            s.append(s[-1] + math.hypot(b.x - a.x, b.y - a.y))
        return TrajectoryCurve(tuple(s), tuple(vertices), point_times, closed, given=True)
    return _rounded_polyline(vertices, point_times, closed)


def _rounded_polyline(vertices: Sequence[Pose], times: tuple[float, ...] | None, closed: bool) -> TrajectoryCurve:
    """Return a polyline with tangential headings, which turn linearly within ROUNDING of a corner, or half a line."""
    spans = [math.hypot(b.x - a.x, b.y - a.y) for a, b in pairwise(vertices)]
    lines = [
        math.atan2(b.y - a.y, b.x - a.x) if span > 0.0 else a.h
        for (a, b), span in zip(pairwise(vertices), spans, strict=True)
    ]
    closing_turn = wrap_angle(lines[0] - lines[-1]) if closed else 0.0
    turns = [closing_turn, *(wrap_angle(b - a) for a, b in pairwise(lines)), closing_turn]
    s, poses, stations = [0.0], [vertices[0]._replace(h=lines[0] - 0.5 * turns[0])], [0.0]
    for index, ((a, b), span, line) in enumerate(zip(pairwise(vertices), spans, lines, strict=True)):
        inset = min(ROUNDING / span, 0.5) if span > 0.0 else 0.5
        if index > 0:
            s.append(stations[-1])
            poses.append(a._replace(h=line - 0.5 * turns[index]))
        for share, turn in ((inset, 0.0), (1.0 - inset, 0.0), (1.0, 0.5 * turns[index + 1])):
            s.append(stations[-1] + share * span)
            poses.append(_blend(a, b, share)._replace(h=line + turn))
        stations.append(stations[-1] + span)
    return TrajectoryCurve(tuple(s), tuple(poses), times, closed, stations=tuple(stations))


def _nurbs(shape: model.Nurbs, closed: bool, resolve: Resolve) -> TrajectoryCurve:
    """Return a rational B-spline with the headings of its control points (1.3.1, 6.9), or tangential without any.

    The curve passes through its first and last control points only. The standard does not define where on the curve
    the time of another control point holds. As in esmini (NurbsShape) it holds where the basis function is largest, on
    as many equidistant parameters as the control polygon has meters. Between, the parameter is linear in time. Of the
    two parameters at the peak the lower one counts, as traces of esmini show.
    """
    weights = [1.0 if point.weight is None else point.weight for point in shape.control_point]
    control = [(resolve(point.position), weight) for point, weight in zip(shape.control_point, weights, strict=True)]
    curve = Nurbs(shape.order, [knot.value for knot in shape.knot], control)
    polygon_length = sum(math.hypot(b.x - a.x, b.y - a.y) for (a, _), (b, _) in pairwise(control))
    count = min(max(2, math.ceil(polygon_length / SPACING)), MAX_POINTS)
    poses = curve.sampled(count)
    given = any(has_heading(point.position) for point in shape.control_point)
    smooth = along_the_curve(poses)
    tangents = tuple(pose.h for pose in smooth)
    if not given:
        poses = smooth
    s = [0.0, *accumulate(math.hypot(b.x - a.x, b.y - a.y) for a, b in pairwise(poses))]
    times = _times([point.time for point in shape.control_point])
    if times is None:
        return TrajectoryCurve(tuple(s), tuple(poses), None, closed, given, tangents=tangents)
    meters = 1 + int(polygon_length)
    stations = [math.floor((number + 1) / count * meters) / meters * count for number in curve.peaks(count)]
    point_times = np.interp(np.arange(count + 1), stations, times)
    return TrajectoryCurve(tuple(s), tuple(poses), tuple(point_times.tolist()), closed, given, tangents=tangents)


def has_heading(position: model.Position) -> bool:
    """True if a position specifies a heading."""
    frame = position.chosen()
    if isinstance(frame, model.WorldPosition):
        return frame.h is not None
    orientation = getattr(frame, "orientation", None)
    return orientation is not None and orientation.h is not None


def _blend(a: Pose, b: Pose, share: float) -> Pose:
    """Interpolate two poses; angles take the shorter way."""
    return Pose(
        a.x + share * (b.x - a.x),
        a.y + share * (b.y - a.y),
        a.z + share * (b.z - a.z),
        a.h + share * wrap_angle(b.h - a.h),
        a.p + share * wrap_angle(b.p - a.p),
        a.r + share * wrap_angle(b.r - a.r),
    )


def _times(point_times: Sequence[float | None]) -> tuple[float, ...] | None:
    given_times = [time for time in point_times if time is not None]
    return tuple(given_times) if len(given_times) == len(point_times) and given_times[-1] > given_times[0] else None
