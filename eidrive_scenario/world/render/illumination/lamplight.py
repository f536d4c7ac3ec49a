"""Light of headlamps in an image, computed for every second pixel in both directions and interpolated."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.arrays import Floats
from eidrive_scenario.world.render.camera_view import CameraView
from eidrive_scenario.world.render.culling import Surfaces
from eidrive_scenario.world.render.illumination import lamps
from eidrive_scenario.world.render.rasterization import Cover

_BESIDE_THE_CAMERA = 4.0
"""Maximum distance of lamps that illuminate along the rays of the camera, so that sheeting returns the light [m]."""
_SQUARE = np.ones((3, 3), dtype=np.uint8)


class Lamplight(NamedTuple):
    """Light on the surfaces in pixels (P,), and light across the rays of lamps beside the camera [lx]."""

    received: Floats
    across: Floats


def lamplight(beams: Sequence[lamps.Beam], cover: Cover, surfaces: Surfaces, view: CameraView) -> Lamplight | None:
    """Return the light of all beams; None if the image is empty."""
    triangle = cover.triangle[::2, ::2]
    seen = triangle >= 0
    if not seen.any():
        return None
    numbers = np.arange(cover.triangle.size).reshape(view.shape)[::2, ::2][seen]
    far = np.float32(1.0) / cover.nearness.ravel()[numbers]
    x, y, z = (ray * far for ray in view.rays(view.x[numbers], view.y[numbers]))
    normals = surfaces.normal[:, triangle[seen]]
    canvas = lamps.Canvas(x, y, z, (normals[0], normals[1], normals[2]), lamps.numbered(seen))
    sampled = lamps.Sample.of(canvas)
    received, across = (np.zeros(len(numbers), dtype=np.float32) for _ in range(2))
    for beam in beams:
        shone = lamps.shine(beam, view.place, canvas, sampled)
        if shone is not None:
            rows, onto, straight = shone
            received[rows] += onto
            if float(np.linalg.norm(beam.position - view.place)) < _BESIDE_THE_CAMERA:
                across[rows] += straight
    with np.errstate(divide="ignore"):
        distance = view.length.reshape(view.shape) / cover.nearness
    received, across = (_spread(part, seen, distance).ravel() for part in (received, across))
    return Lamplight(received, across)


def _spread(values: Floats, seen: NDArray[np.bool_], distance: Floats) -> Floats:
    """Return values of every second pixel in both directions for all pixels (H, W).

    A pixel whose sample is empty uses the maximum of its neighbors. A pixel at another depth than the sample uses the
    minimum, so that light does not leak over edges.
    """

    import cv2

    grid = np.full(seen.shape, np.float32(-1.0))
    grid[seen] = values
    greatest = np.asarray(cv2.dilate(grid, _SQUARE), dtype=np.float32)
    known: Floats = np.where(grid < 0.0, np.float32(np.inf), grid)
    least = np.asarray(cv2.erode(known, _SQUARE), dtype=np.float32)
    grid = np.where(grid < 0.0, np.maximum(greatest, np.float32(0.0)), grid)
    sampled = np.where(seen, distance[::2, ::2], np.float32(0.0))
    with np.errstate(invalid="ignore"):
        near = np.abs(_doubled(sampled, distance.shape) - distance) < np.float32(0.06) * distance
    whole = _doubled(grid, distance.shape)
    found: Floats = np.where(near, whole, np.minimum(_doubled(least, distance.shape), whole))
    return found


def _doubled(grid: Floats, shape: tuple[int, ...]) -> Floats:
    """Return a grid of every second pixel in both directions at all pixels."""
    found: Floats = np.repeat(np.repeat(grid, 2, axis=0)[: shape[0]], 2, axis=1)[:, : shape[1]]
    return found
