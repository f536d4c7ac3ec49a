"""Piecewise cubics, one at a time and in a table."""

import numpy as np
import pytest

from eidrive_scenario.roads.model.polynomials import Polynomials, PolynomialTable, combine

STEPS = Polynomials([(0.0, 1.0, 0.5, 0.0, 0.0), (10.0, 6.0, 0.0, 0.1, -0.01)])


def test_each_piece_holds_up_to_the_start_of_the_next() -> None:
    assert STEPS.value(4.0) == pytest.approx(3.0)
    assert STEPS.value(10.0) == 6.0
    assert STEPS.value_and_slope(12.0) == pytest.approx((6.0 + 0.4 - 0.08, 0.4 - 0.12))


def test_a_function_is_zero_before_its_first_piece() -> None:
    late = Polynomials([(5.0, 2.0, 0.0, 0.0, 0.0)])
    assert (late.value(4.9), late.value(5.0)) == (0.0, 2.0)
    assert Polynomials().is_zero
    assert not late.is_constant


def test_a_first_piece_that_starts_at_0_but_for_rounding_holds_from_0_on() -> None:
    rounded = Polynomials([(1e-12, 2.0, 0.5, 0.0, 0.0)])
    table = PolynomialTable([STEPS, rounded], [20.0, 20.0])
    assert rounded.value(0.0) == 2.0
    assert table.value(np.array([1]), np.array([0.0])) == pytest.approx([2.0])


def test_a_shifted_function_is_the_same_seen_from_another_origin() -> None:
    shifted = STEPS.shifted(7.0)
    for s in (0.0, 2.9, 3.0, 6.0):
        assert shifted.value(s) == pytest.approx(STEPS.value(s + 7.0))


def test_sums_are_exact_over_the_union_of_the_pieces() -> None:
    other = Polynomials([(0.0, 1.0, 0.0, 0.0, 0.0), (3.0, 0.0, 1.0, 0.0, 0.002)])
    total = combine([(2.0, STEPS), (-1.0, other)])
    for s in (0.0, 2.0, 3.0, 9.9, 10.0, 15.0):
        assert total.value(s) == pytest.approx(2.0 * STEPS.value(s) - other.value(s))


def test_a_table_evaluates_any_mixture_of_functions() -> None:
    beyond = Polynomials([(0.0, 7.0, 0.0, 0.0, 0.0), (30.0, -99.0, 0.0, 0.0, 0.0)])
    functions = [STEPS, Polynomials(), beyond, Polynomials([(0.0, 0.0, 1.0, 0.0, 0.0)])]
    table = PolynomialTable(functions, [20.0, 5.0, 10.0, 8.0])
    which = np.array([3, 0, 2, 0, 1, 3, 0])
    s = np.array([8.0, 0.0, 10.0, 20.0, 5.0, 0.0, 10.0])
    expected = np.array([functions[i].value_and_slope(v) for i, v in zip(which, s, strict=True)])
    assert table.value(which, s) == pytest.approx(expected[:, 0])
    assert np.column_stack(table.value_and_slope(which, s)) == pytest.approx(expected)
