"""Headings over time and between stations."""

from __future__ import annotations

import math

import numpy as np
import pytest

from eidrive_scenario.fusion.headings import (
    first_heading,
    joined_heading,
    known_turn,
    predicted_heading,
    updated_heading,
)

NO_VELOCITY = np.full((1, 2), np.nan)


def follow(yaws: list[float], step: float = 0.05) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    heading, covariance = first_heading(np.array(yaws[:1]))
    facing = np.ones(1)
    for yaw in yaws[1:]:
        heading, covariance = predicted_heading(heading, covariance, np.array([step]))
        heading, covariance, facing = updated_heading(heading, covariance, facing, np.array([yaw]))
    return heading, covariance, facing


def joined(*yaws: float, weights: list[float] | None = None, velocity: np.ndarray = NO_VELOCITY) -> float:
    counts = np.array(weights or [1.0] * len(yaws))
    return float(joined_heading(np.array(yaws), counts, np.array([0]), velocity)[0])


def test_the_rate_of_a_turn_is_found_and_that_of_a_straight_way_is_not() -> None:
    heading, covariance, _ = follow([0.9 * 0.05 * tick for tick in range(40)])
    assert heading[0, 1] == pytest.approx(0.9, abs=0.05)
    assert known_turn(heading, covariance)[0] == heading[0, 1]
    heading, covariance, _ = follow([0.3] * 40)
    assert known_turn(heading, covariance)[0] == 0.0


def test_a_turn_through_the_back_has_no_leap() -> None:
    heading, _, facing = follow([math.remainder(3.0 + 0.02 * tick, 2 * math.pi) for tick in range(30)])
    assert heading[0, 0] == pytest.approx(math.remainder(3.58, 2 * math.pi), abs=0.02)
    assert facing[0] > 1.0


def test_boxes_with_the_front_behind_do_not_turn_the_object() -> None:
    heading, _, facing = follow([0.5, 0.5, 0.5 - math.pi, 0.5, 0.5 - math.pi, 0.5])
    assert heading[0, 0] == pytest.approx(0.5, abs=1e-6)
    assert facing[0] > 0.0


def test_but_if_only_the_first_was_wrong_the_others_are_believed() -> None:
    heading, _, facing = follow([0.5 - math.pi] + [0.5] * 4)
    assert heading[0, 0] == pytest.approx(0.5, abs=1e-6)
    assert facing[0] > 0.0


def test_the_mean_is_one_on_the_circle() -> None:
    assert joined(math.radians(179), math.radians(-177)) == pytest.approx(math.radians(-179))
    assert joined(math.radians(10), math.radians(-20)) == pytest.approx(math.radians(-5))
    assert joined(1.234) == 1.234


def test_the_front_is_a_vote() -> None:
    assert joined(0.2, 0.2 - math.pi, 0.2) == pytest.approx(0.2)
    assert joined(0.2 - math.pi, 0.2, 0.2 - math.pi) == pytest.approx(0.2 - math.pi)
    assert joined(0.2, 0.2 - math.pi, weights=[0.3, 0.9]) == pytest.approx(0.2 - math.pi)


def test_where_the_vote_is_split_the_motion_tells() -> None:
    ahead = np.array([[5.0, 1.0]])
    assert joined(0.2, 0.2 - math.pi, velocity=ahead) == pytest.approx(0.2)
    assert joined(0.2, 0.2 - math.pi, velocity=-ahead) == pytest.approx(0.2 - math.pi)


def test_groups_are_joined_each_for_itself() -> None:
    yaw = joined_heading(np.array([0.1, 0.3, 2.0]), np.ones(3), np.array([0, 2]), np.full((2, 2), np.nan))
    np.testing.assert_allclose(yaw, [0.2, 2.0])
