"""Fusion of two estimates whose errors have an unknown correlation: by covariance intersection."""

from __future__ import annotations

import numpy as np

from eidrive_scenario.base.arrays import Array

TRACE_TOLERANCE = 0.01
"""Maximum relative excess of the trace of the result over the minimum trace.

It gives estimates of similar accuracy similar weights. The minimum alone would select one of two equal estimates
entirely, depending on rounding.
"""


def estimates(mean: Array, covariance: Array) -> Array:
    """Return estimates (5, ...): x, y, and xx, xy, yy of the inverse covariance.

    mean  (..., 2);  covariance  (..., 2, 2)
    """
    xx, xy, yy = covariance[..., 0, 0], covariance[..., 0, 1], covariance[..., 1, 1]
    both = np.empty((5, *xx.shape))
    both[0], both[1] = mean[..., 0], mean[..., 1]
    both[2], both[3], both[4] = yy, -xy, xx
    both[2:] /= xx * yy - xy * xy
    return both


def means(both: Array) -> Array:
    """Return the means (..., 2) of estimates (5, ...)."""
    return np.stack([both[0], both[1]], axis=-1)


def covariances(both: Array) -> Array:
    """Return the covariances (..., 2, 2) of estimates (5, ...)."""
    xx, xy, yy = both[2:] / (both[2] * both[4] - both[3] * both[3])
    covariance = np.empty((*xx.shape, 2, 2))
    covariance[..., 0, 0], covariance[..., 1, 1] = yy, xx
    covariance[..., 0, 1] = covariance[..., 1, 0] = -xy
    return covariance


def intersect(a: Array, b: Array) -> tuple[Array, Array]:
    """Return the fused estimates (5, ...) and the weights (...) of a.

    P⁻¹ = w A⁻¹ + (1 - w) B⁻¹, x = P (w A⁻¹ a + (1 - w) B⁻¹ b). P is at least the true covariance of the error for any
    correlation and any w in [0, 1] (Julier and Uhlmann, A non-divergent estimation algorithm in the presence of unknown
    correlations, American Control Conference 1997). `weight` computes w.
    """
    both = a - b
    dx, dy, axx, axy, ayy = both[0], both[1], a[2], a[3], a[4]
    bxx, bxy, byy = b[2], b[3], b[4]
    mixed = axx * byy + ayy * bxx - 2.0 * axy * bxy
    w = weight(axx + ayy, axx * ayy - axy * axy, bxx + byy, bxx * byy - bxy * bxy, mixed)
    gx, gy = axx * dx + axy * dy, axy * dx + ayy * dy
    both *= w
    both += b
    xx, xy, yy = both[2], both[3], both[4]
    share = w / (xx * yy - xy * xy)
    # x = b + P w A⁻¹ (a - b): exactly b if the means agree.
    both[0] = b[0] + share * (yy * gx - xy * gy)
    both[1] = b[1] + share * (xx * gy - xy * gx)
    return both, w


def fuse(a: Array, b: Array, gate: float) -> Array:
    """Return the fused estimates (5, ...): their intersection, or the weighted mean of both if they disagree.

    gate  squared Mahalanobis distance of the means above which they disagree

    At least one covariance is then too small, and intersection would extrapolate: two long ellipses meet beside both
    means. Either may be wrong, so the result has mean and covariance of a Gaussian mixture of both with the weights of
    the intersection: w a + (1 - w) b, and w A⁻¹ + (1 - w) B⁻¹ + w (1 - w) d dᵀ for the covariances A⁻¹ and B⁻¹.
    """
    fused, w = intersect(a, b)
    apart = _squared_distance(a, b) > gate
    if apart.any():
        first, second, share = a[:, apart], b[:, apart], w[apart]
        offset = means(first) - means(second)
        spread = offset[..., :, None] * offset[..., None, :]
        of_first, of_second = share[..., None, None], 1.0 - share[..., None, None]
        fused[:, apart] = estimates(
            means(second) + share[..., None] * offset,
            of_first * covariances(first) + of_second * covariances(second) + of_first * of_second * spread,
        )
    return fused


def _squared_distance(a: Array, b: Array) -> Array:
    """Return the squared Mahalanobis distances (...) of estimates, for the sum of both covariances.

    With the inverse covariances A and B it is dᵀ A (A + B)⁻¹ B d.
    """
    dx, dy = a[0] - b[0], a[1] - b[1]
    xx, xy, yy = a[2:] + b[2:]
    ux, uy = b[2] * dx + b[3] * dy, b[3] * dx + b[4] * dy
    vx, vy = a[2] * dx + a[3] * dy, a[3] * dx + a[4] * dy
    squared: Array = (vx * (yy * ux - xy * uy) + vy * (xx * uy - xy * ux)) / (xx * yy - xy * xy)
    return squared


def weight(trace_a: Array, det_a: Array, trace_b: Array, det_b: Array, mixed: Array) -> Array:
    """Return the w nearest to 1/2 whose trace of (w A + (1 - w) B)⁻¹ is minimal within TRACE_TOLERANCE (...).

    Arguments are the traces and determinants of A and B, 2 x 2 and positive definite, and the mixed discriminant
    a11 b22 + a22 b11 - 2 a12 b12. In two dimensions tr M⁻¹ = tr M / det M, here (u + v t) / (d + s t + p t²) with
    t = w - 1/2, which is convex. Its slope has the sign of v d - u s - 2 u p t - v p t².
    """
    p = det_a + det_b - mixed
    u, v = 0.5 * (trace_a + trace_b), trace_a - trace_b
    d, s = 0.25 * (det_a + det_b + mixed), det_a - det_b
    # p = det(A - B). If it is not negative, one estimate is better in all directions. Otherwise the slope increases on
    # [-1/2, 1/2], because |v| < 2 u, and this is its only root there, computed without cancellation.
    part, rest = u * p, u * s - v * d
    mixes = p < 0.0
    root = rest / (np.sqrt(np.maximum(part * part - v * p * rest, 0.0)) - np.where(mixes, part, -1.0))
    best = np.where(mixes, np.minimum(np.maximum(root, -0.5), 0.5), np.copysign(0.5, v))
    # If w = 1/2 exceeds the tolerance, the result is the root of (u + v t) - limit (d + s t + p t²) nearest to 0.
    limit = (1.0 + TRACE_TOLERANCE) * (u + v * best) / (d + best * (s + best * p))
    excess, slope = u - limit * d, v - limit * s
    if not (excess > 0.0).any():
        return np.full_like(excess, 0.5)
    turn = slope + np.copysign(np.sqrt(np.maximum(slope * slope + 4.0 * limit * p * excess, 0.0)), slope)
    return np.where(excess > 0.0, 0.5 - 2.0 * excess / np.where(turn == 0.0, 1.0, turn), 0.5)
