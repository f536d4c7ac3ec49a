"""Objects in the output maps of the network `pillars`."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from eidrive_scenario.base.arrays import Array, Floats, Integers

ATTRIBUTES = 13
"""Maps after those of the classes: offset of the box center from the center of the cell in x and y [cells], height of
the box center above the ground [m], log of length, width and height [m], cosine and sine of the heading, cosine and
sine of twice the heading, displacement between the two scans in x and y [m], log of the standard deviation of the
position in each axis [m]."""
LARGEST_LOG = 5.0
"""Largest magnitude of a logarithm: sizes and deviations are between 7 mm and 148 m."""
MOST_OBJECTS = 300
"""Maximum number of objects; those with the highest scores are used."""


class Objects(NamedTuple):
    """Objects in the level frame of a grid.

    boxes         (N, 7), with z above the ground [m, rad];  scores  (N,);  classes  (N,) numbers
    displacement  (N, 2) between the two scans [m];  deviation  (N,) of the position in each axis [m]
    """

    boxes: Array
    scores: Array
    classes: Integers
    displacement: Array
    deviation: Array


def decode(maps: Floats, cell: float, confidence: float) -> Objects:
    """Return the objects in maps (C + 13, n, n) with cells of edge `cell` [m].

    An object is a cell whose class probability is at least `confidence`, and that of no neighbor is higher. The axis of
    its heading is that of the map of twice the heading, which is the same for opposite headings and thus reliable
    where the front is not visible; its front is the one nearer to the map of the heading.
    """
    logits, attributes = maps[:-ATTRIBUTES], maps[-ATTRIBUTES:]
    highest = logits.max(axis=0)
    x, y = np.nonzero((highest >= math.log(confidence / (1.0 - confidence))) & (highest >= _around(highest)))
    order = np.argsort(-highest[x, y], kind="stable")[:MOST_OBJECTS]
    x, y = x[order], y[order]
    dx, dy, z, *sizes, cos, sin, twice_cos, twice_sin, vx, vy, deviation = attributes[:, x, y].astype(float)
    n = len(highest)
    axis = np.arctan2(twice_sin, twice_cos) / 2.0
    front = np.where(np.cos(axis) * cos + np.sin(axis) * sin < 0.0, np.pi, 0.0)
    plan = ((x + 0.5 - n / 2 + dx) * cell, (y + 0.5 - n / 2 + dy) * cell)
    return Objects(
        np.stack([*plan, z, *_bounded_exp(np.array(sizes)), axis + front], axis=1),
        1.0 / (1.0 + np.exp(-highest[x, y].astype(float))),
        logits[:, x, y].argmax(axis=0),
        np.stack([vx, vy], axis=1),
        _bounded_exp(deviation),
    )


def _bounded_exp(logarithm: Array) -> Array:
    return np.asarray(np.exp(np.clip(logarithm, -LARGEST_LOG, LARGEST_LOG)))


def class_probability(maps: Floats) -> Floats:
    """Return the maximum class probability (n, n) of each cell of maps (C + 13, n, n)."""
    highest = maps[:-ATTRIBUTES].max(axis=0)
    with np.errstate(over="ignore"):  # infinity gives 0
        return np.asarray(1.0 / (1.0 + np.exp(-highest)), dtype=np.float32)


def _around(values: Floats) -> Floats:
    """Return the maximum of each cell (n, n) and its neighbors."""
    padded = np.pad(values, 1, constant_values=-np.inf)
    rows = np.maximum(np.maximum(padded[:-2], padded[1:-1]), padded[2:])
    return np.maximum(np.maximum(rows[:, :-2], rows[:, 1:-1]), rows[:, 2:])
