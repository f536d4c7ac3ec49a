"""Fresnel integrals: by their power series for the spirals of usual roads, by scipy for longer ones."""

from __future__ import annotations

import math
from typing import Any, overload

import numpy as np

from eidrive_scenario.arrays import Array

LONGEST = 1.6
"""Maximum argument of the series. It belongs to a spiral that turns by 4 rad from its straight end."""
_TERMS = 17
_SINE = [(-1) ** n * (math.pi / 2.0) ** (2 * n + 1) / (math.factorial(2 * n + 1) * (4 * n + 3)) for n in range(_TERMS)][
    ::-1
]
_COSINE = [(-1) ** n * (math.pi / 2.0) ** (2 * n) / (math.factorial(2 * n) * (4 * n + 1)) for n in range(_TERMS)][::-1]
_BOTH = np.array([_SINE, _COSINE]).T[:, :, None]
"""Coefficients of the sine and the cosine integral: (_TERMS, 2, 1)."""


@overload
def fresnel(x: float) -> tuple[float, float]: ...
@overload
def fresnel(x: Array) -> tuple[Array, Array]: ...
def fresnel(x: float | Array) -> tuple[float | Array, float | Array]:
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


@overload
def _series(x: float) -> tuple[float, float]: ...
@overload
def _series(x: Array) -> tuple[Array, Array]: ...
def _series(x: float | Array) -> tuple[float | Array, float | Array]:
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
