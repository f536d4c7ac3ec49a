"""Fusion for several receiving stations at once: the same bits as a separate call for each."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

import numpy as np
import pytest

from eidrive_scenario.base.detections import CLASSES, Detections
from eidrive_scenario.base.randomness import generator
from eidrive_scenario.fusion import covariance_intersection
from eidrive_scenario.fusion.average import AverageFusion
from eidrive_scenario.fusion.covariance_intersection import CovarianceIntersectionFusion, CovarianceIntersectionSettings
from eidrive_scenario.fusion.early import EarlyFusion
from eidrive_scenario.fusion.method import FusionMethod, Report
from eidrive_scenario.v2x.messages.message import StationState

DT = 0.05


@cache
def arrivals(seed: int) -> list[tuple[float, Report]]:
    """Return reports of up to seven stations on moving and turning objects over 2 s, with their times of arrival.

    Some are late, incomplete, without velocities, covariances or object ids, or of a station with an uncertain pose.
    Objects of every third seed are close to each other, so that their association is ambiguous.
    """
    rng = generator(seed, "arrivals")
    count = int(rng.integers(0, 25))
    place = rng.uniform(-60.0, 60.0, (count, 2))
    if seed % 3 == 0:
        place = np.round(place / 20.0) * 20.0 + rng.normal(0.0, 0.5, (count, 2))
    velocity = rng.normal(0.0, 8.0, (count, 2))
    turn = np.where(rng.random(count) < 0.4, rng.normal(0.0, 0.5, count), 0.0)
    found: list[tuple[float, Report]] = []
    for station in range(int(rng.integers(1, 8))):
        tracked, moving, uncertain, complete, exact = (rng.random(5) < (0.5, 0.5, 0.3, 0.5, 0.7)).tolist()
        for tick in range(station % 2, 40, 2):
            time = DT * tick
            rows = np.flatnonzero(rng.random(count) < 0.85)
            heading = np.arctan2(velocity[rows, 1], velocity[rows, 0]) + turn[rows] * time
            boxes = np.zeros((len(rows), 7))
            boxes[:, :2] = place[rows] + velocity[rows] * time + rng.normal(0.0, 0.2, (len(rows), 2))
            boxes[:, 2:6], boxes[:, 6] = (0.75, 4.5, 1.8, 1.5), heading + rng.normal(0.0, 0.05, len(rows))
            if tick == 10 and len(rows):
                boxes[0, 0] = math.nan
            detections = Detections(
                time,
                boxes,
                rng.uniform(0.05, 1.0, len(rows)),
                tuple(CLASSES[number] for number in rng.integers(0, len(CLASSES), len(rows)).tolist()),
                velocity[rows] if moving else np.full((len(rows), 2), np.nan),
                np.broadcast_to(np.nan if uncertain else 0.04 * np.eye(2), (len(rows), 2, 2)).copy(),
                tuple(rows.tolist()) if tracked else (),
            )
            covariance = None if exact else np.diag([0.1, 0.1, 0.001])
            state = StationState(time, 0.0, 0.0, 0.0, 0.0, 0.0, covariance)
            delay = float(rng.exponential(0.1)) if rng.random() < 0.5 else 0.0
            found.append((time + delay, Report(f"station {station}", detections, time, state, complete)))
    return sorted(found, key=lambda entry: (entry[0], entry[1].station))


def drive(
    methods: Sequence[CovarianceIntersectionFusion], fuse: Callable[..., Sequence[Detections]]
) -> list[list[Detections]]:
    """Return the objects of each method in each tick. Two methods in sequence receive the same messages."""
    pending = [arrivals(number // 2)[::-1] for number in range(len(methods))]
    newest: list[dict[str, Report]] = [{} for _ in methods]
    results = []
    for tick in range(50):
        for method, queue, held in zip(methods, pending, newest, strict=True):
            while queue and queue[-1][0] <= DT * tick:
                report = queue.pop()[1]
                method.add_report(report)
                before = held.get(report.station, report)
                held[report.station] = max(before, report, key=lambda one: one.detections.time)
        results.append(list(fuse(methods, [list(held.values()) for held in newest], DT * tick)))
    return results


def separately(
    methods: Sequence[FusionMethod], reports: Sequence[Sequence[Report]], now: float
) -> Sequence[Detections]:
    return [method.fuse(held, now) for method, held in zip(methods, reports, strict=True)]


def bits(found: Detections) -> tuple[Any, ...]:
    arrays = (found.boxes, found.scores, found.velocity, found.covariance, found.existence)
    return (found.time, found.classes, found.tracks, *(array.tobytes() for array in arrays))


def methods() -> list[CovarianceIntersectionFusion]:
    """Return new methods of 48 stations with three sets of settings."""
    settings = [
        CovarianceIntersectionSettings(),
        CovarianceIntersectionSettings(existence=0.0),
        CovarianceIntersectionSettings(gate=0.9, max_age=0.5),
    ]
    return [CovarianceIntersectionFusion(settings[number // 4 % 3]) for number in range(48)]


@pytest.fixture(scope="module")
def expected() -> list[list[Detections]]:
    """Return the objects of a separate call for each method in each tick."""
    return drive(methods(), separately)


@pytest.mark.exhaustive
@pytest.mark.parametrize("size", [1, 4, 100])
def test_fuse_batch_equals_separate_calls(
    size: int, expected: list[list[Detections]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(covariance_intersection, "_BATCH", size)
    fused = drive(methods(), CovarianceIntersectionFusion.fuse_batch)
    assert [list(map(bits, tick)) for tick in fused] == [list(map(bits, tick)) for tick in expected]
    assert max(len(one) for tick in expected for one in tick) > 15
    assert any(np.isnan(one.velocity).any() for tick in expected for one in tick)


def test_fuse_batch_without_stations_or_reports() -> None:
    assert CovarianceIntersectionFusion.fuse_batch([], [], 1.0) == []
    empty = CovarianceIntersectionFusion.fuse_batch([CovarianceIntersectionFusion() for _ in range(3)], [[]] * 3, 1.0)
    assert [(one.time, len(one)) for one in empty] == [(1.0, 0)] * 3


@pytest.mark.parametrize("method", [AverageFusion, EarlyFusion])
def test_fuse_batch_of_other_methods_equals_separate_calls(
    method: type[FusionMethod], report: Callable[..., Report]
) -> None:
    reports = [
        [report("A", 1.0, [(10.0 * number, 0.0)]), report("B", 1.0, [(10.0 * number, 0.5)])] for number in range(3)
    ]
    batch, others = [method() for _ in reports], [method() for _ in reports]
    for one, other, held in zip(batch, others, reports, strict=True):
        for entry in held:
            one.add_report(entry)
            other.add_report(entry)
    found = method.fuse_batch(batch, reports, 1.1)
    assert [bits(one) for one in found] == [bits(one) for one in separately(others, reports, 1.1)]
    assert [len(one) for one in found] == [1, 1, 1]


def test_fuse_batch_calls_an_overridden_fuse(report: Callable[..., Report]) -> None:
    class First(CovarianceIntersectionFusion):
        def fuse(self, reports: Sequence[Report], now: float) -> Detections:
            return reports[0].detections

    reports = [[report("A", 1.0, [(1.0, 0.0)])], [report("A", 1.0, [(2.0, 0.0)])]]
    found = First.fuse_batch([First(), First()], reports, 1.0)
    assert [one.boxes[0, 0] for one in found] == [1.0, 2.0]
