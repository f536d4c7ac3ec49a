"""Tracker: association, track management, velocities, and consistency of the filters."""

from __future__ import annotations

import math
from functools import partial
from itertools import count
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace
from scipy.stats import chi2

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.perception.detector import without_duplicates
from eidrive_scenario.perception.tracking.method import TrackerSettings
from eidrive_scenario.perception.tracking.motion_models import ACCELERATION_DENSITY, TURN_DENSITY
from eidrive_scenario.perception.tracking.tracker import Tracker

DT = 0.1


def cars(time: float, *places: tuple[float, ...], deviation: float = 0.1, names: tuple[str, ...] = ()) -> Detections:
    """Return cars at x, y and, optionally, a yaw."""
    number = len(places)
    boxes = np.array([(x, y, 0.75, 4.6, 1.8, 1.5, *(yaw or (0.0,))) for x, y, *yaw in places]).reshape(number, 7)
    return Detections(
        time,
        boxes,
        np.full(number, 0.8),
        names or ("car",) * number,
        np.full((number, 2), np.nan),
        np.tile(deviation**2 * np.eye(2), (number, 1, 1)),
    )


def squared_error(held: Detections, speed: float) -> float:
    """Return half the squared error of the velocity of a car that drives along the x axis."""
    return float(np.square(held.velocity[0] - (speed, 0.0)).sum()) / 2.0


def tracker(kind: Any = "cv", **settings: Any) -> Tracker:
    return Tracker(TrackerSettings(kind=kind, **settings))


def test_track_is_confirmed_after_n_of_m_detections() -> None:
    """2 of 3: detected, missed, detected is sufficient; once in three scans is not."""
    track = tracker(confirm=(2, 3))
    assert len(track.update(cars(0.0, (0, 0)))) == 0
    assert len(track.update(cars(0.1))) == 0
    assert len(track.update(cars(0.2, (0, 0)))) == 1
    track = tracker(confirm=(2, 3))
    reported = [len(track.update(cars(t * DT, *([(0, 0)] if t % 3 == 0 else [])))) for t in range(12)]
    assert reported == [0] * 12


def test_track_with_confirm_one_of_one_is_reported_at_once() -> None:
    assert len(tracker(confirm=(1, 1)).update(cars(0.0, (0, 0)))) == 1


@pytest.mark.parametrize("kind", ["cv", "ctrv"])
def test_coasting_track_out_of_view_keeps_existence_until_coast_ends(kind: str) -> None:
    """10 m/s eastwards, last detected at 2.0 s, then out of view: half a second later it is 5 m ahead, then it is
    deleted.

    Its existence falls by survival alone, exp(-t / 10 s), and so does its score.
    """
    track = tracker(kind, coast=0.5)
    for tick in range(21):
        confirmed = track.update(cars(tick * DT, (tick * 1.0, 0.0)))
    assert confirmed.scores.tolist() == pytest.approx([0.8], abs=1e-4)
    places, spread, existence = [], [], []
    for tick in range(21, 26):
        confirmed = track.update(cars(tick * DT), lambda boxes: np.zeros(len(boxes)))
        existence.append(float(confirmed.existence[0]))
        places.append(float(confirmed.boxes[0, 0]))
        spread.append(float(confirmed.covariance[0, 0, 0]))
        assert confirmed.scores[0] == pytest.approx(0.8 * confirmed.existence[0])
    np.testing.assert_allclose(places, [21, 22, 23, 24, 25], atol=0.3)
    np.testing.assert_allclose(existence, np.exp(-0.01 * np.arange(1, 6)), atol=1e-4)
    assert spread == sorted(spread)
    assert len(track.update(cars(2.6), lambda boxes: np.zeros(len(boxes)))) == 0


def test_missed_track_in_view_follows_bernoulli_recursion_until_deleted() -> None:
    """Survival 0.99 per scan, detection 0.9: r' = 0.1 r / (1 - 0.9 r), by hand from r = 1: 0.908, 0.473, 0.081, 0.0086.

    (0.99 (1 - 0.9)) / (1 - 0.99 * 0.9) = 0.0990 / 0.109 = 0.908; the last one is below 0.05.
    """
    track = tracker(lifetime=-0.1 / math.log(0.99))
    for tick in range(30):
        track.update(cars(tick * DT, (0.0, 0.0)))
    existence = []
    for tick in range(30, 33):
        existence += track.update(cars(tick * DT)).existence.tolist()
    np.testing.assert_allclose(existence, [0.9083, 0.4716, 0.0805], atol=2e-3)
    assert len(track.update(cars(33 * DT))) == 0


def constant_share(share: float, boxes: np.ndarray) -> np.ndarray:
    return np.full(len(boxes), share)


def test_track_half_in_view_loses_less_existence() -> None:
    existence = []
    for share in (0.0, 0.5, 1.0):
        track = tracker()
        for tick in range(10):
            track.update(cars(tick * DT, (0.0, 0.0)))
        seen = partial(constant_share, share)
        existence.append(float(track.update(cars(1.0), seen).existence[0]))
    assert existence[0] > existence[1] > existence[2] > 0.5


@pytest.mark.parametrize(("every", "reported"), [(4, 0.2), (12, None)])
def test_only_scans_that_can_show_an_object_count_for_confirmation(every: int, reported: float | None) -> None:
    """Of the scans at 20 Hz, those of a slower sensor show a car, and the others cannot.

    Two detections in two scans at 5 Hz confirm it. At 1.67 Hz a detection is over after 0.5 s (`coast`).
    """
    track, first = tracker(), None
    for tick in range(60):
        shows = tick % every == 0
        confirmed = track.update(
            cars(tick * 0.05, *([(20, 0)] if shows else [])), partial(constant_share, float(shows))
        )
        first = tick * 0.05 if len(confirmed) and first is None else first
    assert first == (reported and pytest.approx(reported))


def test_existence_below_confirmation_is_not_reported() -> None:
    """Two detections of confidence 0.02 at a distance of 1.5 m are not reported; two of 0.8 are."""
    for score, reported in ((0.02, 0), (0.8, 1)):
        track = tracker(confirm_existence=0.9)
        first, second = cars(0.0, (0.0, 0.0)), cars(DT, (1.5, 0.0))
        track.update(replace(first, scores=np.array([score])))
        assert len(track.update(replace(second, scores=np.array([score])))) == reported


def test_predict_leaves_tracker_unchanged() -> None:
    track, other = tracker(), tracker()
    for tick in range(20):
        track.update(cars(tick * DT, (tick * 1.0, 0.0)))
        other.update(cars(tick * DT, (tick * 1.0, 0.0)))
    later = track.predict(1.95)
    assert later is not None
    assert later.time == 1.95
    assert float(later.boxes[0, 0]) == pytest.approx(19.5, abs=0.1)
    assert later.tracks == (1,)
    one, same = track.update(cars(2.0, (20.0, 0.0))), other.update(cars(2.0, (20.0, 0.0)))
    np.testing.assert_array_equal(one.boxes, same.boxes)
    np.testing.assert_array_equal(one.existence, same.existence)
    assert track.predict(1.9) is None
    assert track.predict(2.51) is None
    assert tracker().predict(0.0) is None


def test_track_numbers_persist_when_objects_pass() -> None:
    """Two cars pass at a distance of 3 m in opposite directions; their order in the list changes at every tick."""
    track = tracker()
    side_of: dict[int, float] = {}
    for tick in range(60):
        east, west = (-15.0 + tick * 0.5, 0.0), (15.0 - tick * 0.5, 3.0)
        confirmed = track.update(cars(tick * DT, *((east, west) if tick % 2 else (west, east))))
        if tick > 2:
            sides = dict(zip(confirmed.tracks, confirmed.boxes[:, 1].tolist(), strict=True))
            side_of = side_of or sides
            assert sides == {number: pytest.approx(side, abs=0.5) for number, side in side_of.items()}
    assert len(side_of) == 2


def test_association_minimizes_total_cost() -> None:
    """Tracks at 0 and 2.4, boxes at 2.2 and 4.0: greedy assignment would pair (2.4, 2.2) and leave (0, 4.0)."""
    track = tracker(confirm=(1, 1))
    track.update(cars(0.0, (0.0, 0.0), (2.4, 0.0), deviation=1.0))
    confirmed = track.update(cars(DT, (4.0, 0.0), (2.2, 0.0), deviation=1.0))
    assert sorted(confirmed.tracks) == [1, 2]
    assert dict(zip(confirmed.tracks, (confirmed.boxes[:, 0] > 2.3).tolist(), strict=True)) == {1: False, 2: True}


def test_box_outside_gate_initiates_track() -> None:
    """0.3 m is within the gate of a stationary object with 0.1 m of noise; 10 m is a new object."""
    track = tracker(confirm=(1, 1))
    for tick in range(20):
        track.update(cars(tick * DT, (0.0, 0.0)))
    assert track.update(cars(2.0, (0.3, 0.0))).tracks == (1,)
    assert track.update(cars(2.1, (10.0, 0.0))).tracks == (1, 2)


@pytest.mark.parametrize("kind", ["cv", "ctrv"])
def test_velocity_and_heading_are_estimated_from_motion(kind: str) -> None:
    """A circle of 20 m at 8 m/s, noise 0.1 m, boxes with random front and rear."""
    rng = np.random.default_rng(4)
    track, errors, headings = tracker(kind), [], []
    for tick in range(100):
        angle = 0.4 * tick * DT
        place = 20.0 * math.cos(angle) + rng.normal(0, 0.1), 20.0 * math.sin(angle) + rng.normal(0, 0.1)
        yaw = angle + math.pi / 2 + math.pi * int(rng.integers(2)) + rng.normal(0, 0.03)
        confirmed = track.update(cars(tick * DT, (*place, yaw)))
        if tick > 20:
            true = 8.0 * np.array([-math.sin(angle), math.cos(angle)])
            errors.append(float(np.linalg.norm(confirmed.velocity[0] - true)))
            off = float(confirmed.boxes[0, 6]) - angle - math.pi / 2
            headings.append(abs(math.remainder(off, 2 * math.pi)))
    assert np.mean(errors) < {"cv": 1.2, "ctrv": 0.8}[kind]
    assert max(headings) < 0.25


def test_box_across_a_track_hardly_moves_it() -> None:
    """A fit that mistakes the width for the length completes the visible corner of the car in the wrong direction."""
    track, alike = tracker(), tracker()
    for tick in range(30):
        track.update(cars(tick * DT, (2.0 * tick * DT, 0.0, 0.0)))
        alike.update(cars(tick * DT, (2.0 * tick * DT, 0.0, 0.0)))
    moved = alike.update(cars(3.0, (6.0, -0.4, 0.0))).boxes[0, 1]
    confirmed = track.update(cars(3.0, (6.0, -0.4, math.pi / 2)))
    assert abs(confirmed.boxes[0, 1]) < 0.1 * abs(moved)
    assert confirmed.boxes[0, 6] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("yaw", [0.0, math.pi / 3.0, -2.5])
def test_box_around_a_part_of_a_track_hardly_moves_it(yaw: float) -> None:
    """The border of the image cuts a car, of which the network takes the visible end for a pedestrian."""
    ahead, left = np.array([math.cos(yaw), math.sin(yaw)]), np.array([-math.sin(yaw), math.cos(yaw)])
    track, alike = tracker(), tracker()
    for tick in range(30):
        for one in (track, alike):
            one.update(cars(tick * DT, (*(2.0 * tick * DT * ahead), yaw)))
    place = 6.25 * ahead + 0.25 * left
    whole = alike.update(cars(3.0, (*place, yaw)))
    part = cars(3.0, (*place, yaw))
    boxes = part.boxes.copy()
    boxes[:, 3:6] = 0.55, 0.55, 1.72
    confirmed = track.update(replace(part, boxes=boxes, classes=("pedestrian",)))
    moved = np.abs((whole.boxes[0, :2] - 6.0 * ahead) @ np.column_stack([ahead, left]))
    after = np.abs((confirmed.boxes[0, :2] - 6.0 * ahead) @ np.column_stack([ahead, left]))
    assert after[0] < 0.1 * moved[0]
    assert after[1] < 0.2 * moved[1]
    np.testing.assert_allclose(confirmed.boxes[0, 3:5], whole.boxes[0, 3:5])


def test_ctrv_has_smaller_error_than_cv_in_curve() -> None:
    """The same circle, measured at 2 Hz, where constant velocity cuts the curve."""
    means = {}
    for kind in ("cv", "ctrv"):
        track, errors = tracker(kind), []
        for tick in range(60):
            angle = 0.4 * tick * 0.5
            confirmed = track.update(
                cars(tick * 0.5, (20 * math.cos(angle), 20 * math.sin(angle), angle + math.pi / 2), deviation=0.3)
            )
            if tick > 10:
                place = np.array([20 * math.cos(angle), 20 * math.sin(angle)])
                errors.append(float(np.linalg.norm(confirmed.boxes[0, :2] - place)))
        means[kind] = np.mean(errors)
    assert means["ctrv"] < 0.7 * means["cv"]


@pytest.mark.exhaustive
@pytest.mark.parametrize("kind", ["cv", "ctrv"])
def test_track_nees_is_within_chi_square_bounds(kind: str) -> None:
    """NEES of the position over 60 simulated drives with the assumed noise, from the second second on.

    Two degrees of freedom: the mean over 60 runs is within the two-sided 99 % bounds of chi-square(120)/60 (Bar-Shalom,
    Li and Kirubarajan 2001, section 5.4.2), and so is its average over time.
    """
    runs, ticks, deviation = 60, 40, 0.2
    nees = np.zeros(ticks)
    for run in range(runs):
        rng = np.random.default_rng(1000 + run)
        x, y, heading, speed, turn = 0.0, 0.0, rng.uniform(-3, 3), rng.uniform(5, 12), rng.normal(0, 0.1)
        vx, vy = speed * math.cos(heading), speed * math.sin(heading)
        track = tracker(kind, confirm=(1, 1), gate=0.999999)
        for tick in range(ticks):
            measured = (x + rng.normal(0, deviation), y + rng.normal(0, deviation), heading + rng.normal(0, 0.1))
            confirmed = track.update(cars(tick * DT, measured, deviation=deviation))
            off = confirmed.boxes[0, :2] - (x, y)
            nees[tick] += off @ np.linalg.solve(confirmed.covariance[0], off) / runs
            for _ in range(10):
                small = DT / 10
                if kind == "cv":
                    vx, vy = (v + rng.normal(0, math.sqrt(ACCELERATION_DENSITY * small)) for v in (vx, vy))
                    heading = math.atan2(vy, vx)
                else:
                    speed += rng.normal(0, math.sqrt(ACCELERATION_DENSITY * small))
                    turn += rng.normal(0, math.sqrt(TURN_DENSITY * small))
                    heading += turn * small
                    vx, vy = speed * math.cos(heading), speed * math.sin(heading)
                x, y = x + vx * small, y + vy * small
    low, high = np.asarray(chi2.ppf([0.005, 0.995], 2 * runs)) / runs
    settled = nees[20:]
    assert np.mean((settled > low) & (settled < high)) > 0.9
    assert low < settled.mean() < high


def test_track_class_has_largest_sum_of_scores() -> None:
    track = tracker()
    expected = ("car", "truck", "car", "car", "truck", "car")
    for tick, name in zip(count(), expected, strict=False):
        confirmed = track.update(cars(tick * DT, (0.0, 0.0), names=(name,)))
    assert confirmed.classes == ("car",)


def test_tracks_of_mirrored_scene_are_mirrored() -> None:
    rng = np.random.default_rng(2)
    path = [(tick * 0.7, 3.0 + 0.02 * tick**1.5 + rng.normal(0, 0.05), 0.1) for tick in range(30)]
    one, other = tracker("ctrv"), tracker("ctrv")
    for tick, (x, y, yaw) in enumerate(path):
        left = one.update(cars(tick * DT, (x, y, yaw)))
        right = other.update(cars(tick * DT, (x, -y, -yaw)))
    np.testing.assert_allclose(left.boxes * (1, -1, 1, 1, 1, 1, -1), right.boxes, atol=1e-9)
    np.testing.assert_allclose(left.velocity * (1, -1), right.velocity, atol=1e-9)


def test_detections_without_covariance_are_tracked() -> None:
    track = tracker()
    for tick in range(5):
        detections = cars(tick * DT, (tick * 1.0, 0.0))
        tracked = track.update(replace(detections, covariance=np.full((1, 2, 2), np.nan)))
    assert np.isfinite(tracked.covariance).all()
    assert float(tracked.velocity[0, 0]) == pytest.approx(10.0, abs=1.0)


def test_update_with_older_detections_raises() -> None:
    track = tracker()
    track.update(cars(1.0, (0, 0)))
    with pytest.raises(ValueError, match=r"out of sequence \(got 0\.5 s; expected at least 1\.0 s\)"):
        track.update(cars(0.5, (0, 0)))


def test_boxes_on_the_body_of_a_track_are_no_other_objects() -> None:
    """A car of 4.6 m is tracked; then a scan shows a box across its rear only, then parts at both ends. Bodies cannot
    overlap, so that all of them are the car, which a center 2 m off moves by less than a tenth of that. A car behind it
    is another one."""
    track = tracker()
    for scan in range(20):
        track.update(cars(DT * scan, (20, 0)))
    part = cars(2.0, (18, 0, math.pi / 2.0))
    part.boxes[0, 3:6] = 1.7, 0.6, 1.5
    for scan in range(20, 24):
        held = track.update(replace(part, time=DT * scan))
        assert held.tracks == (1,)
        assert held.boxes[0, 0] == pytest.approx(20.0, abs=0.2)
        assert held.boxes[0, 3] == pytest.approx(4.6)
    assert track.update(cars(2.4, (18, 0), (22, 0))).tracks == (1,)
    for scan in range(25, 28):
        held = track.update(cars(DT * scan, (20, 0), (14, 0)))
    assert held.tracks == (1, 2)


@pytest.mark.parametrize(("height", "objects"), [(2.5, 1), (6.5, 2)])
def test_box_above_a_body_is_another_object_on_a_bridge_only(height: float, objects: int) -> None:
    """Errors of the height of a box by 2.5 m are no second car."""
    track = tracker()
    for scan in range(20):
        detections = cars(DT * scan, (20.0, 0.0), *([(20.0, 0.5, math.pi / 2.0)] if scan >= 10 else []))
        detections.boxes[1:, 2] += height
        held = track.update(detections)
    assert len(held) == len(without_duplicates(detections)) == objects


def test_tracks_keep_their_level_when_a_car_passes_below_a_bridge() -> None:
    track = tracker()
    for scan in range(41):
        detections = cars(DT * scan, (-20.0 + scan, 0.0), (0.0, 0.0, math.pi / 2.0))
        detections.boxes[1, 2] += 6.5
        held = track.update(detections)
    assert held.tracks == (1, 2)
    np.testing.assert_allclose(held.boxes[:, :3], [[20.0, 0.0, 0.75], [0.0, 0.0, 7.25]], atol=0.2)


@pytest.mark.parametrize("speed", [3.0, 5.0])
def test_tracks_of_cars_that_set_off_follow_them(speed: float) -> None:
    """40 cars stand for 3 s, then drive. The boxes, with errors of 0.2 m in each axis, are soon outside the gate of a
    track at rest, and on its body for more than a second. No track falls behind by a third of a car."""
    rng = np.random.default_rng(1)
    track = tracker()
    for scan in range(60):
        places = [(max(0.0, speed * (DT * scan - 3.0)), 40.0 * car) for car in range(40)]
        measured = [tuple(np.add(place, rng.normal(0.0, 0.2, 2))) for place in places]
        held = track.update(cars(DT * scan, *measured, deviation=0.2))
        if scan > 5:
            assert len(held) == 40
            nearest = np.linalg.norm(held.boxes[:, None, :2] - np.array(places), axis=2).min(axis=0)
            assert nearest.max() < 1.5


def test_box_that_overlaps_a_body_is_no_other_object() -> None:
    """A car ends at 22.3 m. A box from 21.1 m on overlaps it by 1.2 m, more than two cars in a row; one from 22.1 m on
    may be a second car, and a pedestrian 0.1 m beside its side is one."""
    for x, y, name, expected in (
        (23.4, 0, "car", (1,)),
        (24.4, 0, "car", (1, 2)),
        (20.0, 1.25, "pedestrian", (1, 2)),
    ):
        track = tracker()
        for scan in range(20):
            track.update(cars(DT * scan, (20, 0)))
        both = cars(0.0, (20, 0), (x, y), names=("car", name))
        if name == "pedestrian":
            both.boxes[1, 3:6] = 0.5, 0.5, 1.7
        for scan in range(20, 25):
            held = track.update(replace(both, time=DT * scan))
        assert held.tracks == expected


def test_box_beside_an_undetected_body_is_this_object() -> None:
    """The center of a box is 0.3 m behind a car of 4.6 m whose own box is missing, with an error of 0.4 m."""
    track = tracker()
    for scan in range(20):
        track.update(cars(DT * scan, (20, 0), deviation=0.4))
    part = cars(0.0, (17.4, 0, math.pi / 2.0), deviation=0.4, names=("bicycle",))
    part.boxes[0, 3:6] = 1.7, 0.6, 1.5
    for scan in range(20, 25):
        assert track.update(replace(part, time=DT * scan)).tracks == (1,)


@pytest.mark.parametrize("places", [((0.0, 0.0), (5.5, 0.0)), ((5.5, 0.0), (0.0, 0.0))])
def test_box_on_a_detected_body_moves_no_hidden_neighbor(places: tuple[tuple[float, float], ...]) -> None:
    """A second box is around the front of a detected car; 5.5 m ahead is one that is not detected. It stays there."""
    track = tracker()
    for scan in range(2):
        track.update(cars(DT * scan, *places, deviation=0.5))
    track.update(cars(0.2, (0.0, 0.0), deviation=0.5), in_view=lambda boxes: np.zeros(len(boxes)))
    both = cars(0.3, (0.0, 0.0), (1.9, 0.0), deviation=0.5)
    both.boxes[1, 3:5] = 0.6, 1.6
    held = track.update(both, in_view=lambda boxes: np.zeros(len(boxes)))
    assert sorted(held.boxes[:, 0].tolist()) == pytest.approx([0.0, 5.5], abs=1e-9)


@pytest.mark.parametrize("order", [[0, 1], [1, 0]])
def test_better_of_two_boxes_on_an_undetected_body_updates_it(order: list[int]) -> None:
    """One box is 1.9 m ahead of the center of the car, one 1.2 m behind it: the car is corrected backwards."""
    track = tracker()
    for scan in range(6):
        track.update(cars(DT * scan, (0.0, 0.0)))
    held = track.update(cars(0.6, *[((1.9, 0.0), (-1.2, 0.0))[box] for box in order]))
    assert held.tracks == (1,)
    assert held.boxes[0, 0] < 0.0


def test_velocity_of_new_track_is_zero_until_it_is_known() -> None:
    """Errors of 0.4 m let a parked car seem to move by 0.8 m in 0.1 s: 8 m/s with a standard deviation of 5.7 m/s. A
    car at 15 m/s with errors of 0.1 m moves for certain from its third box on."""
    track = tracker()
    reported = [track.update(cars(DT * scan, (x, 0), deviation=0.4)) for scan, x in enumerate((20.0, 20.8, 20.4))]
    assert [held.velocity.tolist() for held in reported[1:]] == [[[0.0, 0.0]]] * 2
    track = tracker()
    for scan in range(3):
        held = track.update(cars(DT * scan, (15.0 * DT * scan, 0)))
    assert held.velocity[0, 0] == pytest.approx(15.0, abs=1.0)


@pytest.mark.parametrize("kind", ["cv", "ctrv"])
def test_variance_of_velocity_covers_the_error_of_a_new_track(kind: str) -> None:
    """A car at 10 m/s is reported at rest while boxes with errors of 0.5 m do not prove its motion: its velocity is
    within three standard deviations. One at rest is known to 0.5 m/s after three seconds."""
    track, suppressed = tracker(kind), 0
    for scan in range(6):
        confirmed = track.update(cars(DT * scan, (scan * 1.0, 0.0), deviation=0.5))
        for velocity, variance in zip(confirmed.velocity, confirmed.velocity_variance, strict=True):
            error = math.dist(velocity, (10.0, 0.0))
            assert error < 3.0 * math.sqrt(variance)
            suppressed += error > 9.0
    assert suppressed
    track = tracker(kind)
    for scan in range(30):
        confirmed = track.update(cars(DT * scan, (0.0, 0.0), deviation=0.5))
    assert confirmed.velocity_variance[0] < 0.25


@pytest.mark.parametrize("kind", ["cv", "ctrv"])
@pytest.mark.parametrize("speed", [1.0, 3.0, 10.0])
def test_new_tracks_have_consistent_variances_of_velocities(kind: str, speed: float) -> None:
    """The mean squared error of the first four velocities, most of which are 0, is at most twice the stated one."""
    errors: list[list[float]] = []
    for seed in range(20):
        track, noise = tracker(kind), np.random.default_rng(seed).normal(0.0, 0.3, (5, 2))
        scans = [
            track.update(cars(DT * scan, (x + speed * DT * scan, y), deviation=0.3))
            for scan, (x, y) in enumerate(noise)
        ]
        errors.append([squared_error(held, speed) / held.velocity_variance[0] for held in scans[1:] if len(held)])
    assert max(np.mean(column) for column in zip(*errors, strict=True)) < 2.0


@pytest.mark.parametrize("kind", ["cv", "ctrv"])
@pytest.mark.parametrize("step", [0.05, 0.1])
@pytest.mark.parametrize("deviation", [0.1, 0.3])
def test_fast_vehicles_are_tracked_from_their_third_scan(kind: str, step: float, deviation: float) -> None:
    """Two cars side by side at 42 m/s, and an oncoming one. Three boxes with errors of s at intervals of T determine a
    velocity to s / (√2 T), which is 4.2 m/s at most; the assumed speed of new objects draws it towards 0."""
    rng, track = np.random.default_rng(1), tracker(kind)
    for scan in range(3):
        x = 42.0 * step * scan
        places = np.array([(x, 0.0, 0.0), (x, 3.5, 0.0), (90.0 - x, 7.0, math.pi)])
        places[:, :2] += rng.normal(0.0, deviation, (3, 2))
        held = track.update(cars(step * scan, *places.tolist(), deviation=deviation))
    assert len(held) == 3
    assert sorted(held.velocity[:, 0].tolist()) == pytest.approx([-42.0, 42.0, 42.0], abs=12.0)


@pytest.mark.parametrize("yaw", [0.0, math.pi / 2.0])
def test_new_vehicle_moves_across_its_axis_only_if_that_is_certain(yaw: float) -> None:
    """Successive boxes differ by -0.75 m in x and, by an error of one deviation, 0.2 m in y within 0.05 s: 15 and 4
    m/s. A car drives along its axis, and 4 m/s are no evidence of the contrary; 15 m/s across a wrong axis are."""
    track = tracker(confirm=(2, 3))
    for number, y in enumerate((0.0, 0.2, 0.0, 0.2)):
        reported = track.update(cars(0.05 * number, (-0.75 * number, y, yaw), deviation=0.2))
    assert reported.velocity[0, 0] == pytest.approx(-15.0, abs=3.0)
    assert reported.velocity[0, 1] == pytest.approx(0.0, abs=1e-9) or yaw != 0.0


@pytest.mark.parametrize("kind", ["cv", "ctrv"])
def test_growing_box_of_standing_car_is_no_motion(kind: str) -> None:
    """Of a car that stands a corner is visible, 0.5 m long, then 1.5 m, and then all of it."""
    track, corner = tracker(kind), (20.0, 3.0)
    for tick, (length, width) in enumerate([(0.5, 0.5), (1.5, 0.8), *[(4.6, 1.8)] * 10]):
        detections = cars(tick * DT, (corner[0] + length / 2.0, corner[1] + width / 2.0))
        detections.boxes[:, 3:5] = length, width
        objects = track.update(detections)
        assert np.all(np.hypot(*objects.velocity.T) < 1.0)
    assert objects.boxes[0, :2] == pytest.approx((22.3, 3.9), abs=0.2)


def test_position_of_standing_object_stays_as_uncertain_as_common_errors() -> None:
    """300 boxes of a standard deviation of 3 m, all of them 3 m too near, are no precise position: a better sensor is
    believed at once."""
    track = tracker()
    for scan in range(300):
        held = track.update(cars(DT * scan, (50, 0), deviation=3.0))
    assert 1.0 < math.sqrt(held.covariance[0, 0, 0]) < 1.5
    held = track.update(cars(30.0, (53, 0), deviation=0.2))
    assert held.tracks == (1,)
    assert held.boxes[0, 0] == pytest.approx(53.0, abs=0.3)


def test_velocity_of_pedestrian_after_standstill_follows_at_once() -> None:
    """After 3 s at rest, two boxes of a walk of 1.5 m/s show it; a car that moved by 0.3 m may still stand."""
    speeds = {}
    for name in ("pedestrian", "car"):
        track = tracker()
        for scan in range(33):
            moved = 1.5 * DT * max(scan - 30, 0)
            held = track.update(cars(DT * scan, (20.0, moved), names=(name,)))
        speeds[name] = float(held.velocity[0, 1])
    assert speeds["pedestrian"] == pytest.approx(1.5, abs=0.5)
    assert speeds["car"] < 0.2


@pytest.mark.parametrize(
    ("name", "counts"), [("pedestrian", True), ("bicycle", True), ("car", False), ("motorbike", False)]
)
def test_four_positions_are_a_motion_of_slow_road_users_only(name: str, counts: bool) -> None:
    """0.3 m per scan with errors of 0.3 m: the line of regression through four positions has a slope of 3 m/s, and a
    deviation of 0.3 m / (0.1 s · sqrt(5)) = 1.3 m/s. Three deviations are a certain motion."""
    track = tracker()
    for scan in range(4):
        held = track.update(cars(DT * scan, (20.0, 0.3 * scan), deviation=0.3, names=(name,)))
    assert (np.hypot(*held.velocity[0]) > 1.0) == counts


def test_size_of_a_track_follows_when_most_boxes_are_shorter() -> None:
    """Six distant boxes of a crate have the length of a car, 4.6 m; all later ones have its 1 m. Up to six of them may
    show a part of a car."""
    track = tracker()
    for scan in range(6):
        track.update(cars(scan * DT, (0, 0)))
    for scan in range(6, 40):
        crate = cars(scan * DT, (0, 0))
        crate.boxes[0, 3:6] = 1.0
        length = track.update(crate).boxes[0, 3]
        if scan < 12:
            assert length == pytest.approx(4.6)
    assert length == pytest.approx(1.0, abs=0.05)
