"""Late fusion by averaging, with expectations calculated by hand."""

from __future__ import annotations

import math
from itertools import permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from eidrive_scenario.base.assignment import associate
from eidrive_scenario.base.detections import Detections
from eidrive_scenario.extensions.registry import registry
from eidrive_scenario.fusion.average import AverageFusion, fuse_average
from eidrive_scenario.fusion.method import Report


def report(
    station: str,
    *places: tuple[float, float],
    yaw: float = 0.0,
    length: float = 4.5,
    velocity: tuple[float, float] = (math.nan, math.nan),
    kind: str = "car",
    covariance: float = math.nan,
) -> Report:
    count = len(places)
    boxes = np.array([(x, y, 0.75, length, 1.8, 1.5, yaw) for x, y in places]).reshape(count, 7)
    detections = Detections(
        0.5,
        boxes,
        np.ones(count),
        (kind,) * count,
        np.array([velocity] * count).reshape(count, 2),
        np.array([np.eye(2) * covariance] * count).reshape(count, 2, 2),
    )
    return Report(station, detections, 0.5)


def fuse(*reports: Report) -> Detections:
    return AverageFusion().fuse(reports, 1.0)


def test_average_of_three_reports_of_one_car_is_one_box() -> None:
    """The published code pairs boxes and keeps the third one."""
    fused = fuse(report("A", (10.0, 0.0)), report("B", (11.0, 0.6)), report("C", (12.0, 0.0)))
    assert len(fused) == 1
    np.testing.assert_allclose(fused.boxes[0, :3], [11.0, 0.2, 0.75])
    assert fused.time == 1.0


def test_average_box_has_mean_position_size_velocity_and_circular_yaw() -> None:
    fused = fuse(
        report("A", (10, 0), yaw=math.radians(179), length=4.0, velocity=(2.0, 0.0), covariance=1.0),
        report("B", (12, 0), yaw=math.radians(-177), length=5.0),
        report("C", (11, 3), yaw=math.radians(-179), length=4.5, velocity=(4.0, 1.0), covariance=2.0),
    )
    np.testing.assert_allclose(fused.boxes[0, :6], [11, 1, 0.75, 4.5, 1.8, 1.5])
    assert fused.boxes[0, 6] == pytest.approx(math.radians(-179), abs=1e-4)
    np.testing.assert_allclose(fused.velocity, [[3.0, 0.5]])
    np.testing.assert_allclose(fused.covariance[0], np.eye(2) * 1.5)


@pytest.mark.parametrize(("second", "mean"), [(math.pi, 0.0), (math.pi + 0.2, 0.1), (-math.pi + 0.2, 0.1), (0.4, 0.2)])
def test_average_of_opposite_headings_is_not_across_the_car(second: float, mean: float) -> None:
    """A lidar does not distinguish front and rear: the front is that of the first report."""
    reports = [one.detections for one in (report("A", (10.0, 0.0)), report("B", (10.0, 0.0), yaw=second))]
    assert fuse_average(reports, [0, 0], 1.0).boxes[0, 6] == pytest.approx(mean)


def test_average_of_a_single_box_is_unchanged() -> None:
    fused = fuse(report("A", (10, 0)), report("B", (30, 0), yaw=1.0, velocity=(1.0, 2.0), kind="truck"))
    assert len(fused) == 2
    np.testing.assert_array_equal(fused.boxes[1], [30, 0, 0.75, 4.5, 1.8, 1.5, 1.0])
    np.testing.assert_array_equal(fused.velocity[1], [1.0, 2.0])
    assert np.isnan(fused.velocity[0]).all()
    assert fused.classes == ("car", "truck")


def test_average_gate_is_four_meters() -> None:
    assert len(fuse(report("A", (10, 0)), report("B", (13.99, 0)))) == 1
    assert len(fuse(report("A", (10, 0)), report("B", (14.0, 0)))) == 2


def test_average_keeps_close_cars_of_one_station_separate() -> None:
    fused = fuse(report("A", (10, 0), (10, 2.5)), report("B", (10, 0.2), (10, 2.7)))
    assert len(fused) == 2
    np.testing.assert_allclose(np.sort(fused.boxes[:, 1]), [0.1, 2.6])
    assert len(fuse(report("A", (10, 0), (10, 2.5)))) == 2


def test_average_keeps_senders_that_report_themselves_separate() -> None:
    senders = [
        replace(report("A", (10, 0)), describes_sender=True),
        replace(report("B", (10, 3)), describes_sender=True),
    ]
    for reports in (senders, senders[::-1]):
        assert fuse(*reports).boxes[:, 1].tolist() == [0.0, 3.0]
    seen = fuse(*senders, report("C", (10, 0.2), (10, 3.2)))
    np.testing.assert_allclose(seen.boxes[:, 1], [0.1, 3.1])


def test_associate_minimizes_total_distance_of_the_maximum_assignment() -> None:
    """The nearest pair is not assigned, because the other boxes would then be outside the gate."""
    pairs = associate(
        np.array([[0.0, 0.0, 0.0], [5.0, 0.0, 0.0]]), np.array([[2.0, 0.0, 0.0], [-3.0, 0.0, 0.0]]), gate=4.0
    )
    assert sorted(pairs) == [(0, 1), (1, 0)]
    assert associate(np.zeros((1, 3)), np.array([[3.0, 0, 0], [1.0, 0, 0]]), gate=4.0) == [(0, 1)]
    assert associate(np.empty((0, 3)), np.zeros((2, 3)), gate=4.0) == []


def test_average_class_is_the_most_frequent_one() -> None:
    fused = fuse(
        report("A", (10, 0), kind="van"), report("B", (10, 0), kind="truck"), report("C", (10, 0), kind="truck")
    )
    assert fused.classes == ("truck",)


def test_average_with_missing_and_empty_reports() -> None:
    assert len(fuse()) == 0
    assert len(fuse(report("A"), report("B"))) == 0
    assert len(fuse(report("A"), report("B", (1, 1)))) == 1


PLACES = st.lists(st.tuples(st.floats(-60, 60), st.floats(-60, 60)), max_size=5)


@settings(max_examples=60, deadline=None)
@given(PLACES, PLACES, PLACES)
def test_average_is_independent_of_the_order_of_reports(a: list, b: list, c: list) -> None:  # type: ignore[type-arg]
    reports = [report("A", *a), report("B", *b), report("C", *c)]
    first = fuse(*reports)
    most = max(len(a), len(b), len(c))
    assert most <= len(first) <= len(a) + len(b) + len(c)
    for order in permutations(reports):
        other = fuse(*order)
        np.testing.assert_array_equal(first.boxes, other.boxes)
        assert first.classes == other.classes


@settings(max_examples=40, deadline=None)
@given(st.floats(-3, 3), st.floats(-50, 50), st.floats(-50, 50))
def test_average_is_equivariant_under_rotation_and_translation(angle: float, dx: float, dy: float) -> None:
    places = {"A": [(10.0, 0.0), (30.0, 5.0)], "B": [(11.0, 1.0), (31.0, 4.0)], "C": [(10.5, -1.0)]}
    cos, sin = math.cos(angle), math.sin(angle)

    def transform(x: float, y: float) -> tuple[float, float]:
        return cos * x - sin * y + dx, sin * x + cos * y + dy

    plain = fuse(*(report(name, *points) for name, points in places.items()))
    rotated = fuse(
        *(report(name, *(transform(*point) for point in points), yaw=angle) for name, points in places.items())
    )
    np.testing.assert_allclose(rotated.boxes[:, :2], [transform(*box[:2]) for box in plain.boxes], atol=1e-9)
    np.testing.assert_allclose(np.cos(rotated.boxes[:, 6] - angle), 1.0)


def test_average_is_registered_as_entry_point() -> None:
    assert registry("fusion").load("average") is AverageFusion


number = st.floats(-50.0, 50.0)
perhaps = st.one_of(number, st.just(math.nan))


@st.composite
def several_reports(draw: st.DrawFn) -> tuple[list[Detections], list[int]]:
    """Draw boxes of one to four stations and the object of each, numbered by appearance, at most one per station."""
    reports: list[Detections] = []
    labels: list[int] = []
    for _ in range(draw(st.integers(1, 4))):
        count = draw(st.integers(1, 4))
        known = max(labels, default=-1) + 1
        objects = draw(st.lists(st.integers(0, known + count), min_size=count, max_size=count, unique=True))
        fresh = iter(range(known, known + count))
        labels += [label if label < known else next(fresh) for label in objects]

        def rows(width: int, cell: st.SearchStrategy[float], count: int = count) -> np.ndarray:
            return np.array(
                draw(st.lists(st.lists(cell, min_size=width, max_size=width), min_size=count, max_size=count))
            )

        kinds = draw(st.lists(st.sampled_from(["car", "truck", "van"]), min_size=count, max_size=count))
        scores, covariance = np.abs(rows(1, number))[:, 0], rows(4, perhaps).reshape(-1, 2, 2)
        reports.append(Detections(0.5, rows(7, number), scores, tuple(kinds), rows(2, perhaps), covariance))
    return reports, labels


@pytest.mark.exhaustive
@settings(max_examples=150, deadline=None)
@given(several_reports())
def test_fuse_average_of_any_reports_is_the_mean_of_the_known_values(given: tuple[list[Detections], list[int]]) -> None:
    reports, labels = given
    fused = fuse_average(reports, labels, 1.0)
    for label in range(max(labels) + 1):
        own = np.array(labels) == label
        for name in ("boxes", "scores", "velocity", "covariance"):
            values = np.concatenate([getattr(report, name) for report in reports])[own].reshape(own.sum(), -1)
            known = values[~np.isnan(values).any(axis=1)]
            mean = known.mean(axis=0) if len(known) else np.full(values.shape[1], math.nan)
            got = getattr(fused, name)[label].reshape(-1)
            columns = slice(None, 6) if name == "boxes" else slice(None)
            np.testing.assert_allclose(got[columns], mean[columns], atol=1e-12)
            if len(known) == 1:
                np.testing.assert_array_equal(got, known[0])
