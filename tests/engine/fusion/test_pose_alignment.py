"""Alignment of poses by shared objects: closed forms, published errors, and layouts in which it must not act."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from msgspec.structs import replace

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.base.geometry import wrap_angle
from eidrive_scenario.base.randomness import generator
from eidrive_scenario.fusion.covariance_intersection import CovarianceIntersectionFusion, CovarianceIntersectionSettings
from eidrive_scenario.fusion.method import Report
from eidrive_scenario.fusion.pose_alignment import (
    PoseAlignment,
    _Candidates,
    align_pose,
    aligned_report,
    estimate_error,
)
from eidrive_scenario.v2x.messages.message import StationState

Make = Callable[..., Report]

SENDER = np.array([10.0, 5.0])
ERROR = np.array([0.5, -0.3, math.radians(0.8)])
PRIOR = (0.5, 0.5, math.radians(1.0))
ALIGNED = CovarianceIntersectionSettings(align_poses=True)


def state_of(
    error: np.ndarray, deviations: tuple[float, float, float] | None = PRIOR, time: float = 0.0
) -> StationState:
    """Return the state of the sender with this error of its pose, and with the covariance that it states."""
    covariance = None if deviations is None else np.diag(np.square(deviations))
    return StationState(time, SENDER[0] + error[0], SENDER[1] + error[1], 0.0, error[2], 0.0, covariance)


def displaced(positions: np.ndarray, error: np.ndarray) -> np.ndarray:
    """Return positions (N, 2) as the sender reports them with this error of its pose."""
    cos, sin = math.cos(error[2]), math.sin(error[2])
    return np.asarray((positions - SENDER) @ np.array([[cos, sin], [-sin, cos]]) + SENDER + error[:2])


def scattered(count: int, *names: str | int) -> np.ndarray:
    """Return positions (N, 2) of cars in an area of 80 m x 80 m."""
    return generator(5, "layout", *names).uniform(-40.0, 40.0, (count, 2))


def pairs_of(positions: np.ndarray, measured: np.ndarray, deviation: float, prior: np.ndarray) -> _Candidates:
    """Return the known pairs of objects, measured by the sender, without headings."""
    count = len(positions)
    return _Candidates(
        np.arange(count),
        np.arange(count),
        measured - SENDER,
        measured - positions,
        np.broadcast_to(deviation**2 * np.eye(2), (count, 2, 2)).copy(),
        np.zeros(count),
        np.full(count, np.inf),
        prior,
        np.sqrt(prior),
    )


def align_cars(
    report: Make, own: np.ndarray, others: np.ndarray, state: StationState, **settings: object
) -> PoseAlignment:
    """Return the alignment of a sender of cars at `others` to own cars."""
    return align_pose(report("own", 0.0, own, **settings).detections, report("B", 0.0, others, state=state, **settings))


@pytest.mark.parametrize("count", [2, 3, 9])
def test_estimated_error_with_wide_prior_equals_closed_form(count: int) -> None:
    """Without a prior the rotation of equal weights is that of Kabsch's method in the plane, about both means."""
    rng = generator(6, "closed form", count)
    positions = scattered(count, "closed form")
    measured = displaced(positions, np.array([3.0, -2.0, 0.4])) + rng.normal(size=(count, 2)) * 0.3
    a, b = measured - measured.mean(axis=0), positions - positions.mean(axis=0)
    yaw = -math.atan2((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum(), (a * b).sum())
    cos, sin = math.cos(yaw), math.sin(yaw)
    # The sender is corrected by the motion that moves the mean of the measured objects to that of the true ones.
    corrected = positions.mean(axis=0) + (SENDER - measured.mean(axis=0)) @ np.array([[cos, -sin], [sin, cos]])
    error, _, _ = estimate_error(pairs_of(positions, measured, 0.3, np.diag([1e8, 1e8, 1e8])), np.arange(count))
    assert error == pytest.approx([*(SENDER - corrected), yaw], abs=1e-6)


def test_covariance_of_symmetric_layout_equals_inverse_information() -> None:
    """Objects at distance d in all four directions inform on x, y and yaw separately: n/s², n/s² and n d²/s²."""
    distance, deviation, prior = 20.0, 0.2, np.diag(np.square(PRIOR))
    positions = SENDER + distance * np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])
    _, covariance, _ = estimate_error(pairs_of(positions, positions, deviation, prior), np.arange(4))
    information = np.array([4.0, 4.0, 4.0 * distance**2]) / deviation**2 + 1.0 / np.diag(prior)
    assert covariance == pytest.approx(np.diag(1.0 / information), abs=1e-12)
    rng = generator(6, "information")
    squared = []
    for _ in range(300):
        truth = rng.normal(size=3) * PRIOR
        measured = displaced(positions, truth) + rng.normal(size=(4, 2)) * deviation
        error, claimed, _ = estimate_error(pairs_of(positions, measured, deviation, prior), np.arange(4))
        squared.append((error - truth) @ np.linalg.solve(claimed, error - truth))
    # The mean of 300 chi-squares of 3 degrees is 3 with a standard deviation of sqrt(6 / 300).
    assert np.mean(squared) == pytest.approx(3.0, abs=3.0 * math.sqrt(6.0 / 300.0))


@pytest.mark.parametrize(
    ("count", "position", "yaw"), [(2, 0.20, 0.36), (4, 0.11, 0.17), (8, 0.07, 0.11), (16, 0.05, 0.08)]
)
def test_recovery_of_drawn_errors_equals_published_one(count: int, position: float, yaw: float, report: Make) -> None:
    """Errors of 0.4 m and 0.4°, boxes of 0.1 m and 2°: least squares without a prior leaves these mean errors [m], [°].

    Pairs are unknown here. By the prior, two objects do not worsen the yaw.
    """
    rng = generator(7, "recovery", count)
    deviations = 0.4, 0.4, math.radians(0.4)
    errors = []
    for trial in range(200):
        positions, yaws = scattered(count, trial), rng.uniform(-math.pi, math.pi, count)
        truth = rng.normal(size=3) * deviations
        own, other = (
            report(name, 0.0, seen, yaw=axes + np.radians(rng.normal(size=count) * 2.0), covariance=0.01, state=state)
            for name, seen, axes, state in (
                ("A", positions + rng.normal(size=(count, 2)) * 0.1, yaws, None),
                (
                    "B",
                    displaced(positions, truth) + rng.normal(size=(count, 2)) * 0.1,
                    yaws + truth[2],
                    state_of(truth, deviations),
                ),
            )
        )
        errors.append(align_pose(own.detections, other).error - truth)
    left = np.array(errors)
    assert np.hypot(left[:, 0], left[:, 1]).mean() == pytest.approx(position, abs=0.1 * position + 0.005)
    assert np.degrees(np.abs(left[:, 2])).mean() < min(yaw, math.sqrt(2.0 / math.pi) * 0.4)


def test_exact_pose_is_not_corrected(report: Make) -> None:
    positions = scattered(8)
    for deviations in (None, (0.0, 0.0, 0.0)):
        sent = report("B", 0.0, positions + 0.3, state=state_of(ERROR, deviations))
        alignment = align_pose(report("own", 0.0, positions).detections, sent)
        assert not alignment.is_corrected
        assert (alignment.error == 0.0).all()
        assert (alignment.covariance == 0.0).all()
        assert aligned_report(sent, alignment) is sent


def test_exact_coordinate_stays_exact(report: Make) -> None:
    """Only x has an error: y and yaw stay as they are, although boxes differ in them."""
    positions = scattered(8)
    alignment = align_cars(
        report, positions, positions + np.array([0.4, 0.1]), state_of(np.array([0.4, 0.0, 0.0]), (0.5, 0.0, 0.0))
    )
    assert alignment.error[0] == pytest.approx(0.4, abs=0.05)
    assert alignment.error[1:] == pytest.approx([0.0, 0.0], abs=1e-15)


def test_report_at_corrected_pose_has_true_objects(report: Make) -> None:
    positions = scattered(12)
    sent = report(
        "B",
        0.0,
        displaced(positions, ERROR),
        yaw=ERROR[2] + 0.7,
        velocity=(3.0, 4.0),
        covariance=np.diag([0.04, 0.01]),
        state=state_of(ERROR),
    )
    moved = aligned_report(sent, PoseAlignment((*SENDER, 0.0), ERROR, np.eye(3), 12))
    assert moved.detections.boxes[:, :2] == pytest.approx(positions, abs=1e-12)
    assert moved.detections.boxes[:, 6] == pytest.approx(np.full(12, 0.7), abs=1e-12)
    turned = np.array([3.0 + 4.0 * ERROR[2], 4.0 - 3.0 * ERROR[2]])
    assert moved.detections.velocity[0] == pytest.approx(turned, abs=1e-3)
    assert moved.state is not None
    assert (moved.state.x, moved.state.y, moved.state.yaw) == (*SENDER, 0.0)
    assert np.linalg.eigvalsh(moved.detections.covariance[0]) == pytest.approx([0.01, 0.04])


def test_reversed_headings_do_not_change_the_correction(report: Make) -> None:
    positions = scattered(6)
    yaws = np.linspace(-3.0, 3.0, 6)
    results = []
    for turned in (0.0, math.pi):
        sent = report("B", 0.0, displaced(positions, ERROR), yaw=wrap_angle(yaws + turned), state=state_of(ERROR))
        results.append(align_pose(report("own", 0.0, positions, yaw=yaws).detections, sent).error)
    assert results[0] == pytest.approx(results[1], abs=1e-12)


def test_boxes_across_their_object_do_not_turn_the_pose(report: Make) -> None:
    """Boxes of few points may lie across their object: their heading is ignored, their position is not."""
    positions = scattered(6)
    yaws = np.array([0.0, 0.0, 0.0, 0.5, 0.5, 1.0])
    sent = report("B", 0.0, displaced(positions, ERROR), yaw=yaws + 1.2, state=state_of(ERROR))
    alignment = align_pose(report("own", 0.0, positions, yaw=yaws).detections, sent)
    assert alignment.shared == 6
    assert alignment.error == pytest.approx(ERROR, abs=0.05)


def test_no_common_object_leaves_the_pose(report: Make) -> None:
    for own, others in (
        (scattered(5), scattered(5) + 100.0),
        (np.empty((0, 2)), scattered(5)),
        (scattered(5), np.empty((0, 2))),
    ):
        alignment = align_cars(report, own, others, state_of(ERROR))
        assert alignment.shared == 0
        assert alignment.covariance == pytest.approx(np.diag(np.square(PRIOR)))


@pytest.mark.parametrize("trial", range(5))
def test_objects_of_one_station_and_displaced_ones_are_ignored(trial: int, report: Make) -> None:
    rng = generator(8, "outliers", trial)
    positions, lone, hidden = (scattered(count, trial, name) for count, name in ((8, "both"), (8, "own"), (8, "other")))
    others = displaced(np.concatenate([positions, hidden]), ERROR) + rng.normal(size=(16, 2)) * 0.1
    others[:2] += (1.5, 1.0)
    alignment = align_cars(report, np.concatenate([positions, lone]), others, state_of(ERROR))
    assert alignment.error[:2] == pytest.approx(ERROR[:2], abs=0.25)
    assert math.degrees(abs(alignment.error[2] - ERROR[2])) < 0.5


def test_moving_objects_are_predicted_to_the_time_of_a_late_report(report: Make) -> None:
    """Cars drive 6 m in the 0.4 s between both measurements, in two directions."""
    positions = scattered(8)
    velocity = np.array([(15.0, 0.0), (-15.0, 0.0)] * 4)
    own = report("own", 1.4, positions + 0.4 * velocity, velocity=velocity)
    sent = report("B", 1.0, displaced(positions, ERROR), velocity=velocity, state=state_of(ERROR, time=1.0))
    alignment = align_pose(own.detections, sent)
    assert alignment.shared == 8
    assert alignment.error == pytest.approx(ERROR, abs=0.1)


@pytest.mark.parametrize("spacing", [2.5, 6.0])
@pytest.mark.parametrize("deviation", [0.4, 1.0, 2.0, 4.0])
def test_row_of_parked_cars_is_not_shifted_by_one_car(spacing: float, deviation: float, report: Make) -> None:
    """Both see other parts of the row: only the prior says which car is which, and a weak one leaves the pose."""
    for trial in range(20):
        rng = generator(9, "row", trial)
        row = np.stack([spacing * np.arange(16.0), np.zeros(16)], axis=1)
        deviations = deviation, deviation, math.radians(0.5)
        truth = np.clip(rng.normal(size=3), -1.5, 1.5) * deviations
        others = displaced(row[4:], truth) + rng.normal(size=(12, 2)) * 0.05
        alignment = align_cars(report, row[:12], others, state_of(truth, deviations), size=(1.8, 1.8, 1.5))
        if alignment.is_corrected:
            assert abs(alignment.error[0] - truth[0]) < 0.3 * spacing
        elif deviation <= 0.4:
            pytest.fail("not corrected although the prior excludes the next car")


def test_symmetric_crossing_is_not_rotated(report: Make) -> None:
    """Cars in all four arms of a crossing: each quarter turn is the same layout, and the prior excludes it."""
    arms = np.concatenate([np.array([[d, 2.0], [-2.0, d], [-d, -2.0], [2.0, -d]]) for d in (10.0, 20.0)]) + SENDER
    alignment = align_cars(report, arms, displaced(arms, ERROR), state_of(ERROR))
    assert alignment.shared == 8
    assert alignment.error == pytest.approx(ERROR, abs=0.05)


def test_cars_are_not_aligned_to_pedestrians(report: Make) -> None:
    positions = scattered(6)
    own = report("own", 0.0, positions, kind="pedestrian", size=(0.5, 0.5, 1.7)).detections
    assert not align_pose(own, report("B", 0.0, displaced(positions, ERROR), state=state_of(ERROR))).is_corrected


def test_one_ambiguous_object_leaves_the_pose(report: Make) -> None:
    """A single car may be another one; its position is fused, but other objects do not move with it."""
    assert not align_cars(
        report, SENDER[None] + 10.0, SENDER[None] + 11.0, state_of(ERROR, (1.0, 1.0, 0.02))
    ).is_corrected


def test_many_objects_are_aligned(report: Make) -> None:
    positions = generator(5, "many").uniform(-200.0, 200.0, (400, 2))
    alignment = align_cars(report, positions, displaced(positions, ERROR), state_of(ERROR))
    assert alignment.shared > 350
    assert alignment.error == pytest.approx(ERROR, abs=0.01)


@pytest.mark.parametrize(
    "changes",
    [
        {"pose_covariance": np.full((3, 3), np.nan)},
        {"pose_covariance": 1e300 * np.eye(3)},
        {"x": math.nan},
        {"x": 1e12},
    ],
)
def test_state_without_meaning_leaves_the_pose(changes: dict[str, object], report: Make) -> None:
    positions = scattered(4)
    assert not align_cars(report, positions, positions, replace(state_of(ERROR), **changes)).is_corrected


def test_correction_turns_with_the_world(report: Make) -> None:
    """The same layout, turned by 2 rad and moved by kilometers, has the same correction in turned coordinates."""
    positions = scattered(8)
    yaws = np.linspace(-3.0, 3.0, 8)
    rotation, shift = np.array([[math.cos(2.0), -math.sin(2.0)], [math.sin(2.0), math.cos(2.0)]]), np.array([1e4, -3e4])
    state = state_of(ERROR)
    x, y = rotation @ (state.x, state.y) + shift
    turned = replace(state, x=float(x), y=float(y), yaw=state.yaw + 2.0)
    others = displaced(positions, ERROR)
    errors = [
        align_pose(
            report("own", 0.0, own, yaw=wrap_angle(yaws + turn)).detections,
            report("B", 0.0, seen, yaw=wrap_angle(yaws + ERROR[2] + turn), state=sent),
        ).error
        for own, seen, sent, turn in (
            (positions, others, state, 0.0),
            (positions @ rotation.T + shift, others @ rotation.T + shift, turned, 2.0),
        )
    ]
    assert errors[1][:2] @ rotation == pytest.approx(errors[0][:2], abs=1e-9)
    assert errors[1][2] == pytest.approx(errors[0][2], abs=1e-9)


def test_report_without_state_is_an_error(report: Make) -> None:
    with pytest.raises(ValueError, match="'B' has no state"):
        align_pose(Detections(0.0), report("B", 0.0, [(0.0, 0.0)]))


def fuse_in_turn(
    reports: list[Report], settings: CovarianceIntersectionSettings, now: float
) -> tuple[Detections, CovarianceIntersectionFusion]:
    """Return the objects after each report was fused at its time, and at last at `now` [s]."""
    fusion, newest = CovarianceIntersectionFusion(settings), {}
    for sent in reports:
        fusion.add_report(sent)
        newest[sent.station] = sent
        fusion.fuse(list(newest.values()), sent.arrived)
    return fusion.fuse(list(newest.values()), now), fusion


def test_aligned_fusion_moves_objects_that_only_the_sender_sees(report: Make) -> None:
    positions, hidden = scattered(6), np.array([[60.0, 0.0]])
    own = report("A", 0.0, positions, state=StationState(0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    sent = report("B", 0.0, displaced(np.concatenate([positions, hidden]), ERROR), state=state_of(ERROR))
    plain, aligned = (
        fuse_in_turn([own, sent], settings, 0.0)[0] for settings in (CovarianceIntersectionSettings(), ALIGNED)
    )
    errors = [np.linalg.norm(fused.boxes[:, :2] - hidden, axis=1).min() for fused in (plain, aligned)]
    assert errors[0] > 0.5
    assert errors[1] < 0.15
    assert len(aligned) == 7
    rows = [np.linalg.norm(fused.boxes[:, :2] - hidden, axis=1).argmin() for fused in (plain, aligned)]
    assert np.trace(aligned.covariance[rows[1]]) < 0.5 * np.trace(plain.covariance[rows[0]])


def test_aligned_fusion_without_pose_errors_is_equal(report: Make) -> None:
    """Equal bits: exact poses, and inexact ones without a common object."""
    positions = scattered(6)
    own = report("A", 0.0, positions, state=StationState(0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    exact = report("B", 0.0, positions[2:] + 0.1, state=state_of(np.zeros(3), None))
    remote = [report("C", 0.1 * k, positions + 200.0 + k, state=state_of(ERROR, time=0.1 * k)) for k in range(3)]
    plain, aligned = (
        fuse_in_turn([own, exact, *remote], settings, 0.3)[0]
        for settings in (CovarianceIntersectionSettings(), ALIGNED)
    )
    assert (plain.boxes == aligned.boxes).all()
    assert (plain.covariance == aligned.covariance).all()
    assert (plain.existence == aligned.existence).all()


@pytest.mark.parametrize("correlated", [False, True])
def test_aligned_fusion_follows_errors_of_both_poses(correlated: bool, report: Make) -> None:
    """Both poses have errors, new in each scan or constant: objects of the sender are placed relative to the own pose.

    Without alignment they are as far off as the errors of both poses together, 0.6 m.
    """
    rng = generator(10, "both", str(correlated))
    positions, hidden = scattered(8), np.array([[60.0, 0.0], [0.0, 55.0]])
    prior, relative = np.diag(np.square((0.35, 0.35, 0.005))), (0.5, 0.5, 0.0075)
    off: dict[bool, list[float]] = {False: [], True: []}
    for _ in range(10):
        methods = {
            aligns: CovarianceIntersectionFusion(CovarianceIntersectionSettings(align_poses=aligns)) for aligns in off
        }
        errors = rng.normal(size=(2, 3)) * np.sqrt(np.diag(prior))
        for scan in range(6):
            time = 0.1 * scan
            if not correlated:
                errors = rng.normal(size=(2, 3)) * np.sqrt(np.diag(prior))
            seen, others = (
                displaced(np.concatenate(objects), error) + rng.normal(size=(count, 2)) * 0.05
                for objects, error, count in (((positions,), errors[0], 8), ((positions, hidden), errors[1], 10))
            )
            change = np.zeros((3, 3)) if correlated else 2.0 * prior
            own = replace(
                report("A", time, seen, state=StationState(time, 10.0, 5.0, 0.0, 0.0, 0.0)), pose_change=change
            )
            sent = report("B", time, others, state=state_of(errors[1], relative, time))
            truth = displaced(hidden, errors[0])
            for aligns, method in methods.items():
                method.add_report(sent)
                method.add_report(own)
                fused = method.fuse([own, sent], time)
                if scan == 5:
                    off[aligns] += np.linalg.norm(fused.boxes[:, None, :2] - truth, axis=2).min(axis=0).tolist()
    assert np.mean(off[True]) < 0.3
    assert np.mean(off[True]) < 0.6 * np.mean(off[False])


def test_aligned_batch_equals_single_stations(report: Make) -> None:
    reports = []
    for number in range(3):
        positions = scattered(5, number)
        own = report("A", 0.0, positions, state=StationState(0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
        reports.append([own, report("B", 0.0, displaced(positions, ERROR), state=state_of(ERROR))])
    settings = [ALIGNED, ALIGNED, CovarianceIntersectionSettings()]
    results = []
    for batch in (False, True):
        methods = [CovarianceIntersectionFusion(setting) for setting in settings]
        for method, held in zip(methods, reports, strict=True):
            for sent in held:
                method.add_report(sent)
        if batch:
            results.append(CovarianceIntersectionFusion.fuse_batch(methods, reports, 0.1))
        else:
            results.append([method.fuse(held, 0.1) for method, held in zip(methods, reports, strict=True)])
    for single, together in zip(*results, strict=True):
        assert (single.boxes == together.boxes).all()
        assert (single.covariance == together.covariance).all()
