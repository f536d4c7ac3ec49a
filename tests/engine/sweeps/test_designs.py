"""Designs of sweeps: grids, Latin hypercubes and Sobol sequences."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.stats import qmc

from eidrive_scenario.errors import SettingError
from eidrive_scenario.experiments.sweeps.axes import Axis, parse_axes, points_of

AXES = (Axis("a", low=0.0, high=1.0), Axis("b", low=-1.0, high=3.0), Axis("kind", ("x", "y")))


def test_grid_contains_all_combinations_in_order() -> None:
    points = points_of(parse_axes(["a=1,2", "b=x,y,z"]), "grid", None, 1)
    assert [tuple(point.values()) for point in points] == [(a, b) for a in (1, 2) for b in "xyz"]


def test_grid_without_axes_is_one_point() -> None:
    assert points_of((), "grid", None, 1) == [{}]


def test_latin_hypercube_has_one_point_in_each_stratum() -> None:
    points = points_of(AXES, "lhs", 20, 1)
    for name, low, high in (("a", 0.0, 1.0), ("b", -1.0, 3.0)):
        strata = sorted(int((float(point[name]) - low) / (high - low) * 20) for point in points)
        assert strata == list(range(20))
    assert sorted(point["kind"] for point in points) == ["x"] * 10 + ["y"] * 10


@pytest.mark.parametrize("design", ["lhs", "sobol"])
def test_sampled_combinations_of_lists_are_different(design: str) -> None:
    """Two lists of two values have four combinations; sixteen samples contain each of them."""
    points = points_of(parse_axes(["a=1,2", "b=x,y"]), design, 16, 1)
    assert sorted((int(point["a"]), str(point["b"])) for point in points) == [(1, "x"), (1, "y"), (2, "x"), (2, "y")]


def test_sobol_is_more_even_than_random_and_extensible() -> None:
    """Discrepancy below that of random points; more samples add points to the former ones."""
    axes = AXES[:2]
    points = points_of(axes, "sobol", 64, 3)
    shares = np.array([[float(point["a"]), (float(point["b"]) + 1.0) / 4.0] for point in points])
    random = np.random.default_rng(0).random((64, 2))
    assert qmc.discrepancy(shares) < 0.3 * qmc.discrepancy(random)
    assert points_of(axes, "sobol", 40, 3) == points[:40]


@pytest.mark.parametrize("design", ["lhs", "sobol"])
def test_sampled_designs_depend_on_seed_only(design: str) -> None:
    assert points_of(AXES, design, 9, 1) == points_of(AXES, design, 9, 1)
    assert points_of(AXES, design, 9, 1) != points_of(AXES, design, 9, 2)


@pytest.mark.parametrize(
    ("axes", "design", "samples", "expected"),
    [
        (AXES, "random", 3, "unknown design"),
        (AXES, "grid", None, "interval in a grid"),
        (AXES[2:], "grid", 4, "no effect"),
        (AXES, "lhs", None, "--samples is missing"),
        (AXES, "sobol", 0, "--samples"),
        ((), "lhs", 3, "without --vary"),
        (tuple(Axis(str(k), tuple(range(100))) for k in range(4)), "grid", None, "combinations"),
    ],
)
def test_invalid_designs_raise(axes: tuple[Axis, ...], design: str, samples: int | None, expected: str) -> None:
    with pytest.raises(SettingError, match=expected):
        points_of(axes, design, samples, 1)


def test_values_of_intervals_stay_inside() -> None:
    for point in points_of(AXES, "sobol", 200, 1):
        assert 0.0 <= float(point["a"]) < 1.0
        assert -1.0 <= float(point["b"]) < 3.0
        assert math.isfinite(float(point["b"]))
