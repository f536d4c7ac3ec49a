"""Tests of piecewise cubics, single and in a table."""

import numpy as np
import pytest

from eidrive_scenario.roads.model.polynomials import Polynomials, PolynomialTable, combine

STEPS = Polynomials([(0.0, 1.0, 0.5, 0.0, 0.0), (10.0, 6.0, 0.0, 0.1, -0.01)])


def test_piece_extends_to_the_start_of_the_next() -> None:
    assert STEPS.value(4.0) == pytest.approx(3.0)
    assert STEPS.value(10.0) == 6.0
    assert STEPS.value_and_slope(12.0) == pytest.approx((6.0 + 0.4 - 0.08, 0.4 - 0.12))


def test_value_before_the_first_piece_is_zero() -> None:
    late = Polynomials([(5.0, 2.0, 0.0, 0.0, 0.0)])
    assert (late.value(4.9), late.value(5.0)) == (0.0, 2.0)
    assert Polynomials().is_zero
    assert late.constant_value is None


def test_first_piece_near_zero_extends_to_zero() -> None:
    rounded = Polynomials([(1e-12, 2.0, 0.5, 0.0, 0.0)])
    table = PolynomialTable([STEPS, rounded], [20.0, 20.0])
    assert rounded.value(0.0) == 2.0
    assert table.value(np.array([1]), np.array([0.0])) == pytest.approx([2.0])


def test_pieces_that_repeat_a_constant_value_are_one_piece() -> None:
    """CARLA writes lane offset and superelevation of most roads as several pieces of the value 0."""
    flat = Polynomials([(s, 0.0, 0.0, 0.0, 0.0) for s in (0.0, 0.31, 1.34)])
    assert flat.is_zero
    assert flat.pieces == [(0.0, 0.0, 0.0, 0.0, 0.0)]
    bump = [(0.0, 1.0, 0.0, 0.0, 0.0), (2.0, 1.0, 0.5, 0.0, 0.0), (4.0, 2.0, 0.0, 0.0, 0.0), (6.0, 2.0, 0.0, 0.0, 0.0)]
    assert Polynomials(bump).pieces == bump[:3]
    assert [Polynomials(bump).value(s) for s in (1.0, 3.0, 5.0, 7.0)] == [1.0, 1.5, 2.0, 2.0]


def test_shifted_function_has_the_same_values() -> None:
    shifted = STEPS.shifted(7.0)
    for s in (0.0, 2.9, 3.0, 6.0):
        assert shifted.value(s) == pytest.approx(STEPS.value(s + 7.0))


def test_combine_is_exact_over_the_union_of_pieces() -> None:
    other = Polynomials([(0.0, 1.0, 0.0, 0.0, 0.0), (3.0, 0.0, 1.0, 0.0, 0.002)])
    total = combine([(2.0, STEPS), (-1.0, other)])
    for s in (0.0, 2.0, 3.0, 9.9, 10.0, 15.0):
        assert total.value(s) == pytest.approx(2.0 * STEPS.value(s) - other.value(s))


def test_polynomial_table_evaluates_any_mixture_of_functions() -> None:
    beyond = Polynomials([(0.0, 7.0, 0.0, 0.0, 0.0), (30.0, -99.0, 0.0, 0.0, 0.0)])
    functions = [STEPS, Polynomials(), beyond, Polynomials([(0.0, 0.0, 1.0, 0.0, 0.0)])]
    table = PolynomialTable(functions, [20.0, 5.0, 10.0, 8.0])
    which = np.array([3, 0, 2, 0, 1, 3, 0])
    s = np.array([8.0, 0.0, 10.0, 20.0, 5.0, 0.0, 10.0])
    expected = np.array([functions[i].value_and_slope(v) for i, v in zip(which, s, strict=True)])
    assert table.value(which, s) == pytest.approx(expected[:, 0])
    assert np.column_stack(table.value_and_slope(which, s)) == pytest.approx(expected)
