"""Tests of reference lines against closed forms and against quadrature of their curvature."""

import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.special import fresnel

from eidrive_scenario.roads.model import curves
from eidrive_scenario.roads.model.curve_table import CurveTable
from eidrive_scenario.roads.model.curves import Arc, Cubic, ReferenceLine, Spiral


def test_quarter_arc_ends_one_radius_ahead_and_aside() -> None:
    point = Arc(0.0, 2.0, 3.0, 0.0, 50.0, curvature=0.1).at(math.pi / 2 * 10.0)
    assert point == pytest.approx((12.0, 13.0, math.pi / 2, 0.1, 1.0))
    right = Arc(0.0, 0.0, 0.0, math.pi / 2, 50.0, curvature=-0.1).at(math.pi / 2 * 10.0)
    assert right == pytest.approx((10.0, 10.0, 0.0, -0.1, 1.0), abs=1e-12)


def test_line_equals_arc_without_curvature() -> None:
    assert Arc(0.0, 1.0, 1.0, math.pi / 4, 10.0).at(math.sqrt(2.0)) == pytest.approx((2, 2, math.pi / 4, 0, 1))


def test_spiral_from_line_equals_fresnel_integrals() -> None:
    length, end = 80.0, 0.02
    spiral = curves.spiral(0.0, 0.0, 0.0, 0.0, length, 0.0, end)
    a = math.sqrt(math.pi * length / end)
    sine, cosine = fresnel(length / a)
    assert spiral.at(length)[:4] == pytest.approx((a * cosine, a * sine, 0.5 * end * length, end))


@pytest.mark.parametrize(
    ("start", "end"), [(0.05, -0.03), (-0.02, -0.04), (0.1, 0.0), (1e-6, 2e-6), (0.05, 0.05 + 1e-11)]
)
def test_spiral_equals_integral_of_its_heading(start: float, end: float) -> None:
    length = 60.0
    spiral = curves.spiral(10.0, 5.0, -7.0, 0.7, length, start, end)

    def heading(u: float) -> float:
        return 0.7 + start * u + 0.5 * (end - start) / length * u * u

    for ds in (0.0, 13.0, 60.0):
        x = 5.0 + quad(lambda u: math.cos(heading(u)), 0.0, ds, epsabs=1e-12)[0]
        y = -7.0 + quad(lambda u: math.sin(heading(u)), 0.0, ds, epsabs=1e-12)[0]
        assert spiral.at(ds)[:3] == pytest.approx((x, y, heading(ds)), abs=1e-7)


def test_spiral_with_negligible_rate_becomes_an_arc() -> None:
    assert isinstance(curves.spiral(0.0, 0.0, 0.0, 0.0, 60.0, 0.05, 0.05 + 1e-11), Arc)
    assert isinstance(curves.spiral(0.0, 0.0, 0.0, 0.0, 60.0, 0.05, 0.05 + 1e-8), Spiral)


def test_param_poly3_over_arc_length_has_s_as_parameter() -> None:
    over_length = Cubic(0.0, 1.0, 2.0, 0.3, 20.0, (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 0.01, -0.0002))
    u, v = 10.0, 0.01 * 100 - 0.0002 * 1000
    cos, sin = math.cos(0.3), math.sin(0.3)
    slope = 0.02 * 10 - 0.0006 * 100
    expected = (1 + cos * u - sin * v, 2 + sin * u + cos * v, 0.3 + math.atan(slope))
    assert over_length.at(10.0)[:3] == pytest.approx(expected)
    assert over_length.at(10.0).curvature == pytest.approx((0.02 - 0.0012 * 10) / (1 + slope**2) ** 1.5)


@pytest.mark.parametrize("share", [0.0, 0.15, 0.5, 0.9, 1.0])
def test_normalized_param_poly3_is_parametrized_by_arc_length(share: float) -> None:
    """A left turn whose points move faster at its ends, like the turns that map editors export."""
    of_u, of_v = (0.0, 24.0, -9.0, -3.0), (0.0, 0.0, 9.0, 3.0)
    u, v = np.polynomial.Polynomial(of_u), np.polynomial.Polynomial(of_v)
    du, dv = u.deriv(), v.deriv()

    def arc_length(p: float) -> float:
        return float(quad(lambda value: math.hypot(du(value), dv(value)), 0.0, p)[0])

    length = arc_length(1.0)
    line = ReferenceLine(curves.over_arc_length(Cubic(0.0, 1.0, 2.0, 0.0, length, of_u, of_v), 1.0), length)
    p = brentq(lambda value: arc_length(value) - share * length, 0.0, 1.0)
    x, y, h, curvature, speed = line.at(share * length)
    bend = (du(p) * dv.deriv()(p) - dv(p) * du.deriv()(p)) / math.hypot(du(p), dv(p)) ** 3
    assert (x, y, h) == pytest.approx((1.0 + u(p), 2.0 + v(p), math.atan2(dv(p), du(p))), abs=1e-4)
    assert (curvature, speed) == pytest.approx((bend, 1.0), abs=2e-3)


def test_poly3_is_parametrized_by_arc_length() -> None:
    a, b, c, d = 0.0, 0.1, 0.02, -0.0004
    length = 40.0
    cubic = Cubic(0.0, 0.0, 0.0, 0.0, length, v=(a, b, c, d))
    line = ReferenceLine(curves.over_arc_length(cubic, length, length), length)

    def speed(u: float) -> float:
        return math.hypot(1.0, b + 2 * c * u + 3 * d * u * u)

    for s in (0.0, 3.3, 17.0, 40.0):
        x, y, h, _, pace = line.at(s)
        assert quad(speed, 0.0, x)[0] == pytest.approx(s, abs=1e-4)
        assert y == pytest.approx(a + x * (b + x * (c + x * d)), abs=1e-4)
        assert math.tan(h) == pytest.approx(b + 2 * c * x + 3 * d * x * x, abs=1e-3)
        assert pace == pytest.approx(1.0, abs=1e-3)


def test_curve_table_equals_single_lines() -> None:
    cubic = Cubic(0.0, 5.0, 5.0, 1.0, 12.5, v=(0.0, 0.0, 0.01, 0.001))
    lines = [
        ReferenceLine(
            [
                Arc(0.0, 0.0, 0.0, 0.2, 10.0),
                Arc(10.0, 9.8, 2.0, 0.2, 15.0, -0.05),
                curves.spiral(25.0, 20.0, 1.0, -0.55, 30.0, -0.05, 0.02),
            ],
            55.0,
        ),
        ReferenceLine(curves.over_arc_length(cubic, 12.5, 12.5), 12.5),
        ReferenceLine([Arc(0.0, -3.0, 0.0, 3.0, 7.0, 0.2)], 7.0),
    ]
    table = CurveTable(lines)
    index = np.array([0] * 12 + [1] * 6 + [2] * 3)
    s = np.concatenate([np.linspace(0, 55, 12), np.linspace(0, 12.5, 6), [0.0, 3.0, 7.0]])
    found = np.column_stack(table.at(index, s))
    assert found == pytest.approx(np.array([lines[i].at(v) for i, v in zip(index, s, strict=True)]), abs=1e-12)


def test_curve_table_of_mixed_curves_is_independent_of_other_points() -> None:
    bent = Cubic(150.0, 80.0, 9.0, 0.4, 40.0, (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 0.01, -0.0002))
    mixed = [Arc(0.0, 1.0, 2.0, 0.3, 50.0), Arc(50.0, 49.0, 17.0, 0.3, 50.0, curvature=0.02)]
    turning = curves.spiral(100.0, 70.0, 40.0, 1.3, 50.0, 0.02, -0.03)
    table = CurveTable([ReferenceLine([*mixed, turning, bent], 190.0), ReferenceLine([mixed[0]], 50.0)])
    line = np.repeat([0, 1], 200)
    s = np.concatenate([np.linspace(0.0, 190.0, 200), np.linspace(0.0, 50.0, 200)])
    together = np.array(table.at(line, s))
    for n in range(len(s)):
        np.testing.assert_array_equal(np.array(table.at(line[[n]], s[[n]]))[:, 0], together[:, n])
