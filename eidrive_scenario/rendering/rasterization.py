"""Rasterization: the nearest triangle of each pixel."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Array, Floats
from eidrive_scenario.base.kernels import kernel

_LEAST = np.float32(1e-30)
"""Nearness of infinite distance; 0 means no triangle."""

_NEEDLE = 1e-10
"""Width over length of a triangle like a needle: the slopes of its nearness are rounding errors, which would place it
in front of its nearest corner or infinitely far away."""


class Cover(NamedTuple):
    """Visible triangles of an image.

    triangle  (h, w) index, -1 without a triangle
    nearness  (h, w) at the pixel, 0 without a triangle
    """

    triangle: NDArray[np.int32]
    nearness: Floats

    def draw(self, x: Array, y: Array, nearness: Array, first: int = 0) -> None:
        """Draw triangles given by x, y [px] and nearness (3, N) of their corners; `first` is the index of the first.

        A pixel shows the triangle of maximum nearness among those that contain its center. Nearness must be positive
        and linear in the image: 1 / depth in perspective. In a tie the later triangle wins. A center on an edge belongs
        to the triangle right of or below that edge, so that neighbors neither overlap nor leave gaps. The result of one
        triangle does not depend on others except by occlusion.
        """
        x, y, nearness = (np.ascontiguousarray(part, dtype=np.float64) for part in (x, y, nearness))
        _draw(x, y, nearness, first, self.triangle, self.nearness)


def rasterize(x: Array, y: Array, nearness: Array, width: int, height: int) -> Cover:
    """Return the visible triangles of an image, as `Cover.draw` defines them."""
    cover = Cover(np.full((height, width), -1, dtype=np.int32), np.zeros((height, width), dtype=np.float32))
    cover.draw(x, y, nearness)
    return cover


@kernel("i8(f8, i8)")
def _first_center(position: float, count: int) -> int:
    """Return the first of `count` pixels whose center is at or beyond a position, `count` if there is none."""
    pixel = np.ceil(position - 0.5)
    if not pixel > 0.0:
        return 0
    return int(pixel) if pixel < count else count


@kernel("void(f8[:,::1], f8[:,::1], f8[:,::1], i8, i4[:,::1], f4[:,::1])")
def _draw(
    x: Array, y: Array, nearness: Array, first: int, triangle: NDArray[np.int32], near: Floats
) -> None:  # fmt: skip
    height, width = triangle.shape
    for number in range(x.shape[1]):
        # Corners from the uppermost to the lowest
        a, b, c = 0, 1, 2
        if y[b, number] < y[a, number]:
            a, b = b, a
        if y[c, number] < y[b, number]:
            b, c = c, b
        if y[b, number] < y[a, number]:
            a, b = b, a
        x0, x1, x2 = x[a, number], x[b, number], x[c, number]
        y0, y1, y2 = y[a, number], y[b, number], y[c, number]
        n0, n1, n2 = nearness[a, number], nearness[b, number], nearness[c, number]
        top, bottom = _first_center(y0, height), _first_center(y2, height)
        if top >= bottom or max(x0, x1, x2) <= 0.5 or min(x0, x1, x2) >= width:
            continue
        twice_area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
        rightwards = ((n1 - n0) * (y2 - y0) - (n2 - n0) * (y1 - y0)) / twice_area
        downwards = ((n2 - n0) * (x1 - x0) - (n1 - n0) * (x2 - x0)) / twice_area
        extent = max(abs(x1 - x0), abs(x2 - x0), y2 - y0)
        if not abs(twice_area) > _NEEDLE * extent * extent:
            rightwards = downwards = 0.0
        start = n0 - x0 * rightwards
        along_long, along_upper, along_lower = (x2 - x0) / (y2 - y0), (x1 - x0) / (y1 - y0), (x2 - x1) / (y2 - y1)
        for line in range(top, bottom):
            at = line + 0.5
            x_long = x0 + (at - y0) * along_long
            x_bent = x1 + (at - y1) * along_lower if at >= y1 else x0 + (at - y0) * along_upper
            level = start + (at - y0) * downwards
            for column in range(_first_center(min(x_long, x_bent), width), _first_center(max(x_long, x_bent), width)):
                value = max(np.float32(level + (column + 0.5) * rightwards), _LEAST)
                if value >= near[line, column]:
                    near[line, column] = value
                    triangle[line, column] = first + number
