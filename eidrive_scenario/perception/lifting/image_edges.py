"""Edges of image boxes: which are those of the object, and which those of the image or of a nearer object."""

from __future__ import annotations

import numpy as np

from eidrive_scenario.arrays import Array, Bools
from eidrive_scenario.sensing.readings import CameraReading

EDGE_DEVIATION = 1.5
"""Standard deviation between the edges of a box and of the object [px]; EDGE_SHARE of the box size is added."""
EDGE_SHARE = 0.02
AT_BORDER = 2.0
"""Distance from the border of the image within which an edge is that of the image, not of the object [px]; EDGE_SHARE
of the box size is added."""
HIDDEN_SHARE = 0.8
"""Share of an edge in a nearer box above which the edge is that of the nearer object. Below it, the rest of the edge
shows the end of this object."""


def edges_in_image(boxes: Array, camera: CameraReading) -> Bools:
    """Return whether (N, 4) the edges of image boxes (N, 4) are those of objects, not of the image."""
    width, height = camera.size
    inside = np.concatenate([boxes[:, :2], (width, height) - boxes[:, 2:]], axis=1)
    return np.asarray(inside > (AT_BORDER + EDGE_SHARE * largest_sides(boxes))[:, None])


def largest_sides(boxes: Array) -> Array:
    """Return the longer side (N,) of image boxes (N, 4) [px]."""
    return np.asarray(np.maximum(boxes[:, 2] - boxes[:, 0], boxes[:, 3] - boxes[:, 1]))


def edges_behind_others(boxes: Array) -> Bools:
    """Return which edges (N, 4) of boxes (N, 4) are where another box hides the object.

    The other box extends lower in the image, so it is nearer, and contains most of the length of the edge.
    """
    low, high = boxes[:, :2], boxes[:, 2:]
    size = np.maximum(high - low, 1e-6)
    nearer = high[None, :, 1] > high[:, None, 1] + EDGE_DEVIATION
    shared = np.minimum(high[:, None], high[None]) - np.maximum(low[:, None], low[None])
    beside = shared > HIDDEN_SHARE * size[:, None]
    margin = EDGE_DEVIATION + EDGE_SHARE * size
    hidden = np.zeros((len(boxes), 4), dtype=bool)
    for edge in range(4):
        axis = edge % 2
        place = boxes[:, edge][:, None]
        within = (place > low[None, :, axis] - margin[:, None, axis]) & (
            place < high[None, :, axis] + margin[:, None, axis]
        )
        hidden[:, edge] = (nearer & within & beside[:, :, 1 - axis]).any(axis=1)
    return hidden
