"""Joint evaluation of the reference lines of many roads."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from eidrive_scenario.base.arrays import Array, Integers
from eidrive_scenario.roads.model.curves import STANDSTILL, Cubic, Curve, ReferenceLine, Spiral, fresnel
from eidrive_scenario.roads.model.polynomials import piece_borders, spread

EPSILON = float(np.finfo(np.float64).eps)
"""Argument of the cardinal sine in place of 0, as in numpy.sinc."""


class CurveTable:
    """Reference lines of many roads for joint evaluation: line i begins at base[i] of a common axis."""

    def __init__(self, lines: Sequence[ReferenceLine]) -> None:
        self.base: Array = spread([line.length for line in lines])
        # A curve that starts beyond the end of its road is unreachable, and would shadow a curve of the next road.
        reached = [[curve for curve in line.curves if curve.s <= line.length] or line.curves[:1] for line in lines]
        curves = [curve for group in reached for curve in group]
        owner = np.repeat(np.arange(len(lines)), [len(group) for group in reached])
        self._starts = np.array([curve.s for curve in curves])
        self._borders = piece_borders(self.base, owner, self._starts)
        """Starts of all curves but the first one, on the common axis of all lines."""
        x, y, h = (np.array([getattr(curve, name) for curve in curves]) for name in ("x", "y", "h"))
        self._kind = np.array([_kind(curve) for curve in curves], dtype=np.int8)
        self._curvature = np.array([getattr(curve, "curvature", 0.0) for curve in curves])
        self._rate = np.array([getattr(curve, "rate", 0.0) for curve in curves])
        arcs = np.where(self._kind == 0, self._curvature, 0.0)
        self._placing = np.column_stack([self._starts, arcs, x, y, h, np.cos(h), np.sin(h), np.ones_like(x)])
        """Columns of the curves that each evaluation needs: start, curvature of arcs, x, y, heading, its cosine and
        sine, path length per meter of s of lines and arcs."""
        self._spiral = _spiral_columns(self._curvature, self._rate)
        kinds = ((1, self._spirals), (2, self._cubics))
        self._evaluations = [(kind, evaluate) for kind, evaluate in kinds if (self._kind == kind).any()]
        """Kinds of curves on these lines that are neither lines nor arcs, and their evaluation."""
        self._cubic = np.array(
            [(*curve.u, *curve.v) if isinstance(curve, Cubic) else (0.0,) * 8 for curve in curves]
        ).reshape(-1, 8)

    def at(self, line: Integers, s: Array) -> tuple[Array, Array, Array, Array, Array]:
        """Return x, y, heading, curvature and path length per meter of s at s (N,) of lines (N,)."""
        curve = self._curve(line, s)
        start, curvature, x, y, h, cos, sin, speed = self._placing.take(curve, axis=0).T
        ds = s - start
        if np.count_nonzero(curvature):
            turn = curvature * ds
            half = 0.5 * turn
            # As numpy.sinc(half / pi), bit for bit, at half of the time.
            angle = np.pi * (half / np.pi)
            angle = np.where(angle, angle, EPSILON)
            chord = ds * (np.sin(angle) / angle)
            u, v = chord * np.cos(half), chord * np.sin(half)
        else:
            u, v, turn = ds.copy(), np.zeros(len(ds)), np.zeros(len(ds))
        if self._evaluations:
            kind = self._kind.take(curve)
            for number, evaluate in self._evaluations:
                some = (kind == number).nonzero()[0]
                if some.size:
                    u[some], v[some], turn[some], curvature[some], speed[some] = evaluate(curve[some], ds[some])
        return x + cos * u - sin * v, y + sin * u + cos * v, h + turn, curvature, speed

    def _curve(self, line: Integers, s: Array) -> Integers:
        """Return the indices of the curves at s (N,) of lines (N,)."""
        curve: Integers = self._borders.searchsorted(self.base.take(line) + s, side="right")
        return curve

    def _spirals(self, curve: Integers, ds: Array) -> tuple[Array, Array, Array, Array, Array]:
        k, rate, shift, scale, cosine0, sine0, sign, cos, sin = self._spiral.take(curve, axis=0).T
        # Fresnel integrals from the start of the curve, along and across the tangent where the curvature is 0
        sine, cosine = fresnel((ds + shift) * scale)
        along, across = (cosine - cosine0) / scale, sign * (sine - sine0) / scale
        u, v = cos * along - sin * across, sin * along + cos * across
        return u, v, ds * (k + 0.5 * rate * ds), k + rate * ds, np.ones(len(ds))

    def _cubics(self, curve: Integers, p: Array) -> tuple[Array, Array, Array, Array, Array]:
        u0, u1, u2, u3, v0, v1, v2, v3 = self._cubic[curve].T
        du, dv = u1 + p * (2.0 * u2 + 3.0 * p * u3), v1 + p * (2.0 * v2 + 3.0 * p * v3)
        ddu, ddv = 2.0 * u2 + 6.0 * p * u3, 2.0 * v2 + 6.0 * p * v3
        norm = np.hypot(du, dv)
        bend = np.divide(du * ddv - dv * ddu, norm**3, out=np.zeros_like(norm), where=norm > STANDSTILL)
        u, v = u0 + p * (u1 + p * (u2 + p * u3)), v0 + p * (v1 + p * (v2 + p * v3))
        return u, v, np.arctan2(dv, du), bend, norm


def _spiral_columns(curvature: Array, rate: Array) -> Array:
    """Return what the evaluation of spirals needs beside the distance: (C, 9), without meaning for other curves."""
    rate = np.where(rate, rate, 1.0)
    scale, shift = np.sqrt(np.abs(rate) / np.pi), curvature / rate
    sine, cosine = fresnel(shift * scale)
    phase = -0.5 * curvature * shift
    return np.column_stack([curvature, rate, shift, scale, cosine, sine, np.sign(rate), np.cos(phase), np.sin(phase)])


def _kind(curve: Curve) -> int:
    return 2 if isinstance(curve, Cubic) else 1 if isinstance(curve, Spiral) else 0
