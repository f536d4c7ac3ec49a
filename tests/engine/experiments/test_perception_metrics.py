"""Metrics of cooperative perception, against manual calculations."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from perception_metrics import (
    MetricSample,
    metric_sample,
    position_error,
    precision_bev,
    recall_by_sight,
)
from scenario_1 import ONE, FrameCollector, simulate

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.extensions.registry import registry
from eidrive_scenario.fusion.covariance_intersection import CovarianceIntersectionFusion
from eidrive_scenario.fusion.method import Report

LENGTH = 4.5


def boxes(*points: tuple[float, float]) -> NDArray[np.float64]:
    return np.array([(x, y, 0.75, LENGTH, 1.8, 1.5, 0.0) for x, y in points]).reshape(-1, 7)


def fused(*entries: tuple[float, float, float]) -> Detections:
    """Return detections at x, y with a score."""
    count = len(entries)
    return Detections(
        0.0,
        boxes(*((x, y) for x, y, _ in entries)),
        np.array([score for _, _, score in entries]),
        ("car",) * count,
        np.full((count, 2), np.nan),
        np.full((count, 2, 2), np.nan),
    )


def sample(
    detections: Detections, objects: NDArray[np.float64], own: list[bool] | None = None, other: list[bool] | None = None
) -> MetricSample:
    none = np.zeros(len(objects), dtype=bool)
    return MetricSample(
        detections,
        objects,
        np.array(own, dtype=bool) if own is not None else none,
        np.array(other, dtype=bool) if other is not None else none,
    )


def test_precision_bev_sorts_detections_over_all_samples() -> None:
    """The false detection of the second sample has the highest score: the objects have precisions of 1/2 and 2/3."""
    first = sample(fused((0, 0, 0.8)), boxes((0, 0)))
    second = sample(fused((50, 0, 0.9), (10, 0, 0.3)), boxes((10, 0)))
    assert precision_bev([first, second], 0.5) == pytest.approx(0.5 * 2 / 3 + 0.5 * 2 / 3)
    assert precision_bev([second, first], 0.5) == precision_bev([first, second], 0.5)
    assert precision_bev([first], 0.5) == 1.0
    assert math.isnan(precision_bev([sample(fused(), boxes())], 0.5))


def test_precision_bev_counts_duplicate_detection_as_false() -> None:
    """Of two boxes on one car, the one with the higher score is correct."""
    twice = sample(fused((0, 0, 0.9), (0.2, 0, 0.8), (20, 0, 0.7)), boxes((0, 0), (20, 0)))
    assert precision_bev([twice], 0.5) == pytest.approx(0.5 + 0.5 * 2 / 3)


def test_recall_by_sight_separates_own_other_and_hidden_objects() -> None:
    objects = boxes((0, 0), (10, 0), (20, 0), (30, 0), (40, 0))
    mixed = sample(
        fused((0, 0, 0.9), (20, 0, 0.9), (40, 0, 0.1)),
        objects,
        own=[True, True, False, False, False],
        other=[True, False, True, True, False],
    )
    recall = recall_by_sight([mixed], 0.5)
    assert recall.own is not None
    assert recall.others is not None
    assert recall.neither is not None
    assert (recall.own.successes, recall.own.trials) == (1, 2)
    assert (recall.others.successes, recall.others.trials) == (1, 2)
    assert (recall.neither.successes, recall.neither.trials) == (1, 1)
    assert recall_by_sight([sample(fused(), boxes((0, 0)), own=[True])], 0.5).others is None


def test_position_error_pairs_nearest_objects_first() -> None:
    two = sample(fused((1.0, 0, 0.5), (3.0, 0, 0.9), (9.0, 0, 0.9)), boxes((0, 0), (3.5, 0)))
    assert position_error([two]) == pytest.approx(math.sqrt((1.0 + 0.25) / 2.0))
    assert math.isnan(position_error([sample(fused((9, 0, 1)), boxes((0, 0)))]))
    assert math.isnan(position_error([]))


@pytest.mark.parametrize(("min_iou", "knee"), [(0.7, 0.79), (0.5, 1.5)])
def test_precision_bev_of_delayed_report_falls_at_shift_limit(min_iou: float, knee: float) -> None:
    """A shift s leaves an overlap of (L - s) / (L + s): 0.7 at 0.79 m, 0.5 at 1.5 m. Prediction keeps the overlap."""
    speed = 15.0
    for shift, lost in ((0.97 * knee, False), (1.03 * knee, True)):
        delay = shift / speed
        seen = Detections(0.0, boxes((0, 0)), np.ones(1), ("car",), np.array([[speed, 0.0]]), np.zeros((1, 2, 2)))
        report, truth = Report("RSU", seen, delay), boxes((shift, 0.0))
        stale = registry("fusion").load("average")().fuse([report], delay)
        assert precision_bev([sample(stale, truth)], min_iou) == (0.0 if lost else 1.0)
        fusion = CovarianceIntersectionFusion()
        fusion.add_report(report)
        assert precision_bev([sample(fusion.fuse([report], delay), truth)], min_iou) == 1.0


def test_recall_by_sight_of_scenario_1_requires_cooperation_for_hidden_car() -> None:
    """At first only the roadside unit sees the incoming car, so the ego detects it only from messages of the unit."""

    def recall(channel: str) -> tuple[float, float]:
        collector = FrameCollector()
        simulate(ONE, channel, collector, time_limit=2.0)
        samples = [metric_sample(frame, "Ego", reach=60.0) for frame in collector.frames]
        assert {len(each.objects) for each in samples} == {2}, "the truck and the car, not the stations"
        found = recall_by_sight(samples, 0.3)
        assert found.own is not None
        assert found.others is not None
        return found.own.share, found.others.share

    alone_own, alone_others = recall("none")
    helped_own, helped_others = recall("ideal")
    assert alone_others == 0.0
    assert helped_others > 0.9
    assert alone_own > 0.9
    assert helped_own > 0.9
