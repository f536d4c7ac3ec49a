"""Array types that all packages share."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Integers = NDArray[np.int64]
Bools = NDArray[np.bool_]
Bytes = NDArray[np.uint8]


def of_each(function: Callable[[float], float], values: Array) -> Array:
    """Return the values (N,) of a function of `math`, whose bits differ from those of array functions."""
    return np.fromiter(map(function, values.tolist()), float, len(values))


def number_in_groups(counts: Integers) -> tuple[Integers, Integers]:
    """Return the group of each element of consecutive groups with `counts` elements, and its number in the group."""
    group = np.arange(len(counts)).repeat(counts)
    return group, np.arange(len(group)) - (counts.cumsum() - counts)[group]
