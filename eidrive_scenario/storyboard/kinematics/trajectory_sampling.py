"""Sampling of trajectories: all shapes of the standard as curves by arc length."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import accumulate, pairwise

import numpy as np

from eidrive_scenario.geometry import wrap_angle
from eidrive_scenario.openscenario import model
from eidrive_scenario.roads import Pose
from eidrive_scenario.storyboard.kinematics.clothoids import MAX_POINTS, SPACING, Course, clothoid, clothoid_spline
from eidrive_scenario.storyboard.kinematics.nurbs import Nurbs, along_the_curve
from eidrive_scenario.storyboard.kinematics.trajectory import TrajectoryCurve, blend

ROUNDING = 2.0
"""Maximum distance from a corner of a polyline at which the heading turns [m]."""

Resolve = Callable[[model.Position], Pose]
"""Returns the current pose of a position."""


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
            poses.append(blend(a, b, share)._replace(h=line + turn))
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
    # A control point whose basis function is zero at all samples of a long curve has no time of its own
    peaks = [(number, time) for number, time in zip(curve.peaks(count), times, strict=True) if number is not None]
    stations = [math.floor((number + 1) / count * meters) / meters * count for number, _ in peaks]
    point_times = np.interp(np.arange(count + 1), stations, [time for _, time in peaks])
    return TrajectoryCurve(tuple(s), tuple(poses), tuple(point_times.tolist()), closed, given, tangents=tangents)


def has_heading(position: model.Position) -> bool:
    """True if a position specifies a heading."""
    frame = position.chosen()
    if isinstance(frame, model.WorldPosition):
        return frame.h is not None
    orientation = getattr(frame, "orientation", None)
    return orientation is not None and orientation.h is not None


def _times(point_times: Sequence[float | None]) -> tuple[float, ...] | None:
    given_times = [time for time in point_times if time is not None]
    return tuple(given_times) if len(given_times) == len(point_times) and given_times[-1] > given_times[0] else None
