"""Sampling of trajectories: all shapes of the standard as curves by arc length."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import accumulate, pairwise
from typing import Literal, NamedTuple

import numpy as np

from eidrive_scenario.base.arrays import Array, Integers
from eidrive_scenario.base.geometry import wrap_angle
from eidrive_scenario.base.tolerances import EPSILON
from eidrive_scenario.openscenario import model
from eidrive_scenario.roads import LaneLocation, Pose, RoadNetwork
from eidrive_scenario.storyboard.kinematics.trajectory import TrajectoryCurve, blend, fill_gaps

SPACING = 0.1
"""Distance between samples of curved shapes [m]."""
MAX_POINTS = 20_000
"""Maximum number of samples of a curve, besides one per segment; beyond 2 km their distance is larger."""
CLOSED = 1e-3
"""Maximum distance between start and end of a closed trajectory without a closing line [m]."""

Resolve = Callable[[model.Position], Pose]
"""Returns the current pose of a position."""


def _clothoid(shape: model.Clothoid, closed: bool, resolve: Resolve) -> TrajectoryCurve:
    change = shape.curvature_prime if shape.curvature_prime is not None else shape.curvature_dot or 0.0
    last = shape.curvature + change * shape.length
    s, poses = _spiral(resolve(shape.position), shape.curvature, last, shape.length)
    times, start, stop = None, shape.start_time, shape.stop_time
    if start is not None and stop is not None:
        length = s[-1] if s[-1] > 0.0 else 1.0
        times = [start + (stop - start) * distance / length for distance in s]
    return _curve_of(s, poses, times, closed)


def _clothoid_spline(shape: model.ClothoidSpline, closed: bool, resolve: Resolve, here: Pose | None) -> TrajectoryCurve:
    """Return consecutive clothoids; `here` is the start if the first segment has no position.

    The speed is constant between segments with a start time; the first one starts at 0.
    """
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
    if shape.time_end is None:
        return _curve_of(s[1:], poses, None, closed)
    times, begin = {0.0: 0.0}, 0.0
    for segment in shape.clothoid_spline_segment:
        if segment.time_start is not None:
            times[begin] = segment.time_start
        begin += segment.length
    times[begin] = shape.time_end
    return _curve_of(s[1:], poses, np.interp(s[1:], list(times), list(times.values())).tolist(), closed)


def _curve_of(
    s: Sequence[float], poses: Sequence[Pose], times: Sequence[float] | None, closed: bool
) -> TrajectoryCurve:
    """Return a curve with the headings of its poses as tangents."""
    tangents = tuple(pose.h for pose in poses)
    return TrajectoryCurve(tuple(s), tuple(poses), None if times is None else tuple(times), closed, tangents=tangents)


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
    unwrapped = [poses[0]]
    for pose in poses[1:]:
        before = unwrapped[-1]
        h, p, r = (old + wrap_angle(new - old) for old, new in zip(before[3:], pose[3:], strict=True))
        unwrapped.append(pose._replace(h=h, p=p, r=r))
    return unwrapped


ROUNDING = 2.0
"""Maximum distance from a corner of a polyline at which the heading turns [m]."""


def sample_trajectory(
    trajectory: model.Trajectory, resolve: Resolve, start: Pose | None = None, roads: RoadNetwork | None = None
) -> TrajectoryCurve:
    """Sample a trajectory in world coordinates. `resolve` returns the current pose of a position.

    A clothoid spline without a start position begins at `start`. Between positions without a specified height the
    trajectory follows the surface of `roads`; None: it is linear there.
    """
    shape = trajectory.shape.chosen()
    if isinstance(shape, model.Polyline):
        return _polyline(shape, trajectory.closed, resolve, roads)
    if isinstance(shape, model.Clothoid):
        curve = _clothoid(shape, trajectory.closed, resolve)
    elif isinstance(shape, model.ClothoidSpline):
        curve = _clothoid_spline(shape, trajectory.closed, resolve, start)
    else:
        assert isinstance(shape, model.Nurbs)
        curve = _nurbs(shape, trajectory.closed, resolve)
    if trajectory.closed:
        curve = _with_closing_line(curve)
    positions = [part for part in shape.walk() if isinstance(part, model.Position)]
    if roads is not None and all(_is_on_ground(position) for position in positions):
        tilts = not any(specifies(position, "p") or specifies(position, "r") for position in positions)
        curve = _over_roads(curve, roads, [SurfacePart(0.0, curve.length, tilts)])
    return curve


def _is_on_ground(position: model.Position) -> bool:
    """Return whether a position is on the surface of the road, as it specifies no height."""
    frame = position.chosen()
    if isinstance(frame, model.TrajectoryPosition):
        return False
    return not any(getattr(frame, name, None) for name in ("dz", "altitude")) and not any(
        getattr(frame, name, None) is not None for name in ("z", "height")
    )


SURFACE_SPACING, SHORT_LINE = 1.0, 5.0
"""Distance between the places at which a trajectory is laid on the surface of roads, and maximum length of a line
between two positions on it that is close enough to it [m]: 6 mm on a crest with a radius of 500 m."""
MAX_PLACES = 5_000
"""Maximum number of such places of a trajectory, besides two per line; beyond 5 km their distance is larger."""


class SurfacePart(NamedTuple):
    """Part of a trajectory that follows the surface of roads: begin and end [m], and whether its pitch and roll do."""

    begin: float
    end: float
    tilts: bool


def _over_roads(curve: TrajectoryCurve, roads: RoadNetwork, parts: Sequence[SurfacePart]) -> TrajectoryCurve:
    """Return a curve whose parts have the heights of the roads, where they are on some."""
    if roads.is_flat:
        return curve
    spacing = max(SURFACE_SPACING, curve.length / MAX_PLACES)
    s: list[float] = []
    poses: list[Pose] = []
    done, near = 0, None
    for part in parts:
        low, high = bisect_right(curve.s, part.begin) - 1, bisect_left(curve.s, part.end) + 1
        samples = list(zip(curve.s[low:high], curve.poses[low:high], strict=True))
        if curve.stations:
            samples = [sample for ends in pairwise(samples) for sample in _between(*ends, spacing)] + samples[-1:]
        laid, near = _laid(samples, roads, spacing, near, tilts=part.tilts)
        if laid is not None:
            shared = max(done - low, 0)  # The part before may end with the sample with which this one begins.
            s += [*curve.s[done:low], *(place for place, _ in samples[shared:])]
            poses += [*curve.poses[done:low], *laid[shared:]]
            done = high
    return replace(curve, s=(*s, *curve.s[done:]), poses=(*poses, *curve.poses[done:]))


def _laid(
    samples: Sequence[tuple[float, Pose]],
    roads: RoadNetwork,
    spacing: float,
    near: LaneLocation | None,
    *,
    tilts: bool,
) -> tuple[list[Pose] | None, LaneLocation | None]:
    """Return the poses of samples on the surface of roads, found about every `spacing` [m], and the last location.

    The poses are None if the samples are on the surface.

    near  location before the samples, if there is one
    """
    places = [0]
    for number in range(1, len(samples)):
        if samples[number][0] - samples[places[-1]][0] >= spacing or number == len(samples) - 1:
            places.append(number)
    levels: list[Pose] = []
    height = samples[0][1].z
    for number in places:
        # Where roads cross above each other, the surface is that near the one before.
        level, near = on_surface(samples[number][1], roads, near, height)
        height = level.z
        levels.append(level)
    poses = [pose for _, pose in samples]
    rises = [level.z - poses[number].z for level, number in zip(levels, places, strict=True)]
    if all(abs(rise) < EPSILON for rise in rises):
        return None, near
    stations = [samples[number][0] for number in places]
    columns = (rises, [level.p for level in levels], [level.r for level in levels])
    over = np.column_stack([np.interp([place for place, _ in samples], stations, column) for column in columns])
    return [
        pose._replace(z=pose.z + rise, p=p, r=r) if tilts else pose._replace(z=pose.z + rise)
        for pose, (rise, p, r) in zip(poses, over.tolist(), strict=True)
    ], near


def on_surface(
    pose: Pose, roads: RoadNetwork, near: LaneLocation | None, height: float | None = None
) -> tuple[Pose, LaneLocation | None]:
    """Return a pose on the surface of the roads, with its height, pitch and roll, and the location there.

    Without a road the pose is the same.

    near    location before, if there is one
    height  height near which the surface is where roads overlap [m]
    """
    location = roads.locate_at(pose.x, pose.y, near, height)
    return (pose, None) if location is None else (roads.laid(pose, location), location)


def _between(first: tuple[float, Pose], last: tuple[float, Pose], spacing: float) -> Iterator[tuple[float, Pose]]:
    """Yield a sample of a polyline, and further ones at most `spacing` [m] apart up to the next one."""
    (begin, a), (end, b) = first, last
    count = max(1, math.ceil((end - begin) / spacing))
    for number in range(count):
        share = number / count
        yield begin + share * (end - begin), blend(a, b, share) if number else a


def _with_closing_line(curve: TrajectoryCurve) -> TrajectoryCurve:
    """Return a closed curve with a line from its end to its start, covered at the mean speed of the curve.

    The heading turns at both ends of the line. A curve that ends at its start has no line.
    """
    first, last = curve.poses[0], curve.poses[-1]
    dx, dy, dz = first.x - last.x, first.y - last.y, first.z - last.z
    gap = math.hypot(dx, dy)
    if gap <= CLOSED or curve.length == 0.0:
        return curve
    h, p, turn = math.atan2(dy, dx), -math.atan2(dz, gap), min(ROUNDING / gap, 0.5)
    shares = sorted({turn, 1.0 - turn})
    line = [Pose(last.x + part * dx, last.y + part * dy, last.z + part * dz, h, p, 0.0) for part in shares]
    ways = [gap * part for part in (*shares, 1.0)]
    times = curve.times
    if times is not None:
        pause = (times[-1] - times[0]) / curve.length
        times = (*times, *(times[-1] + way * pause for way in ways))
    s = (*curve.s, *(curve.length + way for way in ways))
    tangents = (*curve.tangents, *(h for _ in shares), curve.tangents[0])
    return replace(curve, s=s, poses=(*curve.poses, *line, first), times=times, tangents=tangents)


@dataclass(frozen=True)
class PolylineVertex:
    """Vertex of a polyline: pose, and the heading and pitch that the file specifies [rad]; None without one.

    is_tilted     whether the file specifies pitch or roll
    is_on_ground  whether it specifies no height
    """

    pose: Pose
    h: float | None
    p: float | None
    is_tilted: bool
    is_on_ground: bool

    @property
    def is_oriented(self) -> bool:
        """Whether the file specifies any angle."""
        return self.h is not None or self.is_tilted


def _polyline(shape: model.Polyline, closed: bool, resolve: Resolve, roads: RoadNetwork | None) -> TrajectoryCurve:
    vertices = [_vertex(vertex.position, resolve) for vertex in shape.vertex]
    times = [vertex.time for vertex in shape.vertex]
    first, last = vertices[0].pose, vertices[-1].pose
    gap = math.hypot(first.x - last.x, first.y - last.y)
    if closed and gap > CLOSED:
        vertices.append(vertices[0])
        instants = _times(times)
        length = sum(math.hypot(b.pose.x - a.pose.x, b.pose.y - a.pose.y) for a, b in pairwise(vertices)) - gap
        # The closing line has no time in the file: it is covered at the mean speed.
        times.append(
            None if instants is None or length == 0.0 else instants[-1] + gap * (instants[-1] - instants[0]) / length
        )
    curve = _sampled_polyline(vertices, _times(times), closed)
    if roads is None:
        return curve
    pairs = zip(pairwise(curve.stations), pairwise(vertices), strict=True)
    parts = [
        SurfacePart(begin, end, not a.is_tilted and not b.is_tilted)
        for (begin, end), (a, b) in pairs
        if a.is_on_ground and b.is_on_ground and end - begin > SHORT_LINE
    ]
    return _over_roads(curve, roads, parts)


def _vertex(position: model.Position, resolve: Resolve) -> PolylineVertex:
    pose = resolve(position)
    h = pose.h if specifies(position, "h") else None
    p = pose.p if specifies(position, "p") else None
    is_tilted = p is not None or specifies(position, "r")
    return PolylineVertex(pose, h, p, is_tilted, _is_on_ground(position))


def _sampled_polyline(
    vertices: Sequence[PolylineVertex], times: tuple[float, ...] | None, closed: bool
) -> TrajectoryCurve:
    """Return a polyline with the headings and pitches of its vertices; those that the file omits follow the lines.

    Between two vertices without a heading, it is that of the line, and turns within ROUNDING of a corner, or half a
    line. From and to a vertex with a heading it changes linearly. So does the pitch.
    """
    pairs = list(pairwise(vertices))
    spans = [math.hypot(b.pose.x - a.pose.x, b.pose.y - a.pose.y) for a, b in pairs]
    headings = _along_lines(
        [math.atan2(b.pose.y - a.pose.y, b.pose.x - a.pose.x) for a, b in pairs], spans, vertices[0].pose.h
    )
    slopes = _along_lines(
        [math.atan2(a.pose.z - b.pose.z, span) for (a, b), span in zip(pairs, spans, strict=True)], spans, 0.0
    )
    turns, tilts = _corner_turns(headings, closed), _corner_turns(slopes, closed)
    s, poses, stations = [], [], [0.0]
    for index, ((a, b), span) in enumerate(zip(pairs, spans, strict=True)):
        inset = min(ROUNDING / span, 0.5) if span > 0.0 else 0.5
        shares = (0.0, inset, 1.0 - inset, 1.0)
        ways = _over_line(headings[index], turns[index], turns[index + 1])
        own_headings = _over_segment(a.h, b.h, ways, inset)
        climbs = _over_line(slopes[index], tilts[index], tilts[index + 1])
        own_slopes = [
            climb if h == way else _pitch(climb, h - way)
            for climb, way, h in zip(climbs, ways, own_headings, strict=True)
        ]
        pitches = _over_segment(a.p, b.p, own_slopes, inset)
        first, last = _level_to(a, own_headings[0]), _level_to(b, own_headings[-1])
        is_linear = None not in (a.h, b.h) and tilts[index] == tilts[index + 1] == 0.0
        begin = 1 if index > 0 and is_linear else 0
        for number in ((0, 3) if is_linear else (0, 1, 2, 3))[begin:]:
            share = shares[number]
            s.append(stations[-1] + share * span)
            pose = first if number == 0 else last if is_linear else blend(first, last, share)
            poses.append(pose._replace(h=own_headings[number], p=pitches[number]))
        stations.append(stations[-1] + span)
    given = any(vertex.h is not None for vertex in vertices)
    return TrajectoryCurve(tuple(s), tuple(poses), times, closed, given, stations=tuple(stations))


def _along_lines(angles: Sequence[float], spans: Sequence[float], without: float) -> list[float]:
    """Return the angles of lines [rad]; a line of no length has that of the next, otherwise of the previous line."""
    directions = [angle if span > 0.0 else None for angle, span in zip(angles, spans, strict=True)]
    return [without if angle is None else angle for angle in fill_gaps(directions)]


def _corner_turns(lines: Sequence[float], closed: bool) -> list[float]:
    """Return the change of an angle at each vertex [rad]; 0 at the ends of an open polyline."""
    closing_turn = wrap_angle(lines[0] - lines[-1]) if closed else 0.0
    return [closing_turn, *(wrap_angle(b - a) for a, b in pairwise(lines)), closing_turn]


def _over_line(line: float, turn_before: float, turn_after: float) -> list[float]:
    """Return an angle at the start of a line, after its first corner, before its second one, and at its end [rad]."""
    return [line - 0.5 * turn_before, line, line, line + 0.5 * turn_after]


def _over_segment(start: float | None, end: float | None, line: Sequence[float], inset: float) -> Sequence[float]:
    """Return an angle at the points of `_over_line` [rad], which are `inset` of the segment beside its ends.

    It is linear between two specified values, and between a specified value and that of the line at the other corner.
    """
    if start is None and end is None:
        return line
    if start is not None and end is not None:
        turn = wrap_angle(end - start)
        return [start, start + inset * turn, start + (1.0 - inset) * turn, end]
    if start is not None:
        return [start, start + inset / (1.0 - inset) * wrap_angle(line[2] - start), *line[2:]]
    assert end is not None
    return [*line[:2], end + inset / (1.0 - inset) * wrap_angle(line[1] - end), end]


def _pitch(climb: float, turn: float) -> float:
    """Return the pitch of an actor on a slope [rad] with the pitch `climb` for one that points along it."""
    return math.atan(math.tan(climb) * math.cos(turn)) if climb != 0.0 else 0.0


def _level_to(vertex: PolylineVertex, heading: float) -> Pose:
    """Return the pose of a vertex with the roll of its surface at a heading; a specified orientation is kept."""
    if vertex.is_oriented:
        return vertex.pose
    return vertex.pose.turned(wrap_angle(heading - vertex.pose.h))


def _nurbs(shape: model.Nurbs, closed: bool, resolve: Resolve) -> TrajectoryCurve:
    """Return a rational B-spline with the headings of its control points (1.3.1, 6.9), or tangential without any.

    Where only some control points have a heading, their deviations from the tangent at the largest basis function are
    blended with 0 for the others.

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
    smooth = along_the_curve(poses)
    tangents = tuple(pose.h for pose in smooth)
    has_headings = [specifies(point.position, "h") for point in shape.control_point]
    given = any(has_headings)
    if not given:
        poses = smooth
    elif not all(has_headings):
        turned = [
            (pose._replace(h=wrap_angle(pose.h - tangents[peak]) if has_heading and peak is not None else 0.0), weight)
            for (pose, weight), peak, has_heading in zip(control, curve.peaks(count), has_headings, strict=True)
        ]
        turns = Nurbs(shape.order, curve.knots, turned).sampled(count)
        poses = [pose._replace(h=h + turn.h) for pose, h, turn in zip(poses, tangents, turns, strict=True)]
    if given and not any(specifies(point.position, "p") for point in shape.control_point):
        poses = [pose._replace(p=_pitch(along.p, pose.h - along.h)) for pose, along in zip(poses, smooth, strict=True)]
    s = [0.0, *accumulate(math.hypot(b.x - a.x, b.y - a.y) for a, b in pairwise(poses))]
    times = _times([point.time for point in shape.control_point])
    if times is None:
        return TrajectoryCurve(tuple(s), tuple(poses), None, closed, given, tangents=tangents)
    meters = 1 + int(polygon_length)
    # A control point whose basis function is zero at all samples of a long curve has no separate time
    peaks = [(number, time) for number, time in zip(curve.peaks(count), times, strict=True) if number is not None]
    stations = [math.floor((number + 1) / count * meters) / meters * count for number, _ in peaks]
    point_times = np.interp(np.arange(count + 1), stations, [time for _, time in peaks])
    return TrajectoryCurve(tuple(s), tuple(poses), tuple(point_times.tolist()), closed, given, tangents=tangents)


def specifies(position: model.Position, angle: Literal["h", "p", "r"]) -> bool:
    """True if a position specifies its heading `h`, its pitch `p` or its roll `r`."""
    frame = position.chosen()
    orientation = frame if isinstance(frame, model.WorldPosition) else getattr(frame, "orientation", None)
    return getattr(orientation, angle, None) is not None


def _times(point_times: Sequence[float | None]) -> tuple[float, ...] | None:
    given_times = [time for time in point_times if time is not None]
    return tuple(given_times) if len(given_times) == len(point_times) and given_times[-1] > given_times[0] else None
