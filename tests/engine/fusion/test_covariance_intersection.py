"""Late fusion by covariance intersection: fused objects of reports."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.extensions.registry import registry
from eidrive_scenario.fusion.covariance_intersection import (
    CovarianceIntersectionFusion,
    CovarianceIntersectionSettings,
)
from eidrive_scenario.fusion.method import Report
from eidrive_scenario.fusion.prediction import REPORT_LIFETIME
from eidrive_scenario.v2x.messages.message import StationState

Make = Callable[..., Report]
Fuse = Callable[..., Detections]
Place = tuple[float, float]


def test_covariance_intersection_is_registered_as_entry_point() -> None:
    assert registry("fusion").load("covariance_intersection") is CovarianceIntersectionFusion


def test_fuse_three_reports_of_one_car_returns_one_box(report: Make, fuse: Fuse) -> None:
    fused = fuse(
        [report(name, 1.0, [place]) for name, place in (("A", (10.0, 0.0)), ("B", (10.3, 0.2)), ("C", (10.0, -0.2)))],
        1.0,
    )
    assert len(fused) == 1
    assert fused.time == 1.0
    assert math.dist(fused.boxes[0, :2], (10.1, 0.0)) < 0.1
    np.testing.assert_allclose(fused.covariance[0], 0.04 * np.eye(2), rtol=0.02)
    assert fused.scores[0] == pytest.approx(1.0 - 0.1**3)


def test_fuse_single_current_report_is_unchanged(report: Make, fuse: Fuse) -> None:
    given = report("A", 1.0, [(10.0, 3.0)], yaw=0.7, velocity=(4.0, 1.0), kind="truck", size=(8.0, 2.5, 3.0))
    fused = fuse([given], 1.0)
    np.testing.assert_allclose(fused.boxes, given.detections.boxes, rtol=1e-14)
    np.testing.assert_allclose(fused.velocity, [[4.0, 1.0]])
    np.testing.assert_allclose(fused.covariance[0], 0.04 * np.eye(2), rtol=1e-12)
    assert fused.classes == ("truck",)
    assert fused.scores[0] == pytest.approx(0.9)
    assert np.isnan(fuse([report("A", 1.0, [(10.0, 3.0)])], 1.0).velocity).all()


def test_fuse_keeps_fast_velocity_beside_report_without_one(report: Make, fuse: Fuse) -> None:
    fast = report("A", 1.0, [(10.0, 3.0)], velocity=(60.0, 0.0))
    both = fuse([fast, report("B", 1.0, [(10.0, 3.0)])], 1.0)
    np.testing.assert_allclose(both.velocity, [[60.0, 0.0]], atol=1e-3)


@pytest.mark.parametrize(("height", "objects"), [(0.0, 1), (2.5, 1), (6.5, 2)])
def test_fuse_keeps_cars_on_and_below_a_bridge_separate(report: Make, fuse: Fuse, height: float, objects: int) -> None:
    """Errors of the height of a box by 2.5 m do not split a car."""
    below, above = report("A", 0.0, [(10.0, 0.0)]), report("B", 0.0, [(10.2, 0.1)])
    above.detections.boxes[:, 2] += height
    assert len(fuse([below, above], 0.0)) == objects
    assert len(fuse([above, below], 0.0)) == objects


def test_fuse_keeps_distant_cars_separate(report: Make, fuse: Fuse) -> None:
    places = [(10.0, 0.0), (10.0, 3.0), (30.0, 0.0)]
    fused = fuse([report("A", 0.0, places), report("B", 0.0, places[:2])], 0.0)
    np.testing.assert_allclose(sorted(fused.boxes[:, :2].tolist()), sorted(places), atol=1e-9)


def tracked(held: Report, variance: float) -> Report:
    """Return the report with the existence and the variance of the velocity [m²/s²] that a tracker states."""
    detections = replace(held.detections, existence=np.array([0.9]), velocity_variance=np.array([variance]))
    return replace(held, detections=detections)


def test_fuse_covariance_contains_the_stated_variance_of_the_velocity(report: Make, fuse: Fuse) -> None:
    """As above with P_v = 16: (0.04 + 16 · 0.09 + 6 · 0.009) m². Values below 0.5² m²/s² count as this."""
    for stated, variance in ((16.0, 16.0), (0.01, 0.25)):
        given = tracked(report("A", 0.0, [(0.0, 0.0)], velocity=(0.0, 0.0), tracks=(1,)), stated)
        expected = 0.04 + 0.09 * variance + 6.0 * 0.009
        np.testing.assert_allclose(fuse([given], 0.3).covariance[0], expected * np.eye(2), rtol=1e-9)


def test_fuse_prefers_the_velocity_of_a_settled_track(report: Make, fuse: Fuse) -> None:
    """A station that has just detected a car at 15 m/s states a velocity of 0 with a deviation of 10 m/s."""
    new = tracked(report("A", 0.0, [(0.0, 0.0)], velocity=(0.0, 0.0), tracks=(1,)), 100.0)
    settled = tracked(report("B", 0.0, [(0.0, 0.1)], velocity=(15.0, 0.0), tracks=(1,)), 0.25)
    fused = fuse([new, settled], 0.0)
    assert len(fused) == 1
    np.testing.assert_allclose(fused.velocity, [[15.0, 0.0]], atol=0.5)


@pytest.mark.parametrize(("variance", "lifetime"), [(0.0, REPORT_LIFETIME), (16.0, 1.168), (144.0, 0.415)])
def test_tracks_of_uncertain_velocity_end_early(variance: float, lifetime: float, report: Make, fuse: Fuse) -> None:
    """5 m in 2.28 s for a known velocity. v² t² + 2 t³ = 25 m² has the roots 1.168 s and 0.415 s for 4 and 12 m/s."""
    given = tracked(report("A", 0.0, [(0.0, 0.0)], velocity=(0.0, 0.0), tracks=(1,), complete=False), variance)
    assert [len(fuse([given], lifetime + late)) for late in (-0.01, 0.01)] == [1, 0]


def test_fuse_accepts_variances_in_one_of_two_incomplete_reports(report: Make, fuse: Fuse) -> None:
    """A custom tracker may state none at times. Such an object has the usual 0.25 m²/s²: (0.04 + 0.0225 + 0.054) m²."""
    usual, stated = (
        report("A", 0.0, [(20.0 * number, 0.0)], velocity=(0.0, 0.0), tracks=(number,), complete=False)
        for number in (1, 2)
    )
    fused = fuse([usual, tracked(stated, 16.0)], 0.3)
    expected = [0.04 + 0.09 * variance + 6.0 * 0.009 for variance in (0.25, 16.0)]
    np.testing.assert_allclose(np.sort(fused.covariance[:, 0, 0]), expected, rtol=1e-9)


@pytest.mark.parametrize("observed", [False, True])
def test_fuse_keeps_senders_that_report_themselves_separate(observed: bool, report: Make, fuse: Fuse) -> None:
    """Two cars in neighboring lanes, whose reports are 1.5 s old, are within the gate; a third station sees both."""
    places = {"A": (10.0, 0.0), "B": (10.5, 3.0)}
    unnamed = [report(name, 0.0, [place], velocity=(0.0, 0.0)) for name, place in places.items()]
    reports = [replace(one, describes_sender=True) for one in unnamed]
    reports += [report("C", 1.5, list(places.values()), velocity=(0.0, 0.0))] * observed
    for order in (reports, reports[::-1]):
        fused = fuse(order, 1.5)
        np.testing.assert_allclose(sorted(fused.boxes[:, :2].tolist()), sorted(places.values()), atol=1e-6)
    assert len(fuse(unnamed, 1.5)) == 1


def test_fuse_gate_is_chi_square_with_wider_gate_for_unassigned_tracks(report: Make, fuse: Fuse) -> None:
    """With 0.5 m each, the offset has a deviation of 0.707 m: 3.03 deviations are 2.15 m, 5.26 are 3.72 m."""

    def pair(*places: Place) -> Detections:
        return fuse([report("A", 0, [(0, 0)], covariance=0.25), report("B", 0, places, covariance=0.25)], 0)

    assert len(pair((2.1, 0.0))) == 1
    assert len(pair((3.6, 0.0))) == 1, "no other candidate exists"
    assert len(pair((3.8, 0.0))) == 2
    both = pair((2.0, 0.0), (-3.0, 0.0))
    assert sorted(np.round(both.boxes[:, 0], 6).tolist()) == [-3.0, 1.0], "the pair within the gate is preferred"


@pytest.mark.parametrize(("age", "seen"), [(0.0, 4), (0.5, 4), (1.0, 2), (1.0, 4), (1.0, 7)])
def test_fuse_keeps_the_places_of_a_row_seen_in_parts(age: float, seen: int, report: Make, fuse: Fuse) -> None:
    """Cars stand 6 m apart, and each of two stations omits one end. After 1 s the variances are 0.01 + 0.25 + 2 m², so
    that a shifted pair is within the gate, and the shift has one more pair."""
    cars = [(6.0 * number, 0.0) for number in range(seen + 1)]
    parts = [
        report(name, 0.0, part, velocity=(0.0, 0.0), covariance=0.01)
        for name, part in (("A", cars[:-1]), ("B", cars[1:]))
    ]
    fused = fuse(parts, age)
    np.testing.assert_allclose(sorted(fused.boxes[:, 0]), [x for x, _ in cars], atol=1e-6)


def test_fuse_without_covariance_uses_the_distance_gate(report: Make, fuse: Fuse) -> None:
    near, far = report("B", 0, [(3.9, 0.0)]), report("B", 0, [(4.1, 0.0)])
    vague = report("A", 0, [(0.0, 0.0)], covariance=math.nan)
    assert len(fuse([vague, near], 0)) == 1
    assert len(fuse([vague, far], 0)) == 2


def test_fuse_overlapping_bodies_with_small_covariance_returns_one_box(report: Make, fuse: Fuse) -> None:
    sure = [report(name, 0, [(x, 0.0)], covariance=1e-8) for name, x in (("A", 0.0), ("B", 0.8))]
    assert len(fuse(sure, 0)) == 1


def test_fuse_weights_size_by_score_and_class_by_votes(report: Make, fuse: Fuse) -> None:
    reports = [
        report("A", 0, [(0, 0)], size=(4.0, 1.8, 1.5), score=0.9, kind="car"),
        report("B", 0, [(0, 0)], size=(5.0, 1.8, 1.5), score=0.3, kind="van"),
        report("C", 0, [(0, 0)], size=(5.0, 1.8, 1.5), score=0.3, kind="van"),
    ]
    fused = fuse(reports, 0)
    assert fused.boxes[0, 3] == pytest.approx((0.9 * 4.0 + 0.6 * 5.0) / 1.5)
    assert fused.classes == ("car",)
    assert fuse([*reports, report("D", 0, [(0, 0)], score=0.5, kind="van")], 0).classes == ("van",)


@pytest.mark.parametrize("tracked", [True, False])
def test_fuse_late_report_prediction_halves_the_error(tracked: bool, report: Make, fuse: Fuse) -> None:
    """A car at 15 m/s brakes with 5 m/s², and reports are 0.3 s late: error 4.3 m unpredicted, 0.225 m predicted."""

    def place(time: float) -> float:
        return 15.0 * time - 2.5 * time**2

    times = np.arange(0.0, 0.701, 0.05)
    reports = [
        report(
            "RSU",
            time,
            [(place(time), 0.0)],
            velocity=(15.0 - 5.0 * time, 0.0) if tracked else (math.nan, math.nan),
            covariance=0.01,
            arrived=time + 0.3,
        )
        for time in times.tolist()
    ]
    fused = fuse(reports, 1.0)
    without = registry("fusion").load("average")().fuse(reports[-1:], 1.0)
    error, stale = abs(fused.boxes[0, 0] - place(1.0)), abs(without.boxes[0, 0] - place(1.0))
    assert stale == pytest.approx(place(1.0) - place(0.7))
    assert error < 0.5 * stale
    if tracked:
        assert error == pytest.approx(0.5 * 5.0 * 0.3**2, abs=1e-6)
    assert error < 3.0 * math.sqrt(fused.covariance[0, 0, 0]), "the covariance includes the error"


def test_fuse_predicts_turning_car_along_the_arc(report: Make, fuse: Fuse) -> None:
    """At 8 m/s and 10 m radius, a straight prediction by 0.3 s has an error of 0.29 m, the arc a few centimeters."""
    reports = []
    for time in np.arange(0.0, 1.001, 0.05).tolist():
        angle = 0.8 * time
        at = (10.0 * math.sin(angle), 10.0 - 10.0 * math.cos(angle))
        velocity = (8.0 * math.cos(angle), 8.0 * math.sin(angle))
        reports.append(report("RSU", time, [at], yaw=angle, velocity=velocity, arrived=time + 0.3))
    fused = fuse(reports, 1.3)
    truth = (10.0 * math.sin(1.04), 10.0 - 10.0 * math.cos(1.04))
    straight = (at[0] + 0.3 * velocity[0], at[1] + 0.3 * velocity[1])
    assert math.dist(fused.boxes[0, :2], truth) < 0.2 * math.dist(straight, truth)
    assert fused.boxes[0, 6] == pytest.approx(1.04, abs=0.03)
    np.testing.assert_allclose(fused.velocity[0], [8.0 * math.cos(1.04), 8.0 * math.sin(1.04)], atol=0.3)


def test_fuse_predicts_no_turn_that_tires_do_not_allow(report: Make, fuse: Fuse) -> None:
    """Boxes of a car at 12 m/s turn by 3.5 rad/s, which would be 42 m/s² across; its velocity does not turn."""
    times = np.arange(0.0, 0.301, 0.05).tolist()
    reports = [report("A", t, [(12.0 * t, 0.0)], yaw=3.5 * t, velocity=(12.0, 0.0)) for t in times]
    np.testing.assert_allclose(fuse(reports, 0.7).boxes[0, :2], (12.0 * 0.7, 0.0), atol=1e-6)


def test_fuse_covariance_grows_with_the_age_of_the_report(report: Make, fuse: Fuse) -> None:
    """Closed form P + T² P_v + q T³/3: (0.04 + 0.09 · 0.25 + 6 · 0.009) m²."""
    fused = fuse([report("A", 0.0, [(0.0, 0.0)], velocity=(10.0, 0.0))], 0.3)
    assert fused.boxes[0, 0] == pytest.approx(3.0)
    np.testing.assert_allclose(fused.covariance[0], (0.04 + 0.09 * 0.25 + 6.0 * 0.009) * np.eye(2), rtol=1e-9)


def test_velocities_with_a_deviation_are_measurements_of_the_filter(report: Make, fuse: Fuse) -> None:
    """Two scans with errors of 0.2 m and 1.5 m/s, in the information form of the filter along one axis."""
    step, measured = 0.1, [np.array([0.0, 11.0]), np.array([1.2, 8.0])]
    noise, forward = np.diag([0.04, 1.5**2]), np.array([[1.0, step], [0.0, 1.0]])
    process = 6.0 * np.array([[step**3 / 3.0, step**2 / 2.0], [step**2 / 2.0, step]])
    information = np.linalg.inv(forward @ noise @ forward.T + process)
    covariance = np.linalg.inv(information + np.linalg.inv(noise))
    state = covariance @ (information @ forward @ measured[0] + np.linalg.inv(noise) @ measured[1])

    scans = [
        report("A", number * step, [(x, 0.0)], velocity=(vx, 0.0), velocity_deviation=1.5)
        for number, (x, vx) in enumerate(measured)
    ]
    fused = fuse(scans, step)
    np.testing.assert_allclose([fused.boxes[0, 0], fused.velocity[0, 0]], state, rtol=1e-9)
    assert fused.covariance[0, 0, 0] == pytest.approx(covariance[0, 0])
    filtered = report("A", step, [(1.2, 0.0)], velocity=(8.0, 0.0))
    assert fuse([scans[0], filtered], step).velocity[0].tolist() == [8.0, 0.0]


def test_fuse_weights_the_newer_report_more(report: Make, fuse: Fuse) -> None:
    fused = fuse(
        [
            report("A", 0.0, [(0.0, 0.0)], velocity=(10.0, 0.0), arrived=0.5),
            report("B", 0.5, [(5.4, 0.0)], velocity=(10.0, 0.0)),
        ],
        0.5,
    )
    assert len(fused) == 1
    assert 5.35 < fused.boxes[0, 0] < 5.4


def test_fuse_confirms_uncertain_objects_by_a_second_report(report: Make, fuse: Fuse) -> None:
    """One report of low score is tentative; a second one of the same or another station confirms the object."""

    def ghost(station: str, time: float) -> Report:
        return report(station, time, [(10.0, 0.0)], score=0.3)

    assert len(fuse([ghost("A", 0.0)], 0.0)) == 0
    assert len(fuse([ghost("A", 0.0), ghost("A", 0.05)], 0.05)) == 1
    assert len(fuse([ghost("A", 0.0), ghost("B", 0.0)], 0.0)) == 1
    assert len(fuse([ghost("A", 0.0), report("A", 0.05, []), ghost("A", 0.1)], 0.1)) == 0


def test_fuse_removes_objects_after_missed_detections(report: Make) -> None:
    fusion = CovarianceIntersectionFusion()
    counts = []
    for tick in range(8):
        received = report("A", 0.05 * tick, [(10.0, 0.0)] if tick < 4 else [])
        fusion.add_report(received)
        counts.append(len(fusion.fuse([received], 0.05 * tick)))
    assert counts[:4] == [1] * 4
    assert counts[-1] == 0
    assert counts == sorted(counts, reverse=True)


def test_fuse_removes_objects_that_a_tracking_station_dropped(report: Make, fuse: Fuse) -> None:
    both = report("A", 0.0, [(10.0, 0.0), (20.0, 0.0)], tracks=(1, 2), score=0.999)
    rest = report("A", 0.05, [(20.0, 0.0)], tracks=(2,), score=0.999)
    assert len(fuse([both, rest], 0.05)) == 1
    assert len(fuse([both, rest, report("A", 0.1, [])], 0.1)) == 0, "no object is left"


def test_fuse_keeps_objects_omitted_in_incomplete_reports(report: Make, fuse: Fuse) -> None:
    both = report("A", 0.0, [(10.0, 0.0), (20.0, 0.0)], tracks=(1, 2))
    rest = [report("A", 0.05 * tick, [(20.0, 0.0)], tracks=(2,), complete=False) for tick in range(1, 8)]
    assert len(fuse([both, *rest], 0.35)) == 2
    later = [report("A", 0.05 * tick, [(20.0, 0.0)], tracks=(2,), complete=False) for tick in range(8, 47)]
    assert len(fuse([both, *rest, *later], 2.3)) == 1, "the track is deleted after 2.28 s"


def test_fuse_associates_reports_by_object_id(report: Make, fuse: Fuse) -> None:
    one, two = (report("A", time, [(x, 0.0)], tracks=(7,), covariance=0.01) for time, x in ((0.0, 0.0), (0.1, 9.0)))
    tracked = [replace(held, detections=replace(held.detections, existence=np.full(1, 0.9))) for held in (one, two)]
    assert len(fuse(tracked, 0.1)) == 1


def test_fuse_deletes_tracks_after_the_maximum_age(report: Make, fuse: Fuse) -> None:
    seen = report("A", 0.0, [(10.0, 0.0)], velocity=(1.0, 0.0))
    assert len(fuse([seen], 2.27)) == 1
    assert len(fuse([seen], 2.29)) == 0
    brief = CovarianceIntersectionFusion(CovarianceIntersectionSettings(max_age=0.2))
    assert len(fuse([seen], 0.25, brief)) == 0
    assert len(CovarianceIntersectionFusion().fuse([], 1.0)) == 0


@pytest.mark.parametrize(("first", "later"), [(2.0, 3.0), (2.3, 33 * 0.1)])
def test_update_of_a_track_at_the_maximum_age_gives_its_velocity(
    first: float, later: float, report: Make, fuse: Fuse
) -> None:
    """The car moves by 5 m in 1 s, which rounding of the times exceeds in one case."""
    brief = CovarianceIntersectionFusion(CovarianceIntersectionSettings(max_age=1.0))
    fuse([report("A", first, [(0.0, 0.0)])], first, brief)
    fused = fuse([report("A", later, [(5.0, 0.0)])], later, brief)
    np.testing.assert_allclose(fused.velocity, [[5.0, 0.0]], atol=0.1)


def test_fuse_adds_the_pose_covariance_of_the_sender(report: Make, fuse: Fuse) -> None:
    """One degree at 80 m is 1.4 m across; along the ray only the position uncertainty counts."""
    pose = np.diag([0.04, 0.09, math.radians(1.0) ** 2])
    state = StationState(0.0, 20.0, 5.0, 0.0, 0.0, 0.0, pose)
    fused = fuse([report("A", 0.0, [(100.0, 5.0)], covariance=0.01, state=state)], 0.0)
    expected = np.diag([0.01 + 0.04, 0.01 + 0.09 + (80.0 * math.radians(1.0)) ** 2])
    np.testing.assert_allclose(fused.covariance[0], expected, rtol=1e-9)
    many = [report("A", 0.05 * tick, [(100.0, 5.0)], covariance=0.01, state=state) for tick in range(40)]
    assert fuse(many, 1.95).covariance[0, 1, 1] > (80.0 * math.radians(1.0)) ** 2, "repeated reports do not reduce it"


def test_fuse_omits_invalid_boxes(report: Make, fuse: Fuse) -> None:
    broken = report("A", 0.0, [(math.nan, 0.0), (10.0, 0.0), (math.inf, 1.0)])
    assert fuse([broken], 0.0).boxes[:, 0].tolist() == [10.0]
    assert len(fuse([report("A", 0.0, [(1.0, 1.0)], size=(0.0, 1.0, 1.0))], 0.0)) == 0


def test_fuse_predicts_report_of_a_fast_clock_backwards(report: Make, fuse: Fuse) -> None:
    """The clock of the sender is 20 ms fast."""
    fused = fuse([report("A", 1.02, [(10.2, 0.0)], velocity=(10.0, 0.0))], 1.0)
    assert fused.boxes[0, 0] == pytest.approx(10.0)
    assert fused.covariance[0, 0, 0] > 0.04


CARS = st.lists(st.tuples(st.floats(-60, 60), st.floats(-60, 60)), max_size=4)


@settings(max_examples=40, deadline=None)
@given(a=CARS, b=CARS, c=CARS)
def test_fuse_is_independent_of_the_order_of_stations(
    report: Make, fuse: Fuse, a: list[Place], b: list[Place], c: list[Place]
) -> None:
    reports = [report(name, 0.0, places) for name, places in (("A", a), ("B", b), ("C", c))]
    first = fuse(reports, 0.1)
    assert max(len(a), len(b), len(c)) <= len(first) <= len(a) + len(b) + len(c)
    for order in permutations(reports):
        other = fuse(order, 0.1)
        np.testing.assert_array_equal(first.boxes, other.boxes)
        np.testing.assert_array_equal(first.covariance, other.covariance)
        assert first.classes == other.classes


def scene(report: Make, turn: float, dx: float, dy: float, mirror: float) -> list[Report]:
    """Return reports of two stations on three cars over half a second, in a transformed world."""
    rotation = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]]) @ np.diag([1.0, mirror])
    rng = np.random.default_rng(5)
    starts, velocity = (
        np.array([[0.0, 0.0], [20.0, 4.0], [8.0, -12.0]]),
        np.array([[9.0, 1.0], [-6.0, 0.0], [0.0, 4.0]]),
    )
    yaws = np.arctan2(velocity[:, 1], velocity[:, 0])
    spread = np.array([[0.09, 0.02], [0.02, 0.04]])
    reports = []
    for tick in range(11):
        for station, late in (("A", 0.0), ("B", 0.2)):
            places = starts + 0.05 * tick * velocity + rng.normal(size=(3, 2)) * 0.15
            reports.append(
                report(
                    station,
                    0.05 * tick,
                    places @ rotation.T + (dx, dy),
                    yaw=np.arctan2(*(rotation @ np.array([np.cos(yaws), np.sin(yaws)]))[::-1]),
                    velocity=velocity @ rotation.T if station == "A" else (math.nan, math.nan),
                    covariance=rotation @ spread @ rotation.T,
                    arrived=0.05 * tick + late,
                )
            )
    return reports


@settings(max_examples=30, deadline=None)
@given(turn=st.floats(-3, 3), dx=st.floats(-50, 50), dy=st.floats(-50, 50), mirror=st.sampled_from([1.0, -1.0]))
def test_fuse_is_equivariant_under_rotation_translation_and_mirroring(
    report: Make, fuse: Fuse, turn: float, dx: float, dy: float, mirror: float
) -> None:
    rotation = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]]) @ np.diag([1.0, mirror])
    plain = fuse(scene(report, 0.0, 0.0, 0.0, 1.0), 0.7)
    other = fuse(scene(report, turn, dx, dy, mirror), 0.7)
    assert len(plain) == 3
    np.testing.assert_allclose(other.boxes[:, :2], plain.boxes[:, :2] @ rotation.T + (dx, dy), atol=1e-7)
    np.testing.assert_allclose(other.velocity, plain.velocity @ rotation.T, atol=1e-7)
    np.testing.assert_allclose(other.covariance, rotation @ plain.covariance @ rotation.T, atol=1e-7)
    np.testing.assert_allclose(np.cos(other.boxes[:, 6] - turn - mirror * plain.boxes[:, 6]), 1.0, atol=1e-7)
    np.testing.assert_allclose(other.boxes[:, 2:6], plain.boxes[:, 2:6], atol=1e-9)


def test_fuse_with_tied_assignments_is_independent_of_the_order(report: Make, fuse: Fuse) -> None:
    """Each car of B has the same distance from both cars of A."""
    a = report("A", 0.0, [(0.0, 1.0), (0.0, -1.0)], covariance=1.0)
    b = report("B", 0.0, [(1.0, 0.0), (-1.0, 0.0)], covariance=1.0)
    first, second = fuse([a, b], 0.0), fuse([b, a], 0.0)
    assert len(first) == 2
    np.testing.assert_array_equal(first.boxes, second.boxes)


def test_own_detections_keep_their_object_when_the_pose_error_changes(report: Make, fuse: Fuse) -> None:
    """A car stands 60 m ahead, and the pose error of the station is drawn in each tick: 0.6 m and 1°, that is 1.05 m to
    the side there. The detector is exact to 0.05 m, so that without the change of the pose each tick would show another
    car. Its variance is twice that of the error, and the fused position is that of the newest detection."""
    random = np.random.default_rng(2)
    errors = np.array([0.6, 0.6, math.radians(1.0)])
    change = 2.0 * np.diag(errors**2)
    method = CovarianceIntersectionFusion()
    for tick in range(100):
        x, y, yaw = random.normal(0.0, errors).tolist()
        place = (60.0 * math.cos(yaw) + x, 60.0 * math.sin(yaw) + y)
        own = report("Ego", 0.05 * tick, [place], velocity=(0.0, 0.0), covariance=0.0025)
        own = replace(own, state=StationState(0.05 * tick, x, y, 0.0, yaw, 0.0), pose_change=change)
        fused = fuse([own], 0.05 * tick, method)
        assert len(fused) == 1
        assert fused.boxes[0, :2] == pytest.approx(place)
