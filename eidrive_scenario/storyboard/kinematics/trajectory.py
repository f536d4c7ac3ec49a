"""Trajectories in the world: any shape of the standard as a curve by arc length, with times where it has them."""

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
from eidrive_scenario.storyboard.kinematics.clothoids import MOST_POINTS, SPACING, Course, clothoid, clothoid_spline
from eidrive_scenario.storyboard.kinematics.nurbs import Nurbs, along_the_curve

ROUNDING = 2.0
"""How far from a corner of a polyline the heading begins to turn [m]."""

SAME_PLACE = 1e-3
"""Two passes of a trajectory by a point that are as near as this are by the same place [m]."""

Resolve = Callable[[model.Position], Pose]


@dataclass(frozen=True)
class TrajectoryCurve:
    """A trajectory as points with headings, by arc length.

    s         arc length of each point [m];  poses  of each point
    times     at which the stations are passed [s], None for a trajectory without times
    given     True where the file gives headings
    stations  arc length of the points that have times [m]; empty: all have
    tangents  direction of the curve at each point [rad]; empty: it is straight between points
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
        """Arc length of the whole [m]."""
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
        """The pose at arc length s; beyond the ends that of the end, on a closed one further round."""
        index, share = self._between(self.s, self._round(s))
        return _blend(self.poses[index], self.poses[index + 1], share)

    def tangent(self, s: float) -> float:
        """Return the direction of the curve at arc length s [rad], whichever way its poses look."""
        index, share = self._between(self.s, self._round(s))
        if not self.tangents:
            return self._directions[index]
        return self.tangents[index] + share * wrap_angle(self.tangents[index + 1] - self.tangents[index])

    def extended(self, s: float) -> Pose:
        """Return the pose at arc length s; beyond the ends of an open trajectory straight on along its tangent."""
        pose = self.at(s)
        beyond = 0.0 if self.closed else s - min(max(s, 0.0), self.length)
        if beyond == 0.0:
            return pose
        along = self.tangent(s)
        return pose._replace(x=pose.x + beyond * math.cos(along), y=pose.y + beyond * math.sin(along))

    def _round(self, s: float) -> float:
        return s % self.length if self.closed and self.length > 0.0 and not 0.0 <= s <= self.length else s

    @cached_property
    def _directions(self) -> tuple[float, ...]:
        """Direction of each straight piece [rad]; one of no length has that of the next, else of the one before."""
        _, ways, lengths = self._stretches
        found: list[float | None] = [
            math.atan2(y, x) if length > 0.0 else None
            for (x, y), length in zip(ways.tolist(), lengths.tolist(), strict=True)
        ]
        for order in (range(len(found) - 2, -1, -1), range(1, len(found))):
            for index in order:
                if found[index] is None:
                    found[index] = found[index + (1 if order.step < 0 else -1)]
        return tuple(pose.h if h is None else h for h, pose in zip(found, self.poses, strict=False))

    def at_time(self, time: float, speeds: Sequence[float] | None = None) -> float:
        """Arc length at a time [m]: between two points at constant speed, or as the `speeds` at the points ask."""
        if self.times is None:
            return 0.0
        index, share = self._between(self.times, time)
        s = self.timed
        way = s[index + 1] - s[index]
        if speeds is None:
            return s[index] + share * way
        span = self.times[index + 1] - self.times[index]
        return s[index] + share * (speeds[index] * span * (1.0 - share) + share * way)

    def time_at(self, s: float) -> float:
        """The time at an arc length [s]; 0 without times."""
        if self.times is None:
            return 0.0
        index, share = self._between(self.timed, s)
        return self.times[index] + share * (self.times[index + 1] - self.times[index])

    def speeds_from(self, start: float) -> tuple[float, ...]:
        """Speeds at the points [m/s] if they change linearly over time from `start`, and the times are to be kept.

        Where the next speed would be negative the stretch is driven at its mean speed instead.
        """
        assert self.times is not None
        speeds, speed = [], start
        for span, way in zip(map(_gap, pairwise(self.times)), map(_gap, pairwise(self.timed)), strict=True):
            mean = way / span if span > 0.0 else speed
            if 2.0 * mean - speed < -1e-6:
                speed = mean
            speeds.append(speed)
            speed = 2.0 * mean - speed
        return (*speeds, speed)

    def project(self, x: float, y: float, ahead_of: float | None = None) -> tuple[float, float]:
        """Arc length of the place that is nearest to a point, and how far to the left of it the point lies [m].

        An open trajectory goes straight on beyond its ends. Where it comes by several times, the first time after
        `ahead_of` is meant.
        """
        corners, ways, lengths = self._stretches
        to = np.array([x, y]) - corners
        along = np.einsum("ni,ni->n", to, ways)
        held = np.clip(along, 0.0, lengths)
        if not self.closed:
            held[0], held[-1] = min(along[0], held[0]), max(along[-1], held[-1])
        apart = to - held[:, None] * ways
        square = np.einsum("ni,ni->n", apart, apart)
        nearest = int(np.argmin(square))
        if ahead_of is not None:
            passes = np.flatnonzero(np.sqrt(square) <= math.sqrt(square[nearest]) + SAME_PLACE)
            later = [n for n in passes.tolist() if self.s[n] + held[n] >= ahead_of - SAME_PLACE]
            nearest = later[0] if later else nearest
        (ahead, left), (dx, dy) = ways[nearest].tolist(), to[nearest].tolist()
        return self.s[nearest] + float(held[nearest]), ahead * dy - left * dx

    @cached_property
    def _stretches(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """The straight pieces between points: (N, 2) where they begin, (N, 2) unit vectors along, (N,) lengths [m]."""
        points = np.array([(pose.x, pose.y) for pose in self.poses])
        ways = np.diff(points, axis=0)
        lengths = np.hypot(ways[:, 0], ways[:, 1])
        headings = np.array([pose.h for pose in self.poses[:-1]])
        standing = lengths < 1e-9
        ways[standing] = np.stack([np.cos(headings), np.sin(headings)], axis=1)[standing]
        lengths[standing] = 1.0
        units = ways / lengths[:, None]
        lengths[standing] = 0.0
        return points[:-1], units, lengths

    @staticmethod
    def _between(grid: Sequence[float], value: float) -> tuple[int, float]:
        index = min(max(bisect_right(grid, value) - 1, 0), len(grid) - 2)
        span = grid[index + 1] - grid[index]
        return index, min(1.0, max(0.0, (value - grid[index]) / span)) if span > 0.0 else 1.0


class TrajectoryProgress:
    """How far an actor is along the trajectory that it follows.

    layout  the trajectory
    way     +1 where the actor's own forward direction leads towards the end, -1 where it drives tail first
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
    """A trajectory in the world. `resolve` gives the pose that a position means now.

    A clothoid spline that does not say where it starts begins at `start`.
    """
    shape = trajectory.shape.chosen()
    if isinstance(shape, model.Polyline):
        return _polyline(shape, trajectory.closed, resolve)
    if isinstance(shape, model.Clothoid):
        return _passed(clothoid(shape, resolve(shape.position)), trajectory.closed)
    if isinstance(shape, model.ClothoidSpline):
        return _passed(clothoid_spline(shape, resolve, start), trajectory.closed)
    assert isinstance(shape, model.Nurbs)
    return _nurbs(shape, trajectory.closed, resolve)


def _passed(course: Course, closed: bool) -> TrajectoryCurve:
    s, poses, times = course
    return TrajectoryCurve(tuple(s), tuple(poses), times, closed, tangents=tuple(pose.h for pose in poses))


def _polyline(shape: model.Polyline, closed: bool, resolve: Resolve) -> TrajectoryCurve:
    corners = [resolve(vertex.position) for vertex in shape.vertex]
    times = [vertex.time for vertex in shape.vertex]
    if closed and math.hypot(corners[0].x - corners[-1].x, corners[0].y - corners[-1].y) > 1e-3:
        corners.append(corners[0])
        times.append(None)
    clock = _times(times)
    if any(has_heading(vertex.position) for vertex in shape.vertex):
        s = [0.0]
        for a, b in pairwise(corners):
            s.append(s[-1] + math.hypot(b.x - a.x, b.y - a.y))
        return TrajectoryCurve(tuple(s), tuple(corners), clock, closed, given=True)
    return _along_corners(corners, clock, closed)


def _along_corners(corners: Sequence[Pose], times: tuple[float, ...] | None, closed: bool) -> TrajectoryCurve:
    """A polyline whose heading is that of its lines, and turns evenly within ROUNDING of a corner or half the line."""
    spans = [math.hypot(b.x - a.x, b.y - a.y) for a, b in pairwise(corners)]
    lines = [
        math.atan2(b.y - a.y, b.x - a.x) if span > 0.0 else a.h
        for (a, b), span in zip(pairwise(corners), spans, strict=True)
    ]
    around = wrap_angle(lines[0] - lines[-1]) if closed else 0.0
    turns = [around, *(wrap_angle(b - a) for a, b in pairwise(lines)), around]
    s, poses, stations = [0.0], [corners[0]._replace(h=lines[0] - 0.5 * turns[0])], [0.0]
    for index, ((a, b), span, line) in enumerate(zip(pairwise(corners), spans, lines, strict=True)):
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
    """A rational B-spline; it looks where its control points do, if they say (1.3.1, 6.9), else along the curve.

    The curve passes through its first and last control points only, and the standard does not say where on it the time
    of another one holds. As in esmini (its NurbsShape) that is where its basis function is largest, on as many even
    steps of the parameter as the control polygon has meters; between, the parameter grows evenly with time. Which of
    the two steps around the peak counts its traces alone tell: the one before.
    """
    weights = [1.0 if point.weight is None else point.weight for point in shape.control_point]
    control = [(resolve(point.position), weight) for point, weight in zip(shape.control_point, weights, strict=True)]
    curve = Nurbs(shape.order, [knot.value for knot in shape.knot], control)
    rough = sum(math.hypot(b.x - a.x, b.y - a.y) for (a, _), (b, _) in pairwise(control))
    count = min(max(2, math.ceil(rough / SPACING)), MOST_POINTS)
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
    meters = 1 + int(rough)
    stations = [math.floor((number + 1) / count * meters) / meters * count for number in curve.peaks(count)]
    clock = np.interp(np.arange(count + 1), stations, times)
    return TrajectoryCurve(tuple(s), tuple(poses), tuple(clock.tolist()), closed, given, tangents=tangents)


def has_heading(position: model.Position) -> bool:
    """True where a position says which way to point."""
    frame = position.chosen()
    if isinstance(frame, model.WorldPosition):
        return frame.h is not None
    orientation = getattr(frame, "orientation", None)
    return orientation is not None and orientation.h is not None


def _blend(a: Pose, b: Pose, share: float) -> Pose:
    """Between two poses, angles the short way round."""
    return Pose(
        a.x + share * (b.x - a.x),
        a.y + share * (b.y - a.y),
        a.z + share * (b.z - a.z),
        a.h + share * wrap_angle(b.h - a.h),
        a.p + share * wrap_angle(b.p - a.p),
        a.r + share * wrap_angle(b.r - a.r),
    )


def _gap(ends: tuple[float, float]) -> float:
    return ends[1] - ends[0]


def _times(clock: Sequence[float | None]) -> tuple[float, ...] | None:
    known = [time for time in clock if time is not None]
    return tuple(known) if len(known) == len(clock) and known[-1] > known[0] else None
