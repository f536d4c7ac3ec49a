"""Cells of a heat map: colored rectangles around the values of two axes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.colors import Colormap, Normalize

from eidrive_scenario.arrays import Array


def heat_cells(
    axes: Axes,
    xs: Sequence[float],
    ys: Sequence[float],
    values: Array,
    *,
    colors: str | Colormap,
    scale: Normalize,
    line: float = 0.5,
) -> QuadMesh:
    """Draw values (len(ys), len(xs)) as rectangles around sorted xs and ys. NaN draws none.

    line  width of the white lines between cells [pt]
    """
    style: dict[str, Any] = {"edgecolors": "white", "linewidth": line} if line else {}
    return axes.pcolormesh(cell_edges(xs), cell_edges(ys), values, cmap=colors, norm=scale, **style)


def cell_edges(values: Sequence[float]) -> Array:
    """Return the edges of cells around sorted values."""
    if len(values) == 1:
        return np.array([values[0] - 0.5, values[0] + 0.5])
    inner = (np.array(values[1:]) + np.array(values[:-1])) / 2.0
    return np.concatenate([[2 * values[0] - inner[0]], inner, [2 * values[-1] - inner[-1]]])
