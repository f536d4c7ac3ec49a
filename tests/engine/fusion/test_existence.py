"""Existence probability of fused objects."""

from __future__ import annotations

from collections.abc import Callable
from itertools import permutations

import numpy as np
import pytest
from msgspec.structs import replace

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.fusion.average import AverageFusion, fuse_average
from eidrive_scenario.fusion.covariance_intersection import CovarianceIntersectionFusion, CovarianceIntersectionSettings
from eidrive_scenario.fusion.method import Report
from eidrive_scenario.perception.tracking.association import LIFETIME, missed

Make = Callable[..., Report]
Fuse = Callable[..., Detections]

ALL = CovarianceIntersectionSettings(existence=0.0)


def judged(report: Report, *existence: float) -> Report:
    """Return the report with tracks and these existence probabilities."""
    found = report.detections
    tracks = found.tracks or tuple(range(1, len(found) + 1))
    return replace(report, detections=replace(found, existence=np.array(existence), tracks=tracks))


def test_existence_of_a_single_station_is_unchanged(report: Make, fuse: Fuse) -> None:
    fused = fuse([judged(report("A", 0.0, [(10.0, 0.0)], score=0.9), 0.7)], 0.0)
    assert fused.existence.tolist() == pytest.approx([0.7])
    assert fused.scores.tolist() == pytest.approx([0.9])


def test_existence_of_a_tracking_station_is_not_accumulated(report: Make, fuse: Fuse) -> None:
    """Ten reports of a track with 0.6 result in 0.6, because the station has accumulated its past."""
    velocity = (5.0, 0.0)
    reports = [
        judged(report("A", 0.05 * tick, [(10.0 + 0.25 * tick, 0.0)], velocity=velocity), 0.6) for tick in range(10)
    ]
    assert fuse(reports, 0.45).existence.tolist() == pytest.approx([0.6])
    still = [judged(report("A", 0.05 * tick, [(10.0, 0.0)]), 0.6) for tick in range(10)]
    assert fuse(still, 0.45).existence.tolist() == pytest.approx([0.6]), "also without velocity"


def test_fusion_removes_objects_with_falling_existence_of_their_station(report: Make) -> None:
    fusion = CovarianceIntersectionFusion()
    counts = []
    for tick, existence in enumerate((0.95, 0.7, 0.45, 0.2)):
        known = judged(report("A", 0.1 * tick, [(10.0, 0.0)], velocity=(0.0, 0.0)), existence)
        fusion.add_report(known)
        counts.append(len(fusion.fuse([known], 0.1 * tick)))
    assert counts == [1, 1, 0, 0]


def test_existence_of_two_stations_is_that_of_at_least_one_report(report: Make) -> None:
    one, other = judged(report("A", 0.0, [(10.0, 0.0)]), 0.6), judged(report("B", 0.0, [(10.1, 0.0)]), 0.5)
    for fusion in (CovarianceIntersectionFusion(), AverageFusion()):
        for held in (one, other):
            fusion.add_report(held)
        assert fusion.fuse([one, other], 0.0).existence.tolist() == pytest.approx([0.8])


def test_existence_is_independent_of_the_order_of_stations(report: Make) -> None:
    reports = [
        judged(report(name, 0.0, [(10.0 + shift, 0.0), (30.0, 5.0)]), *existence)
        for name, shift, existence in (("A", 0.0, (0.6, 0.9)), ("B", 0.2, (0.3, 0.5)), ("C", -0.1, (0.8, 0.2)))
    ]
    found = []
    for order in permutations(reports):
        fusion = CovarianceIntersectionFusion(ALL)
        for one in order:
            fusion.add_report(one)
        found.append(fusion.fuse(order, 0.0).existence)
        np.testing.assert_allclose(np.sort(AverageFusion().fuse(order, 0.0).existence), np.sort(found[0]))
    for existence in found[1:]:
        np.testing.assert_array_equal(existence, found[0])
    np.testing.assert_allclose(np.sort(found[0]), np.sort([1 - 0.4 * 0.7 * 0.2, 1 - 0.1 * 0.5 * 0.8]))


def test_existence_after_missed_detection_equals_that_of_the_tracker(report: Make) -> None:
    """A report with 0.9, then one without the object after 0.1 s: survival, then r (1 - p) / (1 - r p)."""
    fusion = CovarianceIntersectionFusion(ALL)
    for held in (report("A", 0.0, [(10.0, 0.0)], score=0.9), report("A", 0.1, [])):
        fusion.add_report(held)
    found = fusion.fuse([held], 0.1).existence
    assert found[0] == pytest.approx(float(missed(np.array(0.9 * np.exp(-0.1 / LIFETIME)))), rel=1e-6)


@pytest.mark.parametrize("has_ids", [False, True])
def test_existence_after_second_detection_equals_hand_calculation(report: Make, fuse: Fuse, has_ids: bool) -> None:
    """r L / (1 - r + r L) with r = 0.8 exp(-0.01), L = 0.1 + 4 / (0.01 · 2 pi S), S = 0.082 + 0.01 · 12² m².

    Ids of objects in segments of CPMs are no tracker."""
    reports = [
        report("A", time, [(x, 0.0)], score=0.8, tracks=(number,) if has_ids else (), complete=not has_ids)
        for time in (0.0, 0.1)
        for x, number in ([(0.0, 1), (90.0, 2)] if has_ids else [(0.0, 1)])
    ]
    before, ratio = 0.8 * np.exp(-0.01), 0.1 + 4.0 / (0.01 * 2.0 * np.pi * (0.082 + 0.01 * 12.0**2))
    expected = before * ratio / (1.0 - before + before * ratio)
    assert fuse(reports, 0.1).existence[0] == pytest.approx(expected, abs=1e-9)


def test_existence_by_a_detector_of_velocities_is_its_last_score(report: Make) -> None:
    """It compares scans, which its reports share: they are not independent. One missed detection does not hide it."""
    fusion, fused = CovarianceIntersectionFusion(ALL), []
    for number, score in enumerate((0.8, 0.8, 0.7, None, None, None)):
        objects = [] if score is None else [(float(number), 0.0)]
        held = report(
            "A",
            0.1 * number,
            objects,
            velocity=(10.0, 0.0),
            velocity_deviation=1.5,
            score=0.0 if score is None else score,
        )
        fusion.add_report(held)
        fused.append(float(fusion.fuse([held], 0.1 * number).existence[0]))
    assert fused[:3] == pytest.approx([0.8, 0.8, 0.7])
    survived = np.exp(-0.1 / LIFETIME)
    assert fused[3] == pytest.approx(0.7 * float(missed(np.array(survived))) / survived, abs=1e-3)
    assert fused[3] > 0.5 > fused[5]


def test_average_without_existence_returns_none(report: Make) -> None:
    fused = AverageFusion().fuse([report("A", 0.0, [(10.0, 0.0)]), report("B", 0.0, [(10.5, 0.0)])], 0.0)
    assert fused.existence.shape == (0,)
    np.testing.assert_array_equal(fused.confidence, fused.scores)


def test_average_existence_uses_scores_of_stations_without_existence(report: Make) -> None:
    one, other = judged(report("A", 0.0, [(10.0, 0.0)]), 0.5), report("B", 0.0, [(10.5, 0.0)], score=0.9)
    assert AverageFusion().fuse([one, other], 0.0).existence.tolist() == pytest.approx([0.95])
    alone = AverageFusion().fuse([one], 0.3)
    assert (alone.time, alone.existence.tolist()) == (0.3, [0.5])


def test_fuse_average_does_not_set_existence(report: Make) -> None:
    """The caller sets the existence probability."""
    known = [report("A", 0.0, [(10.0, 0.0)]).detections, report("B", 0.0, [(10.5, 0.0)]).detections]
    assert fuse_average(known, [0, 0], 0.0).existence.shape == (0,)
