"""Labels beside outlines, placed where they cover least of other outlines and labels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.reporting.drawing.canvas import Canvas
from eidrive_scenario.reporting.drawing.top_view import TRUTH

GAP = 0.6
"""Distance of a label from its outline, as a share of its height."""
PADDING = 0.25
"""Minimum distance between labels, as a share of their height."""
Rectangle: TypeAlias = tuple[float, float, float, float]
"""Left, top, right and bottom [units]."""


def write_labels(
    canvas: Canvas,
    texts: Sequence[str],
    outlines: Sequence[Array],
    taken: Sequence[Rectangle] | Array = (),
    *,
    colors: Sequence[str] = (),
    size: float = 1.0,
    inside: bool = False,
) -> Array:
    """Write a label beside each outline (M, 2) [m] inside the section; earlier ones come first.

    A label that would cover another one or a rectangle of `taken` is omitted.

    colors  of the labels; dark without them
    size    in sizes of the label of an actor
    inside  whether they are at the centers of the outlines instead

    Return the rectangles (N, 4) of the labels and outlines, with those that were taken before.
    """
    shown = [index for index, outline in enumerate(outlines) if texts[index] and canvas.window.reaches(outline)]
    bodies = np.array([_rectangle(canvas, outlines[index]) for index in shown]).reshape(-1, 4)
    labels = np.array([*canvas.reserved, *taken], dtype=float).reshape(-1, 4)
    for row, index in enumerate(shown):
        others = np.delete(bodies, row, axis=0)
        extent = canvas.label_size(texts[index], size)
        places = _centered(extent, bodies[row]) if inside else label_places(extent, bodies[row])
        outside = (places[:, :2] < 0.0).any(axis=1) | (places[:, 2:] > canvas.size).any(axis=1)
        covered = overlaps(places + PADDING * extent[1] * np.array([-1.0, -1.0, 1.0, 1.0]), labels)
        best = int(np.argmin(overlaps(places, others) + covered + np.where(outside, extent[0] * extent[1], 0.0)))
        if covered[best] == 0.0:
            labels = np.vstack([labels, places[best]])
            left, _, _, base = places[best].tolist()
            canvas.label(texts[index], left, base, size, colors[index] if colors else TRUTH)
    return np.vstack([labels, bodies])


def wrapped(canvas: Canvas, text: str, width: float, size: float) -> list[str]:
    """Return the lines of a text that are at most as wide [units], unless a word is wider."""
    lines = [""]
    for word in text.split():
        longer = f"{lines[-1]} {word}".strip()
        if not lines[-1] or canvas.label_size(longer, size)[0] <= width:
            lines[-1] = longer
        else:
            lines.append(word)
    return lines


def _rectangle(canvas: Canvas, outline: Array) -> Rectangle:
    left, bottom = canvas.position(outline[:, :2].min(axis=0).tolist())
    right, top = canvas.position(outline[:, :2].max(axis=0).tolist())
    return left, top, right, bottom


def label_places(size: tuple[float, float], outline: Array) -> Array:
    """Return the places (4, 4) of a label of this width and height right, left, above and below an outline."""
    (width, height), (left, top, right, bottom) = size, outline
    gap, middle, base = GAP * height, (left + right - width) / 2.0, (top + bottom + height) / 2.0
    starts = [(right + gap, base), (left - gap - width, base), (middle, top - gap), (middle, bottom + gap + height)]
    return np.array([(x, y - height, x + width, y) for x, y in starts])


def _centered(size: tuple[float, float], outline: Array) -> Array:
    middle, half = (outline[:2] + outline[2:]) / 2.0, np.array(size) / 2.0
    return np.concatenate([middle - half, middle + half])[None]


def overlaps(places: Array, others: Array) -> Array:
    """Return the common area of each of the rectangles (N, 4) with the others (M, 4)."""
    low = np.maximum(places[:, None, :2], others[None, :, :2])
    high = np.minimum(places[:, None, 2:], others[None, :, 2:])
    common: Array = np.prod(np.maximum(high - low, 0.0), axis=2).sum(axis=1)
    return common
