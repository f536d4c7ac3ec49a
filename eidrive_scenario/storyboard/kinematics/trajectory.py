"""Trajectories as curves by arc length, with times if they are given."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.geometry import wrap_angle
from eidrive_scenario.roads import Pose

SAME_PLACE = 1e-3
"""Tolerance of distances at which a trajectory passes a point several times [m]."""
REACH = 10.0
"""Maximum distance along a trajectory between two successive places of an actor that was not teleported [m]."""


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
    def end_time(self) -> float:
        """Time of the last point [s]; 0 without times, infinite for a closed trajectory, which is followed in laps."""
        if self.times is None:
            return 0.0
        return math.inf if self.closed else self.times[-1]

    def at(self, s: float) -> Pose:
        """Return the pose at arc length s [m]. Beyond an end it is that of the end; a closed trajectory is periodic."""
        index, share = self._interval(self.s, self._wrapped(s))
        return blend(self.poses[index], self.poses[index + 1], share)

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
        (begin, first), (end, last) = [(self.s[n], self.poses[n].z) for n in ((0, 1) if beyond < 0.0 else (-2, -1))]
        rise = beyond * (last - first) / (end - begin) if end > begin else 0.0
        return pose._replace(x=pose.x + beyond * math.cos(along), y=pose.y + beyond * math.sin(along), z=pose.z + rise)

    def _wrapped(self, s: float) -> float:
        return s % self.length if self.closed and self.length > 0.0 and not 0.0 <= s <= self.length else s

    @cached_property
    def _directions(self) -> tuple[float, ...]:
        """Direction of each segment [rad]; one of no length has that of the next, otherwise of the previous segment."""
        _, vectors, lengths = self._segments
        directions = [
            math.atan2(y, x) if length > 0.0 else None
            for (x, y), length in zip(vectors.tolist(), lengths.tolist(), strict=True)
        ]
        return tuple(pose.h if h is None else h for h, pose in zip(fill_gaps(directions), self.poses, strict=False))

    def at_time(self, time: float, speeds: Sequence[float] | None = None) -> float:
        """Return the arc length at a time [m]: at constant speed between points, or by the `speeds` at the points."""
        if self.times is None:
            return 0.0
        laps, time = self._lap_at(time)
        index, share = self._interval(self.times, time)
        s = self.timed
        way = s[index + 1] - s[index]
        if speeds is not None:
            span = self.times[index + 1] - self.times[index]
            way = speeds[index] * span * (1.0 - share) + share * way
        return laps * self.length + s[index] + share * way

    def _lap_at(self, time: float) -> tuple[int, float]:
        """Return the number of complete laps of a closed trajectory at a time, and the time within its lap [s]."""
        assert self.times is not None
        span = self.times[-1] - self.times[0]
        laps = max(0, math.floor((time - self.times[0]) / span)) if self.closed else 0
        return laps, time - laps * span

    def speed_at(self, time: float) -> float:
        """Return the mean speed between the points around a time [m/s]: 0 before the first one, the last at the end."""
        if self.times is None or time < self.times[0]:
            return 0.0
        index, _ = self._interval(self.times, self._lap_at(time)[1])
        span = self.times[index + 1] - self.times[index]
        return (self.timed[index + 1] - self.timed[index]) / span if span > 0.0 else 0.0

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
        _, vectors, _ = self._segments
        to, clipped, square = self._nearest_of_segments(x, y)
        nearest = int(np.argmin(square))
        if ahead_of is not None:
            candidates = np.flatnonzero(np.sqrt(square) <= math.sqrt(square[nearest]) + SAME_PLACE)
            later = [n for n in candidates.tolist() if self.s[n] + clipped[n] >= ahead_of - SAME_PLACE]
            nearest = later[0] if later else nearest
        (ahead, left), (dx, dy) = vectors[nearest].tolist(), to[nearest].tolist()
        return self.s[nearest] + float(clipped[nearest]), ahead * dy - left * dx

    def track(self, x: float, y: float, before: float) -> float:
        """Return the arc length nearest to an actor that was at `before` [m] a time step ago.

        Where the trajectory passes a place several times, it is the one within REACH of `before`. An open trajectory is
        extended along its tangents.
        """
        _, clipped, square = self._nearest_of_segments(x, y)
        arc_lengths = self._starts + clipped
        apart = arc_lengths - before
        if self.closed and self.length > 0.0:
            apart -= self.length * np.round(apart / self.length)
        nearest = int(np.argmin(square))
        close = np.flatnonzero(np.abs(apart) <= REACH)
        if len(close):
            local = int(close[np.argmin(square[close])])
            if math.sqrt(square[local]) <= math.sqrt(square[nearest]) + REACH:
                nearest = local
        return float(arc_lengths[nearest])

    def _nearest_of_segments(
        self, x: float, y: float
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Return vectors to a point from the start of each segment (N, 2), and of its place nearest to the point:
        distance from the start (N,) [m], squared distance to the point (N,) [m²].
        """
        vertices, vectors, lengths = self._segments
        to = np.array([x, y]) - vertices
        along = np.einsum("ni,ni->n", to, vectors)
        clipped = np.clip(along, 0.0, lengths)
        if not self.closed:
            clipped[0] = min(along[0], clipped[0])
            clipped[-1] = max(along[-1], clipped[-1])
        perpendicular = to - clipped[:, None] * vectors
        return to, clipped, np.einsum("ni,ni->n", perpendicular, perpendicular)

    @cached_property
    def _starts(self) -> NDArray[np.float64]:
        """Arc length at the start of each segment (N,) [m]."""
        return np.array(self.s[:-1])

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


def fill_gaps(values: Sequence[float | None]) -> list[float | None]:
    """Replace missing values by the next one, otherwise by the previous one; they remain missing without any."""
    filled = list(values)
    for order in (range(len(filled) - 2, -1, -1), range(1, len(filled))):
        for index in order:
            if filled[index] is None:
                filled[index] = filled[index - order.step]
    return filled


def blend(a: Pose, b: Pose, share: float) -> Pose:
    """Interpolate two poses; angles take the shorter way."""
    return Pose(
        a.x + share * (b.x - a.x),
        a.y + share * (b.y - a.y),
        a.z + share * (b.z - a.z),
        _blend_angle(a.h, b.h, share),
        _blend_angle(a.p, b.p, share),
        _blend_angle(a.r, b.r, share),
    )


def _blend_angle(a: float, b: float, share: float) -> float:
    return a + share * wrap_angle(b - a) if a != b else a + 0.0
