"""Out-of-sequence reports, retention and eviction."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from msgspec.structs import replace

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.base.randomness import generator
from eidrive_scenario.fusion.covariance_intersection import CovarianceIntersectionFusion
from eidrive_scenario.fusion.method import Report
from eidrive_scenario.fusion.pairs import AssociationGate
from eidrive_scenario.fusion.report_history import ReportHistory

GATE = AssociationGate.of(0.99, 4.0)

Make = Callable[..., Report]
Fuse = Callable[..., Detections]


def drive(report: Make, seed: int, *, tracked: bool) -> list[Report]:
    """Return reports of two stations on three cars over 1.5 s at 20 Hz.

    They have noise, missed detections, a car that enters late, and some reversed boxes.
    """
    rng = generator(seed, "drive")
    reports = []
    for tick in range(30):
        time = 0.05 * tick
        cars = [((10.0 * time, 0.0), (10.0, 0.0)), ((40.0 - 8.0 * time, 6.0), (-8.0, 0.0))]
        if tick >= 10:
            cars.append(((20.0, 20.0 - 5.0 * time), (0.0, -5.0)))
        for station in "AB":
            seen = [(place, velocity) for place, velocity in cars if rng.random() > 0.15]
            reports.append(
                report(
                    station,
                    time,
                    [tuple(np.add(place, rng.normal(size=2) * 0.2)) for place, _ in seen],
                    velocity=[velocity for _, velocity in seen] if tracked and seen else (math.nan, math.nan),
                    yaw=[math.atan2(velocity[1], velocity[0]) + math.pi * (rng.random() < 0.1) for _, velocity in seen],
                    score=float(rng.uniform(0.4, 1.0)),
                )
            )
    return reports


def assert_equal(one: Detections, other: Detections) -> None:
    assert len(one) == len(other)
    for name in ("boxes", "scores", "velocity", "covariance"):
        np.testing.assert_allclose(getattr(one, name), getattr(other, name), rtol=0.0, atol=1e-9)
    assert one.classes == other.classes


@pytest.mark.parametrize("tracked", [True, False])
@pytest.mark.parametrize("seed", range(6))
def test_fuse_out_of_sequence_reports_equals_reports_in_sequence(
    seed: int, tracked: bool, report: Make, fuse: Fuse
) -> None:
    reports = drive(report, seed, tracked=tracked)
    rng = generator(seed, "delays")
    late = sorted(reports, key=lambda given: given.detections.time + rng.uniform(0.0, 0.6))
    assert [given.detections.time for given in late] != [given.detections.time for given in reports]
    assert_equal(fuse(reports, 1.5), fuse(late, 1.5))


@pytest.mark.parametrize("tracked", [True, False])
def test_fuse_after_each_report_equals_reports_in_sequence(tracked: bool, report: Make) -> None:
    """Rollback also applies to tracks that were already returned."""
    reports = drive(report, 3, tracked=tracked)
    rng = generator(3, "delays")
    late = sorted(reports, key=lambda given: given.detections.time + rng.uniform(0.0, 0.6))
    in_order, out_of_order = CovarianceIntersectionFusion(), CovarianceIntersectionFusion()
    for first, second in zip(reports, late, strict=True):
        in_order.add_report(first)
        in_order.fuse([first], first.detections.time)
        out_of_order.add_report(second)
        out_of_order.fuse([second], second.detections.time + 0.3)
    newest = reports[-2:]
    assert_equal(in_order.fuse(newest, 1.5), out_of_order.fuse(newest, 1.5))


def test_fuse_late_report_contributes_to_the_velocity(report: Make, fuse: Fuse) -> None:
    """Two positions determine a velocity in any order of arrival."""
    first, second = report("A", 0.0, [(0.0, 0.0)], covariance=1e-4), report("A", 0.5, [(5.0, 0.0)], covariance=1e-4)
    fused = fuse([second, first], 0.5)
    assert fused.velocity[0, 0] == pytest.approx(10.0, abs=0.2)
    assert np.isnan(fuse([second], 0.5).velocity).all()


def processed_rows(history: ReportHistory, station: str = "A") -> bytes:
    """Return the tracks of a station after all reports."""
    ReportHistory.process([history])
    return history.tracks((station,)).tobytes()


def test_report_history_ignores_reports_older_than_all_stored_ones(report: Make) -> None:
    """Such a report does not restart the tracks either."""
    history = ReportHistory(1.0, GATE)
    times = np.arange(0.0, 3.01, 0.1).tolist()
    for time in times:
        history.add_report(report("A", time, [(10.0 * time, 0.0)], covariance=0.01))
        processed_rows(history)
    before = processed_rows(history)
    history.add_report(report("A", 1.0, [(10.0, 0.0)], covariance=0.01))
    assert processed_rows(history) == before
    history.add_report(report("A", 2.05, [(20.5, 0.0)], covariance=0.01))
    assert processed_rows(history) != before


def test_fuse_duplicate_reports_count_once(report: Make, fuse: Fuse) -> None:
    reports = drive(report, 1, tracked=False)
    assert_equal(fuse(reports, 1.5), fuse([*reports, *reports[-8:], reports[-3]], 1.5))


@pytest.mark.parametrize("later", [False, True])
def test_fuse_segments_of_one_message_equals_the_whole_message(later: bool, report: Make, fuse: Fuse) -> None:
    """Segments have the same time of measurement; the second can arrive in a later tick, the first twice."""
    places = [(0.0, 0.0), (0.9, 0.0), (20.0, 0.0), (40.0, 0.0)]
    whole = report("A", 0.1, places, tracks=(1, 2, 3, 4), kind="pedestrian", size=(0.5, 0.5, 1.8), complete=False)
    before = report("A", 0.0, places[:2], tracks=(1, 2), kind="pedestrian", size=(0.5, 0.5, 1.8), complete=False)
    first, second = (replace(whole, detections=whole.detections.subset(rows)) for rows in ((0, 2), (1, 3)))
    fusion = CovarianceIntersectionFusion()
    fuse([before, first, *([] if later else [second, first])], 0.1, fusion)
    fused = fuse([second, first] if later else [first], 0.3, fusion)
    assert_equal(fuse([before, whole], 0.3), fused.subset(np.argsort(fused.boxes[:, 0]).tolist()))


def test_report_history_has_bounded_size(report: Make) -> None:
    history = ReportHistory(1.0, GATE)
    for tick in range(400):
        history.add_report(report("A", 0.05 * tick, [(0.5 * tick, 0.0)], covariance=0.01))
        processed_rows(history)
    assert len(history._histories["A"].entries) <= 22
    assert len(history.tracks(("A",))) == 1


@pytest.mark.exhaustive
def test_evict_stale_does_not_change_the_fused_objects(report: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    """A new station passes every second for half a minute; one returns later with out-of-sequence reports."""
    rng = generator(1, "passers-by")
    arrivals: list[tuple[float, Report]] = []
    for tick in range(600):
        time = 0.05 * tick
        for number in range(30):
            if number <= time < number + 3.0 or (number == 2 and time > 15.0):
                place = (10.0 * time + rng.normal(0.0, 0.2), 8.0 * (number % 3))
                sent = report(f"car {number}", time, [place], velocity=(math.nan, math.nan))
                arrivals.append((time + rng.uniform(0.0, 0.4), sent))
    arrivals.sort(key=lambda entry: entry[0])

    def fuse_all() -> tuple[list[Detections], CovarianceIntersectionFusion]:
        fusion = CovarianceIntersectionFusion()
        lists: list[Detections] = []
        newest: dict[str, Report] = {}
        pending = list(reversed(arrivals))
        for tick in range(600):
            now = 0.05 * tick
            while pending and pending[-1][0] <= now:
                sent = pending.pop()[1]
                fusion.add_report(sent)
                newest[sent.station] = max(sent, newest.get(sent.station, sent), key=lambda one: one.detections.time)
            lists.append(fusion.fuse(list(newest.values()), now))
        return lists, fusion

    evicting, fusion = fuse_all()
    assert len(fusion._history._histories) < 12
    assert len(fusion._history.tracks(tuple(sorted(fusion._history._histories)))) < 12
    monkeypatch.setattr(ReportHistory, "evict_stale", lambda history, now: None)
    retaining, fusion = fuse_all()
    assert len(fusion._history._histories) == 30
    assert max(map(len, evicting)) > 2
    for one, other in zip(evicting, retaining, strict=True):
        assert_equal(one, other)
