"""Filtering of headings over time and fusion between stations."""

from __future__ import annotations

import math

import numpy as np
import pytest

from eidrive_scenario.fusion.prediction import (
    fuse_headings,
    initiate_heading,
    predict_heading,
    significant_turn_rate,
    update_heading,
)

NO_VELOCITY = np.full((1, 2), np.nan)


def follow(yaws: list[float], step: float = 0.05) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    heading, covariance = initiate_heading(np.array(yaws[:1]))
    facing = np.ones(1)
    for yaw in yaws[1:]:
        heading, covariance = predict_heading(heading, covariance, np.array([step]))
        heading, covariance, facing = update_heading(heading, covariance, facing, np.array([yaw]))
    return heading, covariance, facing


def fuse(
    *yaws: float,
    weights: list[float] | None = None,
    errors: list[float] | None = None,
    velocity: np.ndarray = NO_VELOCITY,
) -> float:
    counts = np.array(weights or [1.0] * len(yaws))
    traces = np.array(errors or [math.nan] * len(yaws))
    return float(fuse_headings(np.array(yaws), counts, traces, np.array([0]), velocity)[0])


def test_significant_turn_rate_is_estimated_in_turns_and_zero_otherwise() -> None:
    heading, covariance, _ = follow([0.9 * 0.05 * tick for tick in range(40)])
    assert heading[0, 1] == pytest.approx(0.9, abs=0.05)
    assert significant_turn_rate(heading, covariance)[0] == heading[0, 1]
    heading, covariance, _ = follow([0.3] * 40)
    assert significant_turn_rate(heading, covariance)[0] == 0.0


def test_update_heading_across_180_degrees_is_continuous() -> None:
    heading, _, facing = follow([math.remainder(3.0 + 0.02 * tick, 2 * math.pi) for tick in range(30)])
    assert heading[0, 0] == pytest.approx(math.remainder(3.58, 2 * math.pi), abs=0.02)
    assert facing[0] > 1.0


def test_update_heading_with_some_reversed_boxes_keeps_the_front() -> None:
    heading, _, facing = follow([0.5, 0.5, 0.5 - math.pi, 0.5, 0.5 - math.pi, 0.5])
    assert heading[0, 0] == pytest.approx(0.5, abs=1e-6)
    assert facing[0] > 0.0


def test_update_heading_with_reversed_first_box_corrects_the_front() -> None:
    heading, _, facing = follow([0.5 - math.pi] + [0.5] * 4)
    assert heading[0, 0] == pytest.approx(0.5, abs=1e-6)
    assert facing[0] > 0.0


def test_fuse_headings_is_a_circular_mean() -> None:
    assert fuse(math.radians(179), math.radians(-177)) == pytest.approx(math.radians(-179))
    assert fuse(math.radians(10), math.radians(-20)) == pytest.approx(math.radians(-5))
    assert fuse(1.234) == 1.234


def test_fuse_headings_of_contradicting_axes_is_that_of_the_smallest_error() -> None:
    assert fuse(0.0, -1.5, weights=[0.9, 1.0], errors=[0.1, 1.5]) == pytest.approx(0.0)
    assert fuse(0.0, -1.5, weights=[1.0, 0.9], errors=[1.5, 0.1]) == pytest.approx(-1.5)
    assert fuse(0.0, -1.5, weights=[1.0, 0.9], errors=[math.nan, 0.1]) == pytest.approx(-1.5)
    assert fuse(math.pi, 1.5, weights=[0.9, 0.8]) == pytest.approx(math.pi), "without errors, the largest weight"
    assert fuse(0.0, math.radians(50), errors=[0.1, 1.5]) == pytest.approx(math.radians(25)), "these agree"


def test_fuse_headings_front_is_that_of_the_larger_weight() -> None:
    assert fuse(0.2, 0.2 - math.pi, 0.2) == pytest.approx(0.2)
    assert fuse(0.2 - math.pi, 0.2, 0.2 - math.pi) == pytest.approx(0.2 - math.pi)
    assert fuse(0.2, 0.2 - math.pi, weights=[0.3, 0.9]) == pytest.approx(0.2 - math.pi)


def test_fuse_headings_with_equal_weights_uses_the_velocity() -> None:
    ahead = np.array([[5.0, 1.0]])
    assert fuse(0.2, 0.2 - math.pi, velocity=ahead) == pytest.approx(0.2)
    assert fuse(0.2, 0.2 - math.pi, velocity=-ahead) == pytest.approx(0.2 - math.pi)


def test_fuse_headings_processes_groups_separately() -> None:
    yaw = fuse_headings(np.array([0.1, 0.3, 2.0]), np.ones(3), np.ones(3), np.array([0, 2]), np.full((2, 2), np.nan))
    np.testing.assert_allclose(yaw, [0.2, 2.0])
