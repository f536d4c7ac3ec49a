"""Oriented boxes: numbers worked out by hand, and agreement of the single with the vectorized functions."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.distance import cdist

from eidrive_scenario.base.geometry import (
    box_corners,
    box_distance,
    footprint,
    footprint_distance,
    iou_bev,
    overlap,
    point_in_polygon,
    points_in_box,
    points_in_polygon,
    rotation,
    rotation_matrix,
    wrap_angle,
)

UNIT = (0.0, 0.0, 0.5, 2.0, 1.0, 1.0, 0.0)


@pytest.mark.parametrize(
    ("angle", "expected"),
    [(0.0, 0.0), (math.pi, math.pi), (-math.pi, math.pi), (1.5 * math.pi, -0.5 * math.pi), (-7.0, -7.0 + 2 * math.pi)],
)
def test_wrap_angle(angle: float, expected: float) -> None:
    assert wrap_angle(angle) == pytest.approx(expected)
    assert wrap_angle(np.array([angle]))[0] == pytest.approx(expected)


def test_rotation_in_the_plane_is_that_of_a_yaw() -> None:
    assert rotation(0.3).tolist() == rotation_matrix(0.3)[:2, :2].tolist()
    assert rotation(math.pi / 2.0) @ (1.0, 0.0) == pytest.approx((0.0, 1.0))


def test_rotation_order_is_yaw_pitch_roll() -> None:
    yaw, pitch, roll = 0.3, -0.2, 0.1
    expected = rotation_matrix(yaw) @ rotation_matrix(0.0, pitch) @ rotation_matrix(0.0, 0.0, roll)
    assert rotation_matrix(yaw, pitch, roll) == pytest.approx(expected)
    assert rotation_matrix(0.0, 0.1) @ (1, 0, 0) == pytest.approx((math.cos(0.1), 0, -math.sin(0.1)))
    assert rotation_matrix(np.zeros(5)).shape == (5, 3, 3)


def test_corners_of_a_turned_box() -> None:
    corners = box_corners(np.array([[10.0, 20.0, 1.0, 4.0, 2.0, 3.0, math.pi / 2]]))
    assert corners.shape == (1, 8, 3)
    assert corners[0, 0] == pytest.approx((9.0, 22.0, -0.5))
    assert corners[0, 2] == pytest.approx((11.0, 18.0, -0.5))
    assert corners[0, 4:, 2] == pytest.approx([2.5] * 4)


@pytest.mark.parametrize(
    ("other", "expected"),
    [
        ((5.0, 0.0, 0.5, 2.0, 1.0, 1.0, 0.0), 3.0),
        ((5.0, 4.0, 0.5, 2.0, 1.0, 1.0, 0.0), math.hypot(3.0, 3.0)),
        ((0.0, 0.0, 3.5, 2.0, 1.0, 1.0, 0.3), 2.0),
        ((5.0, 0.0, 4.5, 2.0, 1.0, 1.0, 0.0), math.hypot(3.0, 3.0)),
        ((3.0, 0.0, 0.5, 2.0, 2.0, 1.0, math.pi / 4), 2.0 - math.sqrt(2.0)),
        ((0.5, 0.2, 0.6, 0.1, 0.1, 0.1, 1.0), 0.0),
        ((2.0, 0.0, 0.5, 2.0, 1.0, 1.0, 0.0), 0.0),
    ],
)
def test_distance(other: tuple[float, ...], expected: float) -> None:
    assert box_distance(UNIT, other) == pytest.approx(expected, abs=1e-12)
    assert box_distance(np.array(other), np.array(UNIT)) == pytest.approx(expected, abs=1e-12)
    assert overlap(UNIT, other) == (expected == 0.0)


def test_edges_that_cross_without_a_corner_inside_overlap() -> None:
    assert overlap((0, 0, 0, 10, 1, 1, 0), (0, 0, 0, 10, 1, 1, math.pi / 2))
    assert footprint_distance((0, 0, 0, 10, 1, 1, 0), (0, 0, 9, 10, 1, 1, math.pi / 2)) == 0.0


def test_height_separates() -> None:
    assert not overlap(UNIT, (0.0, 0.0, 5.0, 2.0, 1.0, 1.0, 0.0))


_box = st.tuples(*[st.floats(-8, 8)] * 3, *[st.floats(0.1, 6)] * 3, st.floats(-4, 4))  # x y z, length width height, yaw


@pytest.mark.exhaustive
@settings(max_examples=150, deadline=None)
@given(a=_box, b=_box)
def test_box_distance_is_least_distance_of_points(a: tuple[float, ...], b: tuple[float, ...]) -> None:
    distance = box_distance(a, b)
    # A sample of points of both boxes is never nearer than the distance, and nearly reaches it.
    grid = np.linspace(-0.5, 0.5, 9)
    local = np.stack(np.meshgrid(grid, grid, grid), axis=-1).reshape(-1, 3)
    clouds = [local * box[3:6] @ rotation_matrix(box[6]).T + box[:3] for box in (a, b)]
    gap = cdist(clouds[0], clouds[1]).min()
    assert distance - 1e-9 <= gap <= distance + 6 * math.sqrt(3) / 8


@settings(max_examples=100, deadline=None)
@given(a=_box, b=_box)
def test_iou_is_symmetric_and_bounded(a: tuple[float, ...], b: tuple[float, ...]) -> None:
    first, second = np.array([a]), np.array([b])
    value = iou_bev(first, second)[0, 0]
    assert value == pytest.approx(iou_bev(second, first)[0, 0], abs=1e-9)
    assert 0.0 <= value <= 1.0 + 1e-9
    assert iou_bev(first, first)[0, 0] == pytest.approx(1.0)
    if footprint_distance(a, b) > 0.0:
        assert value == pytest.approx(0.0, abs=1e-12)


def test_iou_by_hand() -> None:
    square = np.array([[0, 0, 0, 2, 2, 1, 0.0]])
    others = np.array(
        [
            [1, 0, 0, 2, 2, 1, 0.0],  # half of each shared: 2 / 6
            [0, 0, 0, 2, 2, 1, math.pi / 4],  # a regular octagon: 8 (sqrt 2 - 1) of 4 + 4
            [0, 0, 0, 1, 1, 1, 0.7],  # wholly inside
            [9, 0, 0, 2, 2, 1, 0.0],
        ]
    )
    octagon = 8 * (math.sqrt(2) - 1)
    assert iou_bev(square, others)[0] == pytest.approx([1 / 3, octagon / (8 - octagon), 0.25, 0.0])
    assert iou_bev(np.empty((0, 7)), others).shape == (0, 4)


def test_points_in_polygon() -> None:
    arrow = np.array([[0, 0], [4, 0], [4, 4], [2, 1.0], [0, 4]])
    points = np.array([[1.0, 0.5], [2, 2], [3.9, 3], [-1, 1], [5, 1]])
    expected = [True, False, True, False, False]
    assert points_in_polygon(points, arrow).tolist() == expected
    assert [point_in_polygon(x, y, arrow.tolist()) for x, y in points] == expected


def test_points_in_box_agree_with_the_corners() -> None:
    box = np.array([3.0, -2.0, 1.0, 4.0, 2.0, 1.5, 0.8])
    corners = box_corners(box)
    assert points_in_box(box[:3] + 0.999 * (corners - box[:3]), box).all()
    assert not points_in_box(box[:3] + 1.001 * (corners - box[:3]), box).any()
    assert points_in_polygon(box[:2] + 0.999 * (footprint(box) - box[:2]), footprint(box)).all()
