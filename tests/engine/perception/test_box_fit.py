"""Fit of L-shapes and boxes, with completion of hidden parts."""

from __future__ import annotations

import math

import numpy as np
import pytest

from eidrive_scenario.perception.geometry.lidar_geometry import Pattern
from eidrive_scenario.perception.lidar.box_fit import HEADINGS, Fit, _find_nearest_edges, fit_box, rectangles

PATTERN = Pattern(math.radians(1.0), math.radians(1.0), math.radians(15.0))
CLASSES = ("car", "van", "truck", "bus", "motorbike", "bicycle", "pedestrian")


def outline(x: float, y: float, length: float, width: float, yaw: float, step: float = 0.1) -> np.ndarray:
    """Return points on the sides of a rectangle that face the origin."""
    along, across = (np.arange(-size / 2, size / 2 + 1e-9, step) for size in (length, width))
    sides = [(np.column_stack([along, np.full(len(along), s * width / 2)]), (0.0, s)) for s in (1.0, -1.0)] + [
        (np.column_stack([np.full(len(across), s * length / 2), across]), (s, 0.0)) for s in (1.0, -1.0)
    ]
    turn = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
    visible = []
    for points, normal in sides:
        placed = points @ turn.T + (x, y)
        if (turn @ normal) @ placed.mean(axis=0) < 0.0:
            visible.append(placed)
    return np.concatenate(visible)


def standing(plan: np.ndarray, height: float) -> np.ndarray:
    """Return the points at several heights up to a top."""
    levels = np.linspace(0.3, height, 5)
    return np.concatenate([np.column_stack([plan, np.full(len(plan), level)]) for level in levels])


def fit(points: np.ndarray, **options: object) -> Fit:
    given = {"sensor_height": 1.9, "ground": 0.0, "pattern": PATTERN, "classes": CLASSES}
    return fit_box(points, **{**given, **options})  # type: ignore[arg-type]


@pytest.mark.parametrize("degrees", [0, 10, 25, 44, 46, 70, 89])
def test_rectangles_of_l_shape_return_its_heading(degrees: int) -> None:
    shape = rectangles(outline(12, 4, 4.6, 1.8, math.radians(degrees)))[0]
    off = math.degrees(shape.yaw) - degrees
    assert (off + 45) % 90 - 45 == pytest.approx(0.0, abs=0.51)


def test_rectangles_with_noise_have_small_heading_error() -> None:
    rng = np.random.default_rng(5)
    offs = []
    for degrees in range(5, 85, 5):
        plan = outline(12, 4, 4.6, 1.8, math.radians(degrees), step=0.3)
        shape = rectangles(plan + rng.normal(0, 0.03, plan.shape))[0]
        offs.append((math.degrees(shape.yaw) - degrees + 45) % 90 - 45)
    assert max(map(abs, offs)) < 5.0
    assert np.std(offs) < 2.0


@pytest.mark.parametrize(
    ("name", "size"),
    [
        ("car", (4.6, 1.85, 1.5)),
        ("van", (5.8, 2.1, 2.5)),
        ("truck", (8.4, 2.7, 3.6)),
        ("bus", (11.5, 2.7, 3.4)),
        ("motorbike", (2.2, 0.8, 1.5)),
        ("pedestrian", (0.5, 0.5, 1.75)),
    ],
)
@pytest.mark.parametrize("degrees", [20, 60])
def test_fit_box_of_complete_object_returns_class_and_box(
    name: str, size: tuple[float, float, float], degrees: int
) -> None:
    length, width, height = size
    dense = Pattern(math.radians(0.1), math.radians(0.1), math.radians(15.0))
    found = fit(standing(outline(14, 3, length, width, math.radians(degrees)), height), pattern=dense)
    assert found.name == name
    assert math.dist(found.box[:2], (14, 3)) < 0.2
    assert found.box[3:6] == pytest.approx(size, abs=0.25)
    if name != "pedestrian":
        off = math.degrees(found.box[6]) - degrees
        assert (off + 90) % 180 - 90 == pytest.approx(0.0, abs=2.0)


def test_fit_box_of_rear_is_completed_away_from_sensor() -> None:
    """Only the rear of a car straight ahead, 1.85 m wide at x = 15: the center is half a usual length behind it."""
    rear = np.column_stack([np.full(19, 15.0), np.linspace(-0.925, 0.925, 19)])
    found = fit(standing(rear, 1.5))
    assert found.name == "car"
    assert found.box[0] == pytest.approx(15.0 + 2.3, abs=0.05)
    assert found.box[1] == pytest.approx(0.0, abs=0.02)
    assert abs(found.box[6]) < 0.02
    assert found.covariance[0, 0] == pytest.approx((0.35 / 2) ** 2, rel=0.1)
    assert found.covariance[1, 1] < 0.01


def test_fit_box_hidden_end_is_completed_behind_occluder() -> None:
    """The front 2 m of a car that crosses from the left; a truck hides the rest, so the left end is hidden.

    The other end is anywhere in the gap before the next column of rays, 20 m away and 1° aside.
    """
    flank = np.column_stack([np.full(21, 20.0), np.linspace(-1.0, 1.0, 21)])
    left, right, none = (
        fit(standing(flank, 1.5), hidden=flags, classes=("car",))
        for flags in ((True, False), (False, True), (False, False))
    )
    gap = 20.0 * math.radians(1.0)
    assert left.box[1] == pytest.approx(-1.0 - gap / 2.0 + 2.3, abs=0.05)
    assert right.box[1] == pytest.approx(1.0 + gap / 2.0 - 2.3, abs=0.05)
    assert none.box[1] == pytest.approx(0.0, abs=0.05)


def test_fit_box_cut_by_field_of_view_is_completed_beyond_it() -> None:
    """The near end of a truck's flank, 3 m of 8.2 m, parallel to the sensor heading on the left; the rest is behind.

    The end that faces the sensor is fixed; only the other end extends beyond the field of view.
    """
    rear = np.column_stack([np.full(14, 6.0), np.linspace(3.0, 5.6, 14)])
    flank = np.column_stack([np.linspace(6.0, 9.0, 16), np.full(16, 3.0)])
    # Viewed from the origin, the flank is to the right of the rear; the field of view ends at its right end.
    points = standing(np.concatenate([rear, flank]), 3.4)
    whole = fit(points, classes=("truck",), sensor_height=1.9)
    cut = fit(points, classes=("truck",), cut=(False, True), sensor_height=1.9)
    assert cut.box[3] == pytest.approx(8.2, abs=0.1)
    assert cut.box[0] == pytest.approx(6.0 + 4.1, abs=0.1)
    assert cut.box[4] == pytest.approx(2.6, abs=0.1)
    assert cut.box[0] > whole.box[0] + 1.5
    assert cut.covariance[0, 0] > (1.2 / 2.0) ** 2 * 0.9
    other = fit(points * (1, -1, 1), classes=("truck",), cut=(True, False), sensor_height=1.9)
    np.testing.assert_allclose(np.array(other.box[:2]) * (1, -1), cut.box[:2], atol=1e-9)


def test_fit_box_with_ambiguous_heading_has_larger_covariance() -> None:
    """A rear of 2.5 m alone may be a truck from behind, or the cut end of its flank: centers 2.8 m apart."""
    rear = np.column_stack([np.full(19, 15.0), np.linspace(-1.25, 1.25, 19)])
    known = fit(
        standing(rear, 3.4),
        classes=("truck",),
        hidden=(True, False),
        heading_cost=lambda yaw: 40.0 * math.sin(yaw) ** 2,
    )
    open_ = fit(standing(rear, 3.4), classes=("truck",), hidden=(True, False), heading_cost=lambda yaw: 0.0)
    assert np.trace(open_.covariance) > np.trace(known.covariance) + 1.0


def test_fit_box_of_few_points_uses_given_heading() -> None:
    """Three points above each other 40 m away, on a lane to the north-east."""
    column = np.array([[40.0, 0.0, z] for z in (0.4, 0.8, 1.2)])
    known = fit(column, heading=math.radians(45), classes=("car",))
    unknown = fit(column, classes=("car",))
    assert math.degrees(known.box[6]) == pytest.approx(45.0)
    assert unknown.box[6] == pytest.approx(0.0)
    assert unknown.covariance[0, 0] > known.covariance[0, 0]


def test_fit_box_of_columns_on_two_sides_uses_given_heading() -> None:
    """A car ahead, 2.3 to 4.1 m to the right: a column of rays hits its rear at 40 m, the next one its side 3 m behind.
    The line between them is 16 degrees off."""
    columns = np.array([[x, y, z] for x, y in ((40.0, -3.2), (43.0, -2.3)) for z in (0.4, 1.0)])
    car = fit(columns, heading=0.0, classes=("car",), pattern=Pattern(0.026, 0.026, math.radians(15.0)))
    assert car.box[6] == pytest.approx(0.0)
    assert car.box[0] > 41.5


def test_fit_box_of_two_objects_has_large_deviation() -> None:
    """Two cars side by side, 6 m apart, in one cluster: no class is 8 m wide and 1.5 m high."""
    both = np.concatenate([outline(20, y, 4.6, 1.85, 0.0) for y in (-3, 3)])
    assert fit(standing(both, 1.5)).deviation > 16.0
    assert fit(standing(outline(20, 3, 4.6, 1.85, 0.0), 1.5)).deviation < 3.0


def test_fit_box_of_mirrored_points_is_mirrored() -> None:
    points = standing(outline(14, 3, 4.6, 1.85, 0.6), 1.5)
    one, other = fit(points), fit(points * (1, -1, 1))
    np.testing.assert_allclose(np.array(one.box) * (1, -1, 1, 1, 1, 1, -1), other.box, atol=1e-9)
    np.testing.assert_allclose(one.covariance * [[1, -1], [-1, 1]], other.covariance, atol=1e-9)


def test_fit_box_of_equally_likely_axes_turns_with_the_points() -> None:
    """A side of 1.5 m, of which something hides both ends, may be a part of the length or of the width."""
    points = standing(outline(20, 4, 1.5, 0.2, 1.0), 1.5)
    plain, turned = (fit(part, hidden=(True, True)) for part in (points, points[:, [1, 0, 2]] * (-1, 1, 1)))
    x, y, *sizes, yaw = plain.box
    assert turned.box == pytest.approx((-y, x, *sizes, yaw + math.pi / 2))


@pytest.mark.parametrize("degrees", range(0, 360, 20))
def test_fit_box_of_single_column_is_centered_on_its_ray(degrees: int) -> None:
    x, y = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    points = np.array(
        [(x * reach, y * reach, z) for reach, z in ((18.0, 0.4), (18.03, 0.8), (18.01, 1.2), (18.1, 1.6))]
    )
    box = fit(points, classes=("pedestrian",)).box
    assert x * box[1] - y * box[0] == pytest.approx(0.0, abs=1e-9)


def test_fit_box_covariance_is_consistent_with_errors() -> None:
    """Squared Mahalanobis distances for cars of varied sizes from all sides with sparse rays."""
    rng = np.random.default_rng(8)
    distances = []
    for _ in range(150):
        length, width = rng.normal(4.6, 0.35), rng.normal(1.85, 0.12)
        bearing, reach, yaw = rng.uniform(-3, 3), rng.uniform(8, 30), rng.uniform(-3, 3)
        x, y = reach * math.cos(bearing), reach * math.sin(bearing)
        plan = outline(x, y, length, width, yaw, step=0.02)
        step = math.radians(2.0)
        column = np.floor(np.arctan2(plan[:, 1], plan[:, 0]) / step + rng.uniform())
        _, first = np.unique(column, return_index=True)
        plan = plan[first]
        if len(plan) < 3:
            continue
        points = standing(plan + rng.normal(0, 0.02, plan.shape), 1.5)
        found = fit(points, pattern=Pattern(step, math.radians(1.3), math.radians(10)), classes=("car",))
        off = np.array(found.box[:2]) - (x, y)
        distances.append(float(off @ np.linalg.solve(found.covariance, off)))
    assert len(distances) > 100
    assert 0.5 < float(np.mean(np.minimum(distances, 30.0))) < 6.0
    assert float(np.median(distances)) < 3.0


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("hidden", [(False, False), (False, True), (True, False), (True, True)])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_fit_box_of_grazed_flank_is_behind_visible_side(side: float, hidden: tuple[bool, bool], seed: int) -> None:
    """A truck with its flank 0.6 m beside the line of sight: no part of it is on the side of the sensor."""
    rng = np.random.default_rng(seed)
    plan = np.column_stack([np.linspace(3.6, 5.0, 12), np.full(12, side * 0.6)]) + rng.normal(0.0, 0.004, (12, 2))
    found = fit(standing(plan, 3.0), hidden=hidden if side > 0.0 else hidden[::-1], classes=("truck",))
    across = abs(math.sin(found.box[6])) * found.box[3] + abs(math.cos(found.box[6])) * found.box[4]
    assert side * found.box[1] - across / 2.0 == pytest.approx(0.6, abs=0.1)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_flank_below_sloping_windows_ends_the_body(side: float) -> None:
    """The flank of a van 5.2 m beside the own way, partly hidden by the next one in a row; windows slope by 0.55 m."""
    flank = np.column_stack([np.linspace(15.0, 20.0, 26), np.full(26, side * 5.2)])
    windows = np.column_stack([np.linspace(15.0, 20.0, 26), np.full(26, side * 5.75), np.full(26, 2.3)])
    points = np.concatenate([standing(flank, 1.4), windows])
    van = fit(points, hidden=(side > 0.0, side < 0.0), classes=("van",))
    assert side * van.box[1] - van.box[4] / 2.0 == pytest.approx(5.2, abs=0.05)


@pytest.mark.parametrize("first", [2.65, 2.95, 3.2])
def test_missed_side_of_an_oncoming_car_is_within_the_stated_deviation(first: float) -> None:
    """Rays 1.05 m apart meet the front and the hood of a car 1.8 m wide at y = 3.5, and may pass its side, which is
    seen at 7°: the column at `first` may be on it or not."""
    sparse = Pattern(math.radians(2.3), math.radians(1.3), math.radians(10.0))
    points = np.array([(24.3, first, 0.7), (25.9, first, 1.1), (24.3, first + 1.05, 0.7)])
    fitted = fit(points, pattern=sparse, heading=0.0)
    assert fitted.name == "car"
    assert abs(fitted.box[1] - 3.5) < 2.0 * math.sqrt(fitted.covariance[1, 1])


@pytest.mark.parametrize("seed", range(4))
def test_fit_box_of_single_column_beside_occluder_extends_behind_it(seed: int) -> None:
    rng = np.random.default_rng(seed)
    plan = np.array([[20.0, 0.0]] * 4) + rng.normal(0.0, 0.01, (4, 2))
    left, right = (
        fit(standing(plan, 1.5), hidden=flags, classes=("car",), heading=math.pi / 2.0)
        for flags in ((True, False), (False, True))
    )
    gap = 20.0 * math.radians(1.0)
    assert left.box[1] == pytest.approx(2.3 - gap / 2.0, abs=0.05)
    assert right.box[1] == pytest.approx(gap / 2.0 - 2.3, abs=0.05)


def test_distances_to_the_nearer_edges_equal_those_of_turned_points() -> None:
    plan = np.random.default_rng(4).normal(0.0, 2.0, (60, 2))
    cos, sin = np.cos(HEADINGS), np.sin(HEADINGS)
    nearest = np.empty((len(HEADINGS), len(plan)))
    _find_nearest_edges(np.ascontiguousarray(plan[:, 0]), np.ascontiguousarray(plan[:, 1]), cos, sin, nearest)
    for c, s, distances in zip(cos, sin, nearest, strict=True):
        edges = []
        for places in (plan @ (c, s), plan @ (-s, c)):
            both = places - places.min(), places.max() - places
            edges.append(min(both, key=lambda part: float((part**2).sum())))
        np.testing.assert_allclose(distances, np.minimum(*edges), atol=1e-12)
