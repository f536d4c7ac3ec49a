"""Existence of fused objects: what is counted once, and in which order."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest

from eidrive_scenario.detections import Detections
from eidrive_scenario.fusion.average import AverageFusion, fuse_average, fuse_average_small
from eidrive_scenario.fusion.covariance_intersection import CovarianceIntersectionFusion, CovarianceIntersectionSettings
from eidrive_scenario.fusion.method import Report
from eidrive_scenario.perception.tracking.existence import LIFETIME, missed

Make = Callable[..., Report]
Fuse = Callable[..., Detections]

ALL = CovarianceIntersectionSettings(existence=0.0)


def judged(report: Report, *existence: float) -> Report:
    """The same report of a station that tracks and states these probabilities."""
    found = report.detections
    tracks = found.tracks or tuple(range(1, len(found) + 1))
    return replace(report, detections=replace(found, existence=np.array(existence), tracks=tracks))


def test_lone_station_existence_is_passed_on(report: Make, fuse: Fuse) -> None:
    fused = fuse([judged(report("A", 0.0, [(10.0, 0.0)], score=0.9), 0.7)], 0.0)
    assert fused.existence.tolist() == pytest.approx([0.7])
    assert fused.scores.tolist() == pytest.approx([0.9])


def test_repeated_reports_of_a_station_that_tracks_count_once(report: Make, fuse: Fuse) -> None:
    """Ten reports of a track with 0.6 leave 0.6: its station has counted the past already."""
    velocity = (5.0, 0.0)
    reports = [
        judged(report("A", 0.05 * tick, [(10.0 + 0.25 * tick, 0.0)], velocity=velocity), 0.6) for tick in range(10)
    ]
    assert fuse(reports, 0.45).existence.tolist() == pytest.approx([0.6])
    still = [judged(report("A", 0.05 * tick, [(10.0, 0.0)]), 0.6) for tick in range(10)]
    assert fuse(still, 0.45).existence.tolist() == pytest.approx([0.6]), "also where it states no velocity"


def test_a_track_that_loses_existence_at_its_station_loses_it_everywhere(report: Make) -> None:
    fusion = CovarianceIntersectionFusion()
    counts = []
    for tick, existence in enumerate((0.95, 0.7, 0.45, 0.2)):
        known = judged(report("A", 0.1 * tick, [(10.0, 0.0)], velocity=(0.0, 0.0)), existence)
        fusion.add_report(known)
        counts.append(len(fusion.fuse([known], 0.1 * tick)))
    assert counts == [1, 1, 0, 0]


def test_existence_of_two_stations_is_that_of_at_least_one(report: Make) -> None:
    one, other = judged(report("A", 0.0, [(10.0, 0.0)]), 0.6), judged(report("B", 0.0, [(10.1, 0.0)]), 0.5)
    for fusion in (CovarianceIntersectionFusion(), AverageFusion()):
        for held in (one, other):
            fusion.add_report(held)
        assert fusion.fuse([one, other], 0.0).existence.tolist() == pytest.approx([0.8])


def test_existence_does_not_depend_on_the_order_of_stations(report: Make) -> None:
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


def test_untracked_miss_follows_the_tracker_and_time_takes_its_share(report: Make) -> None:
    """One report of 0.9, one without it 0.1 s later: survival, then r (1 - p) / (1 - r p)."""
    fusion = CovarianceIntersectionFusion(ALL)
    for held in (report("A", 0.0, [(10.0, 0.0)], score=0.9), report("A", 0.1, [])):
        fusion.add_report(held)
    found = fusion.fuse([held], 0.1).existence
    assert found[0] == pytest.approx(float(missed(np.array(0.9 * np.exp(-0.1 / LIFETIME)))), rel=1e-6)


def test_average_without_existence_states_none(report: Make) -> None:
    fused = AverageFusion().fuse([report("A", 0.0, [(10.0, 0.0)]), report("B", 0.0, [(10.5, 0.0)])], 0.0)
    assert fused.existence.shape == (0,)
    np.testing.assert_array_equal(fused.confidence, fused.scores)


def test_average_takes_scores_where_one_station_states_no_existence(report: Make) -> None:
    one, other = judged(report("A", 0.0, [(10.0, 0.0)]), 0.5), report("B", 0.0, [(10.5, 0.0)], score=0.9)
    assert AverageFusion().fuse([one, other], 0.0).existence.tolist() == pytest.approx([0.95])
    alone = AverageFusion().fuse([one], 0.3)
    assert (alone.time, alone.existence.tolist()) == (0.3, [0.5])


def test_average_ways_agree_on_all_but_existence(report: Make) -> None:
    """The ways in plain numbers and in arrays leave existence to their caller."""
    known = [report("A", 0.0, [(10.0, 0.0)]).detections, report("B", 0.0, [(10.5, 0.0)]).detections]
    assert (
        fuse_average(known, [0, 0], 0.0).existence.shape
        == fuse_average_small(known, [0, 0], 0.0).existence.shape
        == (0,)
    )
