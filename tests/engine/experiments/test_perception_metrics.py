"""Metrics of cooperative perception, by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from eidrive_scenario.detections import Detections
from eidrive_scenario.experiments.perception_metrics import (
    MetricSample,
    position_error,
    precision_bev,
    recall_by_sight,
    snapshot,
)
from eidrive_scenario.fusion.covariance_intersection import CovarianceIntersectionFusion
from eidrive_scenario.fusion.method import Report
from eidrive_scenario.library import resolve_scenario
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.registry import registry
from eidrive_scenario.simulation import RunSettings, run_file

LENGTH = 4.5


def boxes(*places: tuple[float, float]) -> np.ndarray:
    return np.array([(x, y, 0.75, LENGTH, 1.8, 1.5, 0.0) for x, y in places]).reshape(-1, 7)


def known(*found: tuple[float, float, float]) -> Detections:
    """Boxes at x, y with a score."""
    count = len(found)
    return Detections(
        0.0,
        boxes(*((x, y) for x, y, _ in found)),
        np.array([score for _, _, score in found]),
        ("car",) * count,
        np.full((count, 2), np.nan),
        np.full((count, 2, 2), np.nan),
    )


def entry(
    detections: Detections, objects: np.ndarray, own: list[bool] | None = None, other: list[bool] | None = None
) -> MetricSample:
    none = np.zeros(len(objects), dtype=bool)
    return MetricSample(
        detections,
        objects,
        np.array(own, dtype=bool) if own is not None else none,
        np.array(other, dtype=bool) if other is not None else none,
    )


def test_average_precision_sorts_over_the_whole_set() -> None:
    """Surest is a ghost in the second snapshot: of two objects one is found, with precision 1/2; the other, 2/3."""
    first = entry(known((0, 0, 0.8)), boxes((0, 0)))
    second = entry(known((50, 0, 0.9), (10, 0, 0.3)), boxes((10, 0)))
    assert precision_bev([first, second], 0.5) == pytest.approx(0.5 * 2 / 3 + 0.5 * 2 / 3)
    assert precision_bev([second, first], 0.5) == precision_bev([first, second], 0.5)
    assert precision_bev([first], 0.5) == 1.0
    assert math.isnan(precision_bev([entry(known(), boxes())], 0.5))


def test_an_object_is_found_once() -> None:
    """Two boxes on one car: the surer one counts, the other is false."""
    twice = entry(known((0, 0, 0.9), (0.2, 0, 0.8), (20, 0, 0.7)), boxes((0, 0), (20, 0)))
    assert precision_bev([twice], 0.5) == pytest.approx(0.5 + 0.5 * 2 / 3)


def test_recall_by_who_can_see() -> None:
    objects = boxes((0, 0), (10, 0), (20, 0), (30, 0), (40, 0))
    told = entry(
        known((0, 0, 0.9), (20, 0, 0.9), (40, 0, 0.1)),
        objects,
        own=[True, True, False, False, False],
        other=[True, False, True, True, False],
    )
    recall = recall_by_sight([told], 0.5)
    assert recall.own is not None
    assert recall.others is not None
    assert recall.neither is not None
    assert (recall.own.successes, recall.own.trials) == (1, 2)
    assert (recall.others.successes, recall.others.trials) == (1, 2)
    assert (recall.neither.successes, recall.neither.trials) == (1, 1)
    assert recall_by_sight([entry(known(), boxes((0, 0)), own=[True])], 0.5).others is None


def test_error_of_position_pairs_the_nearest_first() -> None:
    told = entry(known((1.0, 0, 0.5), (3.0, 0, 0.9), (9.0, 0, 0.9)), boxes((0, 0), (3.5, 0)))
    assert position_error([told]) == pytest.approx(math.sqrt((1.0 + 0.25) / 2.0))
    assert math.isnan(position_error([entry(known((9, 0, 1)), boxes((0, 0)))]))
    assert math.isnan(position_error([]))


@pytest.mark.parametrize(("least", "knee"), [(0.7, 0.79), (0.5, 1.5)])
def test_delay_costs_precision_where_the_overlap_of_a_car_says(least: float, knee: float) -> None:
    """A shift s leaves an overlap of (L - s) / (L + s): 0.7 is lost at 0.79 m, 0.5 at 1.5 m. Prediction keeps it."""
    speed = 15.0
    for shift, lost in ((0.97 * knee, False), (1.03 * knee, True)):
        delay = shift / speed
        seen = Detections(0.0, boxes((0, 0)), np.ones(1), ("car",), np.array([[speed, 0.0]]), np.zeros((1, 2, 2)))
        report, now = Report("RSU", seen, delay), [entry(known(), boxes((shift, 0.0)))]
        stale = registry("fusion").load("average")().fuse([report], delay)
        assert precision_bev([entry(stale, now[0].objects)], least) == (0.0 if lost else 1.0)
        fusion = CovarianceIntersectionFusion()
        fusion.add_report(report)
        assert precision_bev([entry(fusion.fuse([report], delay), now[0].objects)], least) == 1.0


def test_a_run_told_by_snapshots() -> None:
    """Scenario 1: the incoming car is seen by the unit alone at first, and known by the ego through it alone."""
    frames: list[Frame] = []

    class Watch:
        def observe(self, frame: Frame) -> None:
            frames.append(frame)

        def close(self) -> None:
            pass

    def recall(channel: str) -> tuple[float, float]:
        frames.clear()
        settings = RunSettings(channel=channel, time_limit=2.0)
        run_file(resolve_scenario("coop/scenario_1"), seed=1, settings=settings, observers=[Watch()])
        taken = [snapshot(frame, "Ego", reach=60.0) for frame in frames]
        assert {len(each.objects) for each in taken} == {2}, "the truck and the car, not the stations"
        found = recall_by_sight(taken, 0.3)
        assert found.own is not None
        assert found.others is not None
        return found.own.share, found.others.share

    alone_own, alone_others = recall("none")
    helped_own, helped_others = recall("ideal")
    assert alone_others == 0.0
    assert helped_others > 0.9
    assert alone_own > 0.9
    assert helped_own > 0.9
