"""Covariance intersection: two estimates joined whose errors may depend on each other in a way that nobody knows."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SLACK = 0.01
"""How much larger than the least trace that of the result may be, so that estimates which are about as good count about
the same: the least trace alone would take either of two equal ones whole, and rounding would say which."""


def intersect(a: Array, cov_a: Array, b: Array, cov_b: Array) -> tuple[Array, Array, Array]:
    """The estimate from means (..., 2) with covariances (..., 2, 2): its mean, its covariance, and the weight of a.

    P⁻¹ = w A⁻¹ + (1 - w) B⁻¹, x = P (w A⁻¹ a + (1 - w) B⁻¹ b). P is no smaller than the true covariance of the error,
    whatever the correlation, for any w in [0, 1] (Julier and Uhlmann, A non-divergent estimation algorithm in the
    presence of unknown correlations, American Control Conference 1997). `weight` says which w.
    """
    axx, axy, ayy, det_a = _information(cov_a)
    bxx, bxy, byy, det_b = _information(cov_b)
    w = weight(axx + ayy, det_a, bxx + byy, det_b, axx * byy + ayy * bxx - 2.0 * axy * bxy)
    rest = 1.0 - w
    xx, xy, yy = w * axx + rest * bxx, w * axy + rest * bxy, w * ayy + rest * byy
    determinant = xx * yy - xy * xy
    covariance = np.empty_like(cov_a)
    covariance[..., 0, 0], covariance[..., 1, 1] = yy / determinant, xx / determinant
    covariance[..., 0, 1] = covariance[..., 1, 0] = -xy / determinant
    # x = b + P w A⁻¹ (a - b): exactly b where the means agree.
    dx, dy = w * (a[..., 0] - b[..., 0]), w * (a[..., 1] - b[..., 1])
    gx, gy = axx * dx + axy * dy, axy * dx + ayy * dy
    mean = np.empty_like(a)
    mean[..., 0] = b[..., 0] + (yy * gx - xy * gy) / determinant
    mean[..., 1] = b[..., 1] + (xx * gy - xy * gx) / determinant
    return mean, covariance, w


def weight(trace_a: Array, det_a: Array, trace_b: Array, det_b: Array, mixed: Array) -> Array:
    """(...) the w nearest to a half for which the trace of (w A + (1 - w) B)⁻¹ is the least one, to within SLACK.

    Given are the traces and determinants of A and B, 2 x 2 and positive definite, and the mixed discriminant
    a11 b22 + a22 b11 - 2 a12 b12. In two dimensions tr M⁻¹ = tr M / det M, here (u + v t) / (d + s t + p t²) with
    t = w - 1/2, which is convex. Its slope has the sign of v d - u s - 2 u p t - v p t².
    """
    p = det_a + det_b - mixed
    u, v = 0.5 * (trace_a + trace_b), trace_a - trace_b
    d, s = 0.25 * (det_a + det_b + mixed), det_a - det_b
    # p = det(A - B). Not negative, one of the two is better in all directions. Else the slope grows all along
    # [-1/2, 1/2], as |v| < 2 u, and this is its only root nearby, written without cancellation.
    part, rest = u * p, u * s - v * d
    mixes = p < 0.0
    root = rest / (np.sqrt(np.maximum(part * part - v * p * rest, 0.0)) - np.where(mixes, part, -1.0))
    best = np.where(mixes, np.minimum(np.maximum(root, -0.5), 0.5), np.copysign(0.5, v))
    # Where the middle is too bad, go as far towards the best as need be: the root nearest to 0 of
    # (u + v t) - limit (d + s t + p t²).
    limit = (1.0 + SLACK) * (u + v * best) / (d + best * (s + best * p))
    excess, slope = u - limit * d, v - limit * s
    if not (excess > 0.0).any():
        return np.full_like(excess, 0.5)
    turn = slope + np.copysign(np.sqrt(np.maximum(slope * slope + 4.0 * limit * p * excess, 0.0)), slope)
    return np.where(excess > 0.0, 0.5 - 2.0 * excess / np.where(turn == 0.0, 1.0, turn), 0.5)


def _information(covariance: Array) -> tuple[Array, Array, Array, Array]:
    """Entries xx, xy, yy of the inverses of (..., 2, 2), and their determinants."""
    xx, xy, yy = covariance[..., 0, 0], covariance[..., 0, 1], covariance[..., 1, 1]
    determinant = 1.0 / (xx * yy - xy * xy)
    return yy * determinant, -xy * determinant, xx * determinant, determinant
