"""Reports that overtake each other."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from eidrive_scenario.detections import Detections
from eidrive_scenario.fusion.covariance_intersection import CovarianceIntersectionFusion
from eidrive_scenario.fusion.method import Report
from eidrive_scenario.fusion.pairs import AssociationGate
from eidrive_scenario.fusion.report_history import ReportHistory
from eidrive_scenario.randomness import generator

Make = Callable[..., Report]
Fuse = Callable[..., Detections]


def drive(report: Make, seed: int, *, tracked: bool) -> list[Report]:
    """Two stations on three cars for 1.5 s at 20 Hz: noise, misses, one car that enters late, some boxes reversed."""
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
def test_out_of_order_is_as_good_as_in_order(seed: int, tracked: bool, report: Make, fuse: Fuse) -> None:
    reports = drive(report, seed, tracked=tracked)
    rng = generator(seed, "delays")
    late = sorted(reports, key=lambda given: given.detections.time + rng.uniform(0.0, 0.6))
    assert [given.detections.time for given in late] != [given.detections.time for given in reports]
    assert_equal(fuse(reports, 1.5), fuse(late, 1.5))


@pytest.mark.parametrize("tracked", [True, False])
def test_so_it_is_when_each_is_fused_as_it_comes(tracked: bool, report: Make) -> None:
    """Between the arrivals somebody asks for the objects: what is rolled back was in use already."""
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


def test_a_late_report_counts(report: Make, fuse: Fuse) -> None:
    """Two places and the way between them make a velocity, whichever of both comes first."""
    first, second = report("A", 0.0, [(0.0, 0.0)], covariance=1e-4), report("A", 0.5, [(5.0, 0.0)], covariance=1e-4)
    fused = fuse([second, first], 0.5)
    assert fused.velocity[0, 0] == pytest.approx(10.0, abs=0.2)
    assert np.isnan(fuse([second], 0.5).velocity).all()


def test_one_that_is_older_than_all_that_is_remembered_comes_too_late(report: Make) -> None:
    """Then it does not count, and is not taken for the start of all."""
    memory = ReportHistory(1.0, AssociationGate.of(0.99, 4.0))
    times = np.arange(0.0, 3.01, 0.1).tolist()
    for time in times:
        memory.add_report(report("A", time, [(10.0 * time, 0.0)], covariance=0.01))
        memory.tracks()
    before = memory.tracks().copy()
    memory.add_report(report("A", 1.0, [(10.0, 0.0)], covariance=0.01))
    np.testing.assert_array_equal(memory.tracks(), before)
    memory.add_report(report("A", 2.05, [(20.5, 0.0)], covariance=0.01))
    assert not np.array_equal(memory.tracks(), before)


def test_a_report_heard_twice_counts_once(report: Make, fuse: Fuse) -> None:
    reports = drive(report, 1, tracked=False)
    assert_equal(fuse(reports, 1.5), fuse([*reports, *reports[-8:], reports[-3]], 1.5))


def test_the_memory_stays_small(report: Make) -> None:
    memory = ReportHistory(1.0, AssociationGate.of(0.99, 4.0))
    for tick in range(400):
        memory.add_report(report("A", 0.05 * tick, [(0.5 * tick, 0.0)], covariance=0.01))
        memory.tracks()
    assert len(memory._histories[0].entries) <= 22
    assert len(memory.tracks()) == 1


def test_stations_that_have_gone_are_forgotten_and_nobody_notices(
    report: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A new car passes every second, for a minute; one station comes back after a while, late and out of order."""
    rng = generator(1, "passers-by")
    heard: list[tuple[float, Report]] = []
    for tick in range(1200):
        time = 0.05 * tick
        for number in range(60):
            if number <= time < number + 3.0 or (number == 2 and time > 30.0):
                place = (10.0 * time + rng.normal(0.0, 0.2), 8.0 * (number % 3))
                said = report(f"car {number}", time, [place], velocity=(math.nan, math.nan))
                heard.append((time + rng.uniform(0.0, 0.4), said))
    heard.sort(key=lambda entry: entry[0])

    def fused() -> tuple[list[Detections], CovarianceIntersectionFusion]:
        fusion = CovarianceIntersectionFusion()
        pictures, newest, waiting = [], {}, list(reversed(heard))
        for tick in range(1200):
            now = 0.05 * tick
            while waiting and waiting[-1][0] <= now:
                said = waiting.pop()[1]
                fusion.add_report(said)
                newest[said.station] = max(said, newest.get(said.station, said), key=lambda one: one.detections.time)
            pictures.append(fusion.fuse(list(newest.values()), now))
        return pictures, fusion

    forgetting, fusion = fused()
    assert len(fusion._memory.stations) < 12
    assert len(fusion._memory.tracks()) < 12
    monkeypatch.setattr(ReportHistory, "evict_stale", lambda memory, now: None)
    remembering, fusion = fused()
    assert len(fusion._memory.stations) == 60
    assert max(map(len, forgetting)) > 2
    for one, other in zip(forgetting, remembering, strict=True):
        assert_equal(one, other)
