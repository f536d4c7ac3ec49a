"""Trajectories compared with geometry."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest
from opendrive_xml import elevation_xml, lane_xml, map_xml, road_xml, section_xml
from processor_time import within_multiple

from eidrive_scenario.openscenario import model
from eidrive_scenario.roads import Pose, RoadNetwork
from eidrive_scenario.storyboard.kinematics.trajectory_sampling import sample_trajectory


def at(x: Any, y: Any, h: Any = None) -> Any:
    return model.Position(world_position=model.WorldPosition(x=x, y=y, h=h))


def resolve(position: Any) -> Any:
    frame = position.world_position
    return Pose(frame.x, frame.y, frame.z or 0.0, frame.h or 0.0, 0.0, 0.0)


def trajectory(closed: Any = False, **shape: Any) -> Any:
    return model.Trajectory(closed=closed, name="way", shape=model.Shape(**shape))


def polyline(*points: Any, closed: Any = False) -> Any:
    vertices = tuple(model.Vertex(time=time, position=at(x, y, h)) for x, y, time, h in points)
    return sample_trajectory(trajectory(closed, polyline=model.Polyline(vertex=vertices)), resolve)


@pytest.mark.element("Polyline")
def test_polyline_heading_turns_at_corners() -> None:
    way = polyline((0, 0, None, None), (3, 0, None, None), (3, 4, None, None))
    assert way.length == 7.0
    assert way.at(1.0)[:4] == pytest.approx((1.0, 0.0, 0.0, 0.0))
    assert way.at(5.0)[:4] == pytest.approx((3.0, 2.0, 0.0, math.pi / 2))
    assert way.times is None


def test_given_headings_are_interpolated_between_vertices() -> None:
    way = polyline((0, 0, None, 0.0), (10, 0, None, 1.0))
    assert way.at(5.0).h == pytest.approx(0.5)


def test_closed_polyline_returns_to_its_start() -> None:
    way = polyline((0, 0, None, None), (3, 0, None, None), (3, 4, None, None), closed=True)
    assert way.length == 12.0
    assert way.at(14.0)[:2] == pytest.approx((2.0, 0.0))


@pytest.mark.parametrize(
    ("point", "place"),
    [((1, 1), (1, 1)), ((2, 3), (6, 1)), ((4, 2), (5, -1)), ((-2, 1), (-2, 1)), ((2.5, 9), (12, 0.5))],
)
def test_point_is_projected_onto_the_nearest_position(point: tuple[float, float], place: tuple[float, float]) -> None:
    way = polyline((0, 0, None, None), (3, 0, None, None), (3, 4, None, None))
    assert way.project(*point) == pytest.approx(place)


@pytest.mark.parametrize("x", [-50, 40, 150])
def test_trajectory_of_one_segment_is_extended_at_both_ends(x: float) -> None:
    way = polyline((0, 0, None, 0.0), (100, 0, None, 0.0))
    assert way.project(x, 2) == pytest.approx((x, 2.0))
    assert way.track(x, 2, x) == pytest.approx(x)


def test_closed_polyline_is_not_extended() -> None:
    way = polyline((0, 0, None, None), (3, 0, None, None), (3, 4, None, None), closed=True)
    assert way.project(-1, 0)[0] in (0.0, pytest.approx(12.0))


@pytest.mark.element("Timing")
def test_times_at_vertices_are_kept_at_constant_speed_between() -> None:
    way = polyline((0, 0, 1.0, None), (10, 0, 3.0, None), (10, 30, 5.0, None))
    assert [way.at_time(t) for t in (0.0, 1.0, 2.0, 3.0, 4.0, 9.0)] == pytest.approx([0, 0, 5, 10, 25, 40])
    assert way.time_at(25.0) == pytest.approx(4.0)


def test_times_at_vertices_are_kept_with_linear_speeds() -> None:
    """From 10 m/s, 5 m in 1 s end at 0 m/s: after 0.5 s the distance is 3.75 m."""
    way = polyline((0, 0, 0.0, None), (5, 0, 1.0, None), (9, 0, 2.0, None))
    speeds = way.speeds_from(10.0)
    assert way.at_time(0.5, speeds) == pytest.approx(3.75)
    assert way.at_time(1.0, speeds) == pytest.approx(5.0)
    assert way.at_time(1.5, speeds) == pytest.approx(6.0)


@pytest.mark.element("Clothoid")
def test_clothoid_of_constant_curvature_is_an_arc() -> None:
    shape = model.Clothoid(curvature=0.1, length=5 * math.pi, curvature_prime=0.0, position=at(0, 0))
    way = sample_trajectory(trajectory(clothoid=shape), resolve)
    assert way.at(way.length)[:4] == pytest.approx((10.0, 10.0, 0.0, math.pi / 2), abs=1e-3)


@pytest.mark.element("Clothoid")
def test_clothoid_turns_by_its_mean_curvature() -> None:
    shape = model.Clothoid(
        curvature=0.0, length=20.0, curvature_prime=0.01, start_time=1.0, stop_time=3.0, position=at(0, 0)
    )
    way = sample_trajectory(trajectory(clothoid=shape), resolve)
    assert way.at(20.0).h == pytest.approx(0.5 * 0.01 * 400.0)
    assert way.at_time(2.0) == pytest.approx(10.0)


def test_closed_clothoid_returns_to_its_start_by_a_line() -> None:
    """The half circle of radius 10 m ends at (0, 20) in 10 s; the line of 20 m down is covered at its mean speed."""
    shape = model.Clothoid(
        length=10.0 * math.pi,
        curvature=0.1,
        curvature_prime=0.0,
        position=at(0, 0, 0.0),
        start_time=0.0,
        stop_time=10.0,
    )
    way = sample_trajectory(trajectory(True, clothoid=shape), resolve)
    assert way.length == pytest.approx(10.0 * math.pi + 20.0, abs=1e-3)
    assert way.at(10.0 * math.pi + 10.0)[:4] == pytest.approx((0.0, 10.0, 0.0, -math.pi / 2), abs=1e-3)
    assert way.at(-1.0)[:2] == pytest.approx((0.0, 1.0), abs=1e-3)
    assert way.tangent(10.0 * math.pi + 10.0) == pytest.approx(-math.pi / 2, abs=1e-4)
    assert way.times is not None
    assert way.times[-1] == pytest.approx(10.0 + 20.0 / math.pi, abs=1e-3)


@pytest.mark.element("ClothoidSpline")
def test_clothoid_spline_segments_are_continuous() -> None:
    pieces = (
        model.ClothoidSplineSegment(curvature_start=0.0, curvature_end=0.0, length=10.0, position_start=at(0, 0)),
        model.ClothoidSplineSegment(curvature_start=0.1, curvature_end=0.1, length=5 * math.pi),
    )
    way = sample_trajectory(trajectory(clothoid_spline=model.ClothoidSpline(clothoid_spline_segment=pieces)), resolve)
    assert way.length == pytest.approx(10.0 + 5 * math.pi)
    assert way.at(way.length)[:4] == pytest.approx((20.0, 10.0, 0.0, math.pi / 2), abs=1e-3)


@pytest.mark.element("ClothoidSpline")
def test_clothoid_spline_has_the_times_of_its_segments() -> None:
    """Segments of 10, 10 and 20 m: the first starts at 0 s by default, the second at 5 s, the end is at 11 s."""
    lengths = ((10.0, None), (10.0, 5.0), (20.0, None))
    pieces = tuple(
        model.ClothoidSplineSegment(curvature_start=0.0, curvature_end=0.0, length=length, time_start=time)
        for length, time in lengths
    )
    shape = model.ClothoidSpline(clothoid_spline_segment=pieces, time_end=11.0)
    way = sample_trajectory(trajectory(clothoid_spline=shape), resolve)
    assert way.times is not None
    assert (way.times[0], way.end_time) == (0.0, 11.0)
    assert [way.at_time(time) for time in (2.5, 5.0, 7.0, 11.0)] == pytest.approx([5.0, 10.0, 20.0, 40.0])
    without = sample_trajectory(trajectory(clothoid_spline=replace(shape, time_end=None)), resolve)
    assert without.times is None


@pytest.mark.element("Nurbs")
def test_rational_spline_is_an_exact_circle() -> None:
    """The quarter circle of Piegl and Tiller: weights 1, 1/√2, 1."""
    points = ((10, 0, 1.0), (10, 10, math.sqrt(0.5)), (0, 10, 1.0))
    shape = model.Nurbs(
        order=3,
        control_point=tuple(model.ControlPoint(weight=w, position=at(x, y)) for x, y, w in points),
        knot=tuple(model.Knot(value=value) for value in (0, 0, 0, 1, 1, 1)),
    )
    way = sample_trajectory(trajectory(nurbs=shape), resolve)
    assert way.length == pytest.approx(5 * math.pi, rel=1e-4)
    for share in (0.1, 0.37, 0.8):
        pose = way.at(share * way.length)
        assert math.hypot(pose.x, pose.y) == pytest.approx(10.0, abs=1e-3)


@pytest.mark.element("Nurbs")
def test_headings_of_control_points_define_headings_of_spline() -> None:
    """Half way the quadratic Bernstein polynomials are 1/4, 1/2, 1/4: 0.25 · 3.0 + 0.5 · 3.2 + 0.25 · 3.0 = 3.1 rad, as
    -3.083 is 3.2 less a whole turn."""
    points = ((0, 0, 3.0), (10, 0, 3.2 - 2 * math.pi), (20, 0, 3.0))
    shape = model.Nurbs(
        order=3,
        control_point=tuple(model.ControlPoint(position=at(x, y, h)) for x, y, h in points),
        knot=tuple(model.Knot(value=value) for value in (0, 0, 0, 1, 1, 1)),
    )
    way = sample_trajectory(trajectory(nurbs=shape), resolve)
    assert way.given
    assert way.at(10.0)[:4] == pytest.approx((10.0, 0.0, 0.0, 3.1), abs=1e-6)
    assert way.at(0.0).h == pytest.approx(3.0)


@pytest.mark.element("Nurbs")
def test_time_of_control_point_holds_at_peak_of_its_basis_function() -> None:
    """The peak of the second of three is at half of the parameter, in steps of 1 m of the control polygon."""
    points = ((0, 0, 0.0), (10, 0, 2.0), (20, 0, 6.0))
    shape = model.Nurbs(
        order=3,
        control_point=tuple(model.ControlPoint(position=at(x, y), time=t) for x, y, t in points),
        knot=tuple(model.Knot(value=value) for value in (0, 0, 0, 1, 1, 1)),
    )
    way = sample_trajectory(trajectory(nurbs=shape), resolve)
    assert way.at_time(2.0) == pytest.approx(10.0, abs=1.0)
    assert (way.at_time(0.0), way.at_time(6.0)) == pytest.approx((0.0, 20.0))


def test_spline_with_excess_equal_knots_ends_before_last_point() -> None:
    """Order 2: straight lines between the points at the knots 0, 1 and 2; the interval of the last point is empty."""
    shape = model.Nurbs(
        order=2,
        control_point=tuple(model.ControlPoint(position=at(x, 0)) for x in (0, 10, 20, 30)),
        knot=tuple(model.Knot(value=value) for value in (0, 0, 1, 2, 2, 2)),
    )
    way = sample_trajectory(trajectory(nurbs=shape), resolve)
    assert (way.at(0.0).x, way.at(5.0).x, way.at(way.length).x) == pytest.approx((0.0, 5.0, 20.0))


@pytest.mark.exhaustive
@pytest.mark.parametrize(("order", "spacing"), [(4, 1.0), (20, 0.05)])
def test_spline_of_many_points_is_sampled_in_linear_time(order: int, spacing: float) -> None:
    """With the knots 0, 1, 2, … point i is at the mean i + order / 2 of its inner knots: the curve is linear in its
    parameter, from (order - 1) to (points), and so is the time i of point i.

    The samples are 1 m and 0.1 m apart, so that some points of the second curve have no separate sample.
    """
    points = 20_000

    def sampled(count: int) -> Any:
        shape = model.Nurbs(
            order=order,
            control_point=tuple(model.ControlPoint(position=at(spacing * i, 0), time=float(i)) for i in range(count)),
            knot=tuple(model.Knot(value=float(value)) for value in range(count + order)),
        )
        return sample_trajectory(trajectory(nurbs=shape), resolve)

    way = within_multiple(8.0, lambda: sampled(points), part=lambda: sampled(points // 4))
    assert way.length == pytest.approx(spacing * (points - order + 1))
    assert way.at(0.0).x == pytest.approx(spacing * (order / 2 - 1))
    assert way.at_time(10_000.0) == pytest.approx(spacing * (10_000 - order / 2 + 1), abs=1.5)


def test_clothoid_spline_of_many_long_segments_has_bounded_samples() -> None:
    """400 straight segments of 100 m: 20,000 samples in total, and at most one more per segment and its start."""
    segment = model.ClothoidSplineSegment(curvature_start=0.0, curvature_end=0.0, length=100.0)
    way = sample_trajectory(
        trajectory(clothoid_spline=model.ClothoidSpline(clothoid_spline_segment=(segment,) * 400)), resolve
    )
    assert way.length == pytest.approx(40_000.0)
    assert len(way.s) <= 20_800


@pytest.mark.parametrize("closed", [False, True])
def test_track_stays_on_its_branch_where_a_trajectory_crosses_itself(closed: bool) -> None:
    """A figure of eight, driven 0.4 m beside its line."""
    count = 400
    eight = [(60.0 * math.sin(a), 30.0 * math.sin(2.0 * a)) for a in (math.tau * n / count for n in range(count))]
    way = polyline(*((x, y, None, None) for x, y in eight), closed=closed)
    s = 0.0
    for expected in (0.5 * n for n in range(int(2.0 * way.length) - 4)):
        pose, direction = way.at(expected), way.tangent(expected)
        s = way.track(pose.x - 0.4 * math.sin(direction), pose.y + 0.4 * math.cos(direction), s)
        assert s == pytest.approx(expected, abs=0.2)


def test_track_follows_a_teleported_actor_and_extends_open_trajectories() -> None:
    way = polyline((0, 0, None, None), (100, 0, None, None), (100, 100, None, None))
    assert way.track(101.0, 70.0, 5.0) == pytest.approx(170.0)
    assert way.track(-3.0, 1.0, 5.0) == pytest.approx(-3.0)
    assert way.track(100.0, 104.0, 199.0) == pytest.approx(204.0)
    around = polyline(
        (0, 0, None, None), (100, 0, None, None), (100, 100, None, None), (0, 100, None, None), closed=True
    )
    assert around.track(0.5, 2.0, 1.0) == pytest.approx(398.0)


def test_speed_at_a_time_is_the_mean_between_points() -> None:
    way = polyline((0, 0, 1.0, None), (30, 0, 4.0, None), (30, 0, 6.0, None), (70, 0, 8.0, None))
    assert [way.speed_at(time) for time in (0.5, 1.0, 3.9, 5.0, 7.0, 9.0)] == [0.0, 10.0, 10.0, 0.0, 20.0, 20.0]
    assert polyline((0, 0, None, None), (3, 0, None, None)).speed_at(1.0) == 0.0


SLOPE = math.atan(0.5)
"""Angle of a climb of 50 % [rad]."""


def posed(x: float, y: float, z: float, h: float | None = None, p: float | None = None) -> model.Position:
    return model.Position(world_position=model.WorldPosition(x=x, y=y, z=z, h=h, p=p))


def resolve_with_pitch(position: model.Position) -> Pose:
    frame = position.world_position
    assert frame is not None
    return Pose(frame.x, frame.y, frame.z or 0.0, frame.h or 0.0, frame.p or 0.0, 0.0)


def climbing(h: float | None = None, p: float | None = None) -> Any:
    """Return 20 m on the level, 40 m with a climb of 50 %, and 40 m on the level."""
    points = ((0.0, 0.0), (20.0, 0.0), (60.0, 20.0), (100.0, 20.0))
    vertices = tuple(model.Vertex(position=posed(x, 0.0, z, h, p)) for x, z in points)
    return sample_trajectory(trajectory(polyline=model.Polyline(vertex=vertices)), resolve_with_pitch)


@pytest.mark.element("Polyline")
def test_polyline_vertices_without_heading_have_the_tangent() -> None:
    """Only the last of four vertices has a heading: 1 rad from the tangent, to which it turns from 2 m after the third.

    With a heading at the first vertex along its line, the actor points along the line until 2 m before the corner.
    """
    way = polyline((0, 0, None, None), (10, 0, None, None), (10, 10, None, None), (10, 20, None, math.pi / 2 + 1.0))
    expected = {5.0: 0.0, 10.0: math.pi / 4, 15.0: math.pi / 2, 20.0: math.pi / 2, 26.0: math.pi / 2 + 0.5}
    assert {s: way.at(s).h for s in expected} == pytest.approx(expected)
    assert way.at(30.0).h == pytest.approx(math.pi / 2 + 1.0)
    corner = polyline((0, 0, None, 0.0), (10, 0, None, None), (10, 10, None, None))
    assert [corner.at(s).h for s in (4.0, 7.9, 9.0, 10.0)] == pytest.approx([0.0, 0.0, math.pi / 8, math.pi / 4])
    first = polyline((0, 0, None, math.pi / 2), (0, 20, None, None), (0, 40, None, None))
    assert [first.at(s).h for s in (0.0, 10.0, 20.0, 40.0)] == pytest.approx([math.pi / 2] * 4)


def test_repeated_vertex_keeps_the_tangent() -> None:
    way = polyline((0, 0, None, None), (0, 20, None, None), (0, 20, None, None), (0, 40, None, None))
    assert [way.at(s).h for s in (10.0, 19.0, 20.0, 21.0, 30.0)] == pytest.approx([math.pi / 2] * 5)


@pytest.mark.element("Polyline")
@pytest.mark.parametrize(
    ("h", "climb"),
    [(None, -SLOPE), (0.0, -SLOPE), (math.pi, SLOPE), (math.pi / 2, 0.0), (math.pi / 3, -math.atan(0.25))],
)
def test_pitch_of_polyline_is_its_slope_along_the_heading(h: float | None, climb: float) -> None:
    """Nose up is negative. The pitch changes linearly within 2 m before and after a vertex."""
    way = climbing(h)
    expected = {10.0: 0.0, 40.0: climb, 57.9: climb, 80.0: 0.0}
    assert {s: way.at(s).p for s in expected} == pytest.approx(expected, abs=1e-9)
    if h in (None, 0.0):
        assert [way.at(s).p for s in (20.0, 21.0, 60.0)] == pytest.approx([climb / 2, 0.75 * climb, climb / 2])
    assert way.at(40.0).z == pytest.approx(10.0)


def test_specified_pitch_of_polyline_is_kept() -> None:
    assert [climbing(p=0.1).at(s).p for s in (0.0, 20.0, 40.0, 90.0)] == pytest.approx([0.1] * 4)


@pytest.mark.parametrize(("roll", "expected"), [(0.1, 0.1), (None, -0.1)])
def test_roll_of_polyline_is_the_specified_one_or_that_of_its_surface(roll: float | None, expected: float) -> None:
    """The surface rises to the left of the x axis, which is to the right of a trajectory towards -x."""

    def on_bank(position: model.Position) -> Pose:
        frame = position.world_position
        assert frame is not None
        return Pose(frame.x, frame.y, 0.0, 0.0, 0.0, 0.1)

    places = (model.WorldPosition(x=x, y=0.0, r=roll) for x in (0.0, -20.0))
    vertices = tuple(model.Vertex(position=model.Position(world_position=place)) for place in places)
    way = sample_trajectory(trajectory(polyline=model.Polyline(vertex=vertices)), on_bank)
    assert way.at(10.0)[3:] == pytest.approx((math.pi, 0.0, expected))


def quarter_circle(*headings: float | None) -> Any:
    points = zip(((10, 0, 1.0), (10, 10, math.sqrt(0.5)), (0, 10, 1.0)), headings, strict=True)
    shape = model.Nurbs(
        order=3,
        control_point=tuple(model.ControlPoint(weight=w, position=at(x, y, h)) for (x, y, w), h in points),
        knot=tuple(model.Knot(value=value) for value in (0, 0, 0, 1, 1, 1)),
    )
    return sample_trajectory(trajectory(nurbs=shape), resolve)


@pytest.mark.element("Nurbs")
@pytest.mark.parametrize("deviation", [0.0, 0.4])
def test_control_points_without_heading_have_the_tangent(deviation: float) -> None:
    """Half way the first of three rational basis functions is 0.25 / (0.5 + 0.5 √0.5) = 0.2929."""
    way = quarter_circle(math.pi / 2 + deviation, None, None)
    length = way.length
    expected = {0.0: math.pi / 2 + deviation, 0.5 * length: 3 * math.pi / 4 + 0.2929 * deviation, length: math.pi}
    assert {s: way.at(s).h for s in expected} == pytest.approx(expected, abs=0.01)


@pytest.mark.element("Nurbs")
@pytest.mark.parametrize(("h", "pitch"), [(None, -SLOPE), (0.0, -SLOPE), (math.pi, SLOPE)])
def test_pitch_of_climbing_spline_is_its_slope(h: float | None, pitch: float) -> None:
    shape = model.Nurbs(
        order=3,
        control_point=tuple(model.ControlPoint(position=posed(2.0 * z, 0.0, z, h)) for z in (0.0, 5.0, 10.0)),
        knot=tuple(model.Knot(value=value) for value in (0, 0, 0, 1, 1, 1)),
    )
    way = sample_trajectory(trajectory(nurbs=shape), resolve_with_pitch)
    assert [way.at(s).p for s in (0.0, 7.0, 20.0)] == pytest.approx([pitch] * 3)
    assert way.at(10.0).z == pytest.approx(5.0)


@pytest.mark.element("Clothoid")
def test_clothoid_on_a_slope_stays_in_its_plane() -> None:
    """The start climbs 50 % towards +x. A half circle leads back down: beside the start it is as high as there."""
    start = posed(0.0, 0.0, 0.0, 0.0, -SLOPE)
    ahead = model.Clothoid(curvature=0.0, length=20.0, curvature_prime=0.0, position=start)
    straight = sample_trajectory(trajectory(clothoid=ahead), resolve_with_pitch)
    assert straight.at(20.0)[:5] == pytest.approx((20.0, 0.0, 10.0, 0.0, -SLOPE))
    turn = model.Clothoid(curvature=0.1, length=10.0 * math.pi, curvature_prime=0.0, position=start)
    around = sample_trajectory(trajectory(clothoid=turn), resolve_with_pitch)
    assert around.at(around.length)[:5] == pytest.approx((0.0, 20.0, 0.0, math.pi, SLOPE), abs=1e-2)
    assert around.at(0.5 * around.length)[:5] == pytest.approx((10.0, 10.0, 5.0, math.pi / 2, 0.0), abs=1e-2)


HILL = RoadNetwork.parse(map_xml(road_xml(length=200.0, profiles=elevation_xml(slope=0.1, curvature=-0.0005))))
"""Road along x with the height 0.1 x - 0.0005 x²: 0 at both ends, and 5 m at its crest at x = 100 m."""


def over_the_hill(z: float | None, p: float | None = None, h: float | None = None, **shape: Any) -> Any:
    """Sample a trajectory on the hill from x = 0 to 200 m with the height, pitch and heading of its positions."""
    ends = tuple(model.Position(world_position=model.WorldPosition(x=x, y=-1.75, z=z, p=p, h=h)) for x in (0.0, 200.0))
    vertices = tuple(model.Vertex(position=end) for end in ends)
    return sample_trajectory(
        trajectory(**shape or {"polyline": model.Polyline(vertex=vertices)}), resolve_with_pitch, roads=HILL
    )


def test_polyline_without_heights_is_on_the_road() -> None:
    way = over_the_hill(None)
    assert [way.at(s).z for s in (0.0, 50.0, 100.0, 150.0, 200.0)] == pytest.approx([0.0, 3.75, 5.0, 3.75, 0.0])
    assert [way.at(s).p for s in (50.0, 100.0, 150.0)] == pytest.approx([-math.atan(0.05), 0.0, math.atan(0.05)])
    assert over_the_hill(None, h=math.pi).at(50.0).p == pytest.approx(math.atan(0.05)), "it faces against the slope"


@pytest.mark.parametrize("heading", [None, 0.0])
def test_polyline_is_on_the_road_beside_lines_with_heights(heading: float | None) -> None:
    """Vertices at 0, 40, 100, 150 and 200 m; the third one is 8 m high, above the crest of 5 m."""
    places = ((0.0, None, 0.0), (40.0, None, 3.2), (100.0, 8.0, 8.0), (150.0, None, 3.75), (200.0, None, 0.0))
    height_at = {x: height for x, _, height in places}
    vertices = tuple(
        model.Vertex(position=model.Position(world_position=model.WorldPosition(x=x, y=-1.75, z=z, h=heading)))
        for x, z, _ in places
    )
    way = sample_trajectory(
        trajectory(polyline=model.Polyline(vertex=vertices)),
        lambda position: resolve_with_pitch(position)._replace(z=height_at[resolve(position).x]),
        roads=HILL,
    )
    expected = {0.0: 0.0, 20.0: 1.8, 40.0: 3.2, 70.0: 5.6, 100.0: 8.0, 125.0: 5.875, 175.0: 2.1875, 200.0: 0.0}
    assert {s: way.at(s).z for s in expected} == pytest.approx(expected)
    assert list(way.s) == sorted(way.s)


def test_specified_heights_and_pitches_are_kept_on_a_hill() -> None:
    assert over_the_hill(0.0).at(100.0).z == 0.0
    pitched = over_the_hill(None, p=0.2).at(50.0)
    assert (pitched.z, pitched.p) == pytest.approx((3.75, 0.2))


def test_curves_without_heights_are_on_the_road() -> None:
    knots = tuple(model.Knot(value=value) for value in (0.0, 0.0, 0.0, 1.0, 1.0, 1.0))
    points = tuple(model.ControlPoint(position=at(x, -1.75)) for x in (0.0, 100.0, 200.0))
    spline = over_the_hill(None, nurbs=model.Nurbs(order=3, knot=knots, control_point=points))
    straight = model.Clothoid(curvature=0.0, curvature_prime=0.0, length=200.0, position=at(0.0, -1.75, 0.0))
    for way in (spline, over_the_hill(None, clothoid=straight)):
        assert [way.at(s).z for s in (50.0, 100.0)] == pytest.approx([3.75, 5.0], abs=1e-3)


def test_polyline_across_a_road_leaves_and_enters_the_sidewalks() -> None:
    kerb = '<height sOffset="0" inner="0.12" outer="0.12"/>'
    sidewalks = [lane_xml(number, 2.0, kind="sidewalk", more=kerb) for number in (2, -2)]
    lanes = section_xml(sidewalks[0] + lane_xml(1), lane_xml(-1) + sidewalks[1])
    roads = RoadNetwork.parse(map_xml(road_xml(lanes=lanes)))
    ends = tuple(model.Vertex(position=at(50.0, y)) for y in (-4.5, 4.5))
    way = sample_trajectory(
        trajectory(polyline=model.Polyline(vertex=ends)),
        lambda position: resolve(position)._replace(z=0.12),
        roads=roads,
    )
    assert [way.at(s).z for s in (0.0, 2.0, 4.5, 7.0, 9.0)] == pytest.approx([0.12, 0.0, 0.0, 0.0, 0.12])


def test_polyline_stays_on_a_bridge() -> None:
    below = road_xml("2", x=100.0, y=-100.0, hdg=math.pi / 2, length=200.0)
    bridge = road_xml(length=200.0, profiles=elevation_xml(6.0))
    ends = tuple(model.Vertex(position=at(x, -1.75)) for x in (0.0, 200.0))
    way = sample_trajectory(
        trajectory(polyline=model.Polyline(vertex=ends)),
        lambda position: resolve(position)._replace(z=6.0),
        roads=RoadNetwork.parse(map_xml(bridge, below)),
    )
    assert {pose.z for pose in way.poses} == {6.0}
