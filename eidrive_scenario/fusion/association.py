"""Which boxes of two lists show the same object."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

Array = NDArray[np.float64]

OUTSIDE = 1e6
"""Cost of a pair beyond the gate: finite, so that a full assignment exists, and larger than any sum of gated costs."""


def associate(first: Array, second: Array, gate: float) -> list[tuple[int, int]]:
    """Pairs (row of first, row of second) of centres (N, 3) and (M, 3) that lie nearer than `gate` [m].

    The assignment pairs as many as possible and has the least sum of distances; each row is used at most once.
    """
    if not len(first) or not len(second):
        return []
    offset = first[:, None, :] - second[None, :, :]
    distance = np.sqrt(np.einsum("nmi,nmi->nm", offset, offset))
    inside = distance < gate
    rows, columns = np.nonzero(inside)
    if len(set(rows.tolist())) < len(rows) or len(set(columns.tolist())) < len(columns):
        rows, columns = linear_sum_assignment(np.where(inside, distance, OUTSIDE))
    return [(row, column) for row, column in zip(rows.tolist(), columns.tolist(), strict=True) if inside[row, column]]
