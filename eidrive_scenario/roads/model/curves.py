"""Plan view of a road: consecutive lines, arcs, spirals (clothoids) and cubic curves.

A poly3 and a normalized paramPoly3 are converted into short cubic curves over arc length on reading. Three kinds
remain: curves of constant curvature (closed form), spirals (Fresnel integrals) and parametric cubics.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any, NamedTuple, TypeVar

import numpy as np

from eidrive_scenario.base.arrays import Array

LONGEST = 1.6
"""Maximum argument of the series. It belongs to a spiral that turns by 4 rad from its straight end."""
_TERMS = 17
_SINE = [(-1) ** n * (math.pi / 2.0) ** (2 * n + 1) / (math.factorial(2 * n + 1) * (4 * n + 3)) for n in range(_TERMS)][
    ::-1
]
_COSINE = [(-1) ** n * (math.pi / 2.0) ** (2 * n) / (math.factorial(2 * n) * (4 * n + 1)) for n in range(_TERMS)][::-1]
_BOTH = np.array([_SINE, _COSINE]).T[:, :, None]
"""Coefficients of the sine and the cosine integral: (_TERMS, 2, 1)."""


Argument = TypeVar("Argument", float, Array)


def fresnel(x: Argument) -> tuple[Argument, Argument]:
    """Return the integrals of sin(pi t²/2) and cos(pi t²/2) from 0 to x (DLMF 7.2.7, 7.2.8), of a number or (N,).

    Up to `LONGEST` the series of DLMF 7.6.4 and 7.6.6 has an error below 2e-15, and needs no import of scipy, which
    would take longer than reading the roads.
    """
    if isinstance(x, float):
        return _series(x) if abs(x) <= LONGEST else _by_scipy(x)
    near = np.abs(x) <= LONGEST
    if near.all():
        return _series(x)
    sine, cosine = _by_scipy(x)
    sine[near], cosine[near] = _series(x[near])
    return sine, cosine


def _series(x: Argument) -> tuple[Argument, Argument]:
    square = x * x
    fourth = square * square
    if isinstance(x, float):
        sine, cosine = 0.0, 0.0
        for of_sine, of_cosine in zip(_SINE, _COSINE, strict=True):
            sine, cosine = sine * fourth + of_sine, cosine * fourth + of_cosine
        return sine * square * x, cosine * x
    both = fourth * 0.0 + _BOTH[0]
    for terms in _BOTH[1:]:
        both *= fourth
        both += terms
    return both[0] * square * x, both[1] * x


def _by_scipy(x: Any) -> tuple[Any, Any]:
    from scipy.special import fresnel as of_scipy

    sine, cosine = of_scipy(x)
    return (float(sine), float(cosine)) if isinstance(x, float) else (sine, cosine)


FLAT_PHASE = 1e7
"""Maximum phase k²/(2c) of a spiral. Above it the spiral is an arc to less than a millimeter, and Fresnel integrals
lose precision.
"""


STANDSTILL = 1e-9
"""Maximum path length per unit of the parameter of a cubic at which it has no direction, and no curvature."""
MOST_CUBICS = 16, 16_384
"""Maximum numbers of cubics that replace one curve: of a short one, and of any. Between them they are about a meter
long. Both are powers of two."""
MAX_ERROR = 1e-5
"""Maximum distance of such a cubic from the curve [m]: its curvature is the second derivative, and right to about
0.001/m with cubics of 2 m."""
PATH_CELLS = 16
"""Number of cells of the quadrature of a path length."""
BETWEEN = np.array([0.25, 0.5, 0.75])
"""Shares of a cubic at which its error is measured: in the middle alone it vanishes where the curve is symmetric."""


Coefficients = tuple[float, float, float, float]
"""Coefficients of a cubic polynomial in ascending order."""


class CurvePoint(NamedTuple):
    """Point of a reference line: x, y [m], heading [rad], curvature [1/m], path length per meter of s."""

    x: float
    y: float
    h: float
    curvature: float
    speed: float


@dataclass(frozen=True)
class Curve(ABC):
    """Geometry of a plan view, which starts at x, y with heading h and extends from `s` over `length` [m]."""

    s: float
    x: float
    y: float
    h: float
    length: float
    cos: float = field(init=False, repr=False)
    sin: float = field(init=False, repr=False)
    line: int | None = field(default=None, kw_only=True, compare=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "cos", math.cos(self.h))
        object.__setattr__(self, "sin", math.sin(self.h))

    @abstractmethod
    def at(self, ds: float) -> CurvePoint:
        """Return the point `ds` after the start [m]."""

    @abstractmethod
    def bend(self, ds: float) -> tuple[float, float]:
        """Return the curvature [1/m] and path length per meter of s at `ds`, as `at` does."""


@dataclass(frozen=True)
class Arc(Curve):
    """Curve of constant curvature [1/m], positive to the left; 0 for a line."""

    curvature: float = 0.0

    def bend(self, ds: float) -> tuple[float, float]:
        return self.curvature, 1.0

    def at(self, ds: float) -> CurvePoint:
        half = 0.5 * self.curvature * ds
        if abs(half) < 1e-9:
            u, v = ds, ds * half
        else:
            chord = ds * math.sin(half) / half
            u, v = chord * math.cos(half), chord * math.sin(half)
        x = self.x + self.cos * u - self.sin * v
        return CurvePoint(x, self.y + self.sin * u + self.cos * v, self.h + 2.0 * half, self.curvature, 1.0)


@dataclass(frozen=True)
class Spiral(Curve):
    """Clothoid whose curvature increases by `rate` [1/m²] from `curvature` [1/m].

    With v = (ds + k/c)·√(|c|/π) the integrals of cos and sin of the heading are Fresnel integrals C(v), S(v)
    (Abramowitz and Stegun 7.3).
    """

    curvature: float = 0.0
    rate: float = 0.0
    scale: float = field(init=False, repr=False)
    phase: float = field(init=False, repr=False)
    origin: tuple[float, float] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "scale", math.sqrt(abs(self.rate) / math.pi))
        object.__setattr__(self, "phase", -self.curvature * self.curvature / (2.0 * self.rate))
        sine, cosine = fresnel(self.curvature / self.rate * self.scale)
        object.__setattr__(self, "origin", (float(cosine), float(sine)))

    def bend(self, ds: float) -> tuple[float, float]:
        return self.curvature + self.rate * ds, 1.0

    def at(self, ds: float) -> CurvePoint:
        sine, cosine = fresnel((ds + self.curvature / self.rate) * self.scale)
        along = (float(cosine) - self.origin[0]) / self.scale
        across = math.copysign(1.0, self.rate) * (float(sine) - self.origin[1]) / self.scale
        angle = self.h + self.phase
        cos, sin = math.cos(angle), math.sin(angle)
        return CurvePoint(
            self.x + cos * along - sin * across,
            self.y + sin * along + cos * across,
            self.h + ds * (self.curvature + 0.5 * self.rate * ds),
            self.curvature + self.rate * ds,
            1.0,
        )


@dataclass(frozen=True)
class Cubic(Curve):
    """Curve u(p), v(p), cubic in the local frame of the start, with p = ds."""

    u: Coefficients = (0.0, 1.0, 0.0, 0.0)
    v: Coefficients = (0.0, 0.0, 0.0, 0.0)

    def bend(self, ds: float) -> tuple[float, float]:
        _, _, curvature, speed = self._derivatives(ds)
        return curvature, speed

    def at(self, p: float) -> CurvePoint:
        u0, u1, u2, u3 = self.u
        v0, v1, v2, v3 = self.v
        u, v = u0 + p * (u1 + p * (u2 + p * u3)), v0 + p * (v1 + p * (v2 + p * v3))
        du, dv, curvature, speed = self._derivatives(p)
        x, y = self.x + self.cos * u - self.sin * v, self.y + self.sin * u + self.cos * v
        return CurvePoint(x, y, self.h + math.atan2(dv, du), curvature, speed)

    def path_length(self, end: float) -> float:
        """Return the length of the path from p = 0 to `end` [m]."""
        return float(_path_lengths(self, np.linspace(0.0, end, PATH_CELLS + 1))[-1])

    def _derivatives(self, p: float) -> tuple[float, float, float, float]:
        """Return the derivatives of u and v by p, the curvature [1/m], and the path length per meter of s."""
        _, u1, u2, u3 = self.u
        _, v1, v2, v3 = self.v
        du, dv = u1 + p * (2.0 * u2 + 3.0 * p * u3), v1 + p * (2.0 * v2 + 3.0 * p * v3)
        ddu, ddv = 2.0 * u2 + 6.0 * p * u3, 2.0 * v2 + 6.0 * p * v3
        norm = math.hypot(du, dv)
        curvature = (du * ddv - dv * ddu) / norm**3 if norm > STANDSTILL else 0.0
        return du, dv, curvature, norm


def spiral(
    s: float, x: float, y: float, h: float, length: float, start: float, end: float, *, line: int | None = None
) -> Curve:
    """Return the curve with linear curvature from `start` to `end` [1/m], or an arc if the change is negligible."""
    rate = (end - start) / length
    if rate == 0.0 or max(start * start, end * end) / (2.0 * abs(rate)) > FLAT_PHASE:
        return Arc(s, x, y, h, length, 0.5 * (start + end), line=line)
    return Spiral(s, x, y, h, length, start, rate, line=line)


@cache
def _quadrature() -> tuple[Array, Array]:
    """Return nodes and weights of the Gauss-Legendre quadrature with five points."""
    nodes, weights = np.polynomial.legendre.leggauss(5)
    return nodes, weights


def over_arc_length(curve: Cubic, end: float, arc_length: float | None = None) -> list[Cubic]:
    """Return a curve u(p), v(p) as cubics over s, which is proportional to the arc length.

    The arc length is integrated by Gauss-Legendre quadrature. Each cubic has the points and tangents of the curve at
    both ends (Hermite). Their number is doubled until the error is at most `MAX_ERROR`.

    end         maximum of the parameter p
    arc_length  length of the curve [m]; without it the curve extends to `end`
    """
    nodes, weights = _quadrature()
    most = 2 ** math.ceil(math.log2(min(max(curve.length, MOST_CUBICS[0]), MOST_CUBICS[1])))
    edges = np.linspace(0.0, end, most * 4 + 1)
    arc = _path_lengths(curve, edges)
    total = float(arc[-1]) if arc_length is None else arc_length
    knots = np.linspace(0.0, total, most * 4 + 1)
    # The parameter at the knots, by Newton's method within the cells of the quadrature
    cell = np.clip(np.searchsorted(arc, knots, side="right") - 1, 0, len(edges) - 2)
    p = np.interp(knots, arc, edges)
    for _ in range(3):
        reach = 0.5 * (p - edges[cell])
        inner = _tangents(curve, edges[cell, None] + reach[:, None] * (nodes + 1.0))[2] @ weights
        p = p - (arc[cell] + reach * inner - knots) / np.maximum(_tangents(curve, p)[2], STANDSTILL)
        p = np.clip(p, edges[cell], edges[cell + 1])
    du, dv, speed = _tangents(curve, p)
    rate = total / curve.length / np.maximum(speed, STANDSTILL)
    (u0, u1, u2, u3), (v0, v1, v2, v3) = curve.u, curve.v
    points = u0 + p * (u1 + p * (u2 + p * u3)), v0 + p * (v1 + p * (v2 + p * v3))
    count = 1
    while True:
        stride, step = most * 4 // count, curve.length / count
        powers = (step * BETWEEN) ** np.arange(4)[:, None]
        parts = [
            _hermite(value[::stride], slope[::stride], step)
            for value, slope in zip(points, (du * rate, dv * rate), strict=True)
        ]
        errors = [
            part @ powers - value[:-1].reshape(count, 4, -1)[:, 1:, 0]
            for part, value in zip(parts, points, strict=True)
        ]
        if count == most or float(np.hypot(*errors).max()) <= MAX_ERROR:
            break
        count *= 2
    start = curve.x, curve.y, curve.h
    return [
        Cubic(curve.s + i * step, *start, step, tuple(along), tuple(across), line=curve.line)
        for i, (along, across) in enumerate(zip(*(part.tolist() for part in parts), strict=True))
    ]


def _tangents(curve: Cubic, p: Array) -> tuple[Array, Array, Array]:
    """Return the derivatives of u and v by the parameter, and their norm."""
    (_, u1, u2, u3), (_, v1, v2, v3) = curve.u, curve.v
    du, dv = u1 + p * (2.0 * u2 + 3.0 * p * u3), v1 + p * (2.0 * v2 + 3.0 * p * v3)
    return du, dv, np.hypot(du, dv)


def _path_lengths(curve: Cubic, edges: Array) -> Array:
    """Return the lengths of the path from the first edge of the parameter to each of them [m]."""
    nodes, weights = _quadrature()
    half = 0.5 * np.diff(edges)
    middle = 0.5 * (edges[1:] + edges[:-1])
    speeds = _tangents(curve, middle[:, None] + half[:, None] * nodes)[2]
    return np.concatenate([[0.0], np.cumsum(half * (speeds @ weights))])


def _hermite(value: Array, slope: Array, step: float) -> Array:
    """Return the coefficients (N, 4) of cubics with given values and slopes (N + 1,) at their ends, `step` apart."""
    rise = np.diff(value) / step
    c = (3.0 * rise - 2.0 * slope[:-1] - slope[1:]) / step
    d = (slope[:-1] + slope[1:] - 2.0 * rise) / (step * step)
    return np.column_stack([value[:-1], slope[:-1], c, d])


class ReferenceLine:
    """Curves of the plan view of a road in the order of s."""

    __slots__ = ("curves", "length", "starts")

    def __init__(self, curves: Sequence[Curve], length: float) -> None:
        self.curves = list(curves)
        self.starts = [curve.s for curve in self.curves]
        self.length = length

    def at(self, s: float) -> CurvePoint:
        """Return the point at s [m]. The first and last curve are extended beyond the ends."""
        curve = self.curves[bisect_right(self.starts, s, 1) - 1]
        return curve.at(s - curve.s)

    def ahead(self, s: float, direction: int) -> tuple[Curve, float]:
        """Return the curve ahead of s in `direction` (+1 along s, -1 against it), and the s of its end [m]."""
        starts = self.starts
        index = bisect_right(starts, s, 1) - 1
        if direction > 0:
            return self.curves[index], starts[index + 1] if index + 1 < len(starts) else math.inf
        while index > 0 and starts[index] >= s:
            index -= 1
        return self.curves[index], starts[index] if index > 0 else -math.inf

    def bend(self, s: float) -> tuple[float, float]:
        """Return the curvature [1/m] and path length per meter of s at s [m]."""
        curve = self.curves[bisect_right(self.starts, s, 1) - 1]
        return curve.bend(s - curve.s)
