"""Piecewise cubic polynomials a + b·ds + c·ds² + d·ds³, the form of all profiles in OpenDRIVE."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Sequence
from itertools import accumulate

import numpy as np

from eidrive_scenario.base.arrays import Array, Integers

Piece = tuple[float, float, float, float, float]
"""Start s of a piece and its coefficients a, b, c, d; ds counts from that start."""
ROUNDING = 1e-6
"""Maximum difference of two starts that is attributed to rounding [m]."""
GAP = 1.0
"""Distance between two functions on a common axis [m]. Half of it belongs to each, as s may be beyond both ends."""


class Polynomials:
    """Function of s on [0, ∞). Each piece extends to the start of the next; before the first the value is 0."""

    __slots__ = ("constant_value", "is_zero", "pieces", "starts")

    def __init__(self, pieces: Iterable[Piece] = ()) -> None:
        ordered = sorted(pieces, key=lambda piece: piece[0])
        if ordered and 0.0 < ordered[0][0] <= ROUNDING:
            ordered[0] = (0.0, *ordered[0][1:])
        if not ordered or ordered[0][0] > 0.0:
            ordered.insert(0, (0.0, 0.0, 0.0, 0.0, 0.0))
        self.pieces: list[Piece] = ordered[:1]
        for piece in ordered[1:]:
            before = self.pieces[-1]
            if not piece[1:] == (before[1], 0.0, 0.0, 0.0) == before[1:]:  # unless it continues a constant value
                self.pieces.append(piece)
        self.starts = [piece[0] for piece in self.pieces]
        is_constant = len(self.pieces) == 1 and ordered[0][2:] == (0.0, 0.0, 0.0)
        self.constant_value: float | None = ordered[0][1] if is_constant else None
        """Value of a function with a single, constant piece; None for others."""
        self.is_zero = self.constant_value == 0.0
        """True if the function is 0 everywhere."""

    def value(self, s: float) -> float:
        """Return the value at s."""
        if self.constant_value is not None:
            return self.constant_value
        start, a, b, c, d = self.pieces[bisect_right(self.starts, s, 1) - 1]
        ds = s - start
        return a + ds * (b + ds * (c + ds * d))

    def value_and_slope(self, s: float) -> tuple[float, float]:
        """Return the value and the derivative at s."""
        if self.constant_value is not None:
            return self.constant_value, 0.0
        start, a, b, c, d = self.pieces[bisect_right(self.starts, s, 1) - 1]
        ds = s - start
        return a + ds * (b + ds * (c + ds * d)), b + ds * (2.0 * c + 3.0 * ds * d)

    def to_second_order(self, s: float) -> tuple[float, float, float]:
        """Return the value and the first two derivatives at s."""
        value, slope, half_bend, _ = self.coefficients_at(s)
        return value, slope, 2.0 * half_bend

    def coefficients_at(self, s: float) -> tuple[float, float, float, float]:
        """Return the coefficients of the polynomial at s with ds counted from s."""
        start, a, b, c, d = self.pieces[bisect_right(self.starts, s, 1) - 1]
        ds = s - start
        return a + ds * (b + ds * (c + ds * d)), b + ds * (2.0 * c + 3.0 * ds * d), c + 3.0 * ds * d, d

    def shifted(self, origin: float) -> Polynomials:
        """Return the function with s counted from `origin`. The part before it is dropped."""
        first = (0.0, *self.coefficients_at(origin))
        return Polynomials([first, *((p[0] - origin, *p[1:]) for p in self.pieces if p[0] > origin)])


def combine(terms: Sequence[tuple[float, Polynomials]]) -> Polynomials:
    """Return the exact sum of factor times function over the union of their pieces."""
    starts = sorted({start for _, function in terms for start in function.starts})
    pieces: list[Piece] = []
    for start in starts:
        a = b = c = d = 0.0
        for factor, function in terms:
            pa, pb, pc, pd = function.coefficients_at(start)
            a, b, c, d = a + factor * pa, b + factor * pb, c + factor * pc, d + factor * pd
        pieces.append((start, a, b, c, d))
    return Polynomials(pieces)


class PolynomialTable:
    """Functions with individual ranges of s for joint evaluation.

    Function i occupies the interval from base[i] to base[i] + span[i], and half of GAP on both sides, of a common axis.
    One binary search thus finds the pieces of any mixture of functions.
    """

    def __init__(self, functions: Sequence[Polynomials], spans: Sequence[float]) -> None:
        self.base: Array = spread(spans)
        counts = [len(function.pieces) for function in functions]
        pieces = np.array([piece for function in functions for piece in function.pieces], dtype=np.float64)
        pieces = pieces.reshape(-1, 5)
        # A piece that starts beyond the span of its function is unreachable, and would shadow the next function.
        limit = np.repeat(np.asarray(spans, dtype=np.float64), counts) if counts else np.empty(0)
        owner = np.repeat(np.arange(len(functions)), counts)
        reached = pieces[:, 0] <= limit
        pieces, owner = pieces[reached], owner[reached]
        self._borders = piece_borders(self.base, owner, pieces[:, 0])
        """Starts of all pieces but the first one, on the common axis."""
        self._pieces = pieces
        """Start and coefficients a, b, c, d of each piece."""
        self._a = np.ascontiguousarray(pieces[:, 1])
        self._constant = bool(np.all(pieces[:, 2:] == 0.0))
        self._single = len(pieces) == len(functions)

    def _piece(self, function: Integers, s: Array) -> Integers:
        if self._single:
            return function
        piece: Integers = self._borders.searchsorted(self.base.take(function) + s, side="right")
        return piece

    def value(self, function: Integers, s: Array) -> Array:
        """Return the values of functions `function` (N,) at s (N,)."""
        piece = self._piece(function, s)
        if self._constant:
            return self._a.take(piece)
        start, a, b, c, d = self._pieces.take(piece, axis=0).T
        ds = s - start
        return np.asarray(a + ds * (b + ds * (c + ds * d)))

    def value_and_slope(self, function: Integers, s: Array) -> tuple[Array, Array]:
        """Return the values and derivatives of functions at s."""
        piece = self._piece(function, s)
        if self._constant:
            return self._a.take(piece), np.zeros(piece.shape)
        start, a, b, c, d = self._pieces.take(piece, axis=0).T
        ds = s - start
        return a + ds * (b + ds * (c + ds * d)), b + ds * (2.0 * c + 3.0 * ds * d)

    def to_second_order(self, function: Integers, s: Array) -> tuple[Array, Array, Array]:
        """Return the values and first two derivatives of functions at s."""
        piece = self._piece(function, s)
        start, a, b, c, d = self._pieces.take(piece, axis=0).T
        ds = s - start
        value, slope = a + ds * (b + ds * (c + ds * d)), b + ds * (2.0 * c + 3.0 * ds * d)
        return value, slope, 2.0 * c + 6.0 * ds * d

    @property
    def is_zero(self) -> bool:
        """True if all functions are 0 everywhere."""
        return self._constant and not self._a.any()


def spread(spans: Sequence[float]) -> Array:
    """Return the starts of intervals with the given lengths on a common axis, GAP apart."""
    return np.fromiter(accumulate((span + GAP for span in spans), initial=0.0), dtype=np.float64)[:-1]


def piece_borders(base: Array, owner: Integers, starts: Array) -> Array:
    """Return the starts of all pieces but the first one on the axis of `base`.

    owner   function of each piece (P,), in ascending order
    starts  start of each piece in its function (P,) [m]; the first piece begins half of GAP before its function
    """
    is_first = np.diff(owner, prepend=-1) > 0
    return np.asarray((base[owner] + np.where(is_first, -0.5 * GAP, np.maximum(starts, -0.5 * GAP)))[1:])
