"""Camera at a pose: rays through its pixels, culling of triangles, and their projection to the image."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Array, Floats, Integers
from eidrive_scenario.base.kernels import kernel
from eidrive_scenario.rendering.model import MeshInstance
from eidrive_scenario.world.camera import Pinhole


class CameraView:
    """Camera at a pose (4, 4): camera to world, x right, y down, z forward.

    position  (3,) in the world [m]
    turn      (3, 3) rotation to world axes
    own       (3, P) x and y of the rays through the pixels in the camera frame at depth 1, and their length
    """

    def __init__(self, pose: Array, pinhole: Pinhole) -> None:
        self.pose = pose
        self.pinhole = pinhole
        self.position: Array = pose[:3, 3]
        self.shape = (pinhole.height, pinhole.width)
        self.turn = np.ascontiguousarray(pose[:3, :3], dtype=np.float32)
        self.own = _own_rays(pinhole)

    def places(self, pixels: Integers, nearness: Floats) -> Floats:
        """Return x, y, z relative to the camera and distance from it (4, n) [m] of points in pixels.

        nearness  (H, W) 1 / depth of all pixels [1/m]
        """
        places = np.empty((4, len(pixels)), dtype=np.float32)
        _find_places(pixels, nearness.ravel(), self.own, self.turn, places)
        return places

    def directions(self, pixels: Integers) -> Floats:
        """Return unit vectors (3, n) through pixels in world axes."""
        directions = np.empty((3, len(pixels)), dtype=np.float32)
        _find_directions(pixels, self.own, self.turn, directions)
        return directions


@kernel("void(i8[::1], f4[::1], f4[:,::1], f4[:,::1], f4[:,::1])")
def _find_places(pixels: Integers, nearness: Floats, own: Floats, turn: Floats, places: Floats) -> None:
    for row, pixel in enumerate(pixels):
        depth = np.float32(1.0) / nearness[pixel]
        for axis in range(3):
            places[axis, row] = _ray(pixel, own, turn, axis) * depth
        places[3, row] = own[2, pixel] * depth


@kernel("void(i8[::1], f4[:,::1], f4[:,::1], f4[:,::1])")
def _find_directions(pixels: Integers, own: Floats, turn: Floats, directions: Floats) -> None:
    for row, pixel in enumerate(pixels):
        for axis in range(3):
            directions[axis, row] = _ray(pixel, own, turn, axis) / own[2, pixel]


@kernel("f4(i8, f4[:,::1], f4[:,::1], i8)")
def _ray(pixel: int, own: Floats, turn: Floats, axis: int) -> np.float32:
    """Return a coordinate of the ray through a pixel in world axes, at depth 1."""
    return turn[axis, 0] * own[0, pixel] + turn[axis, 1] * own[1, pixel] + turn[axis, 2]  # type: ignore[no-any-return]


@lru_cache(maxsize=32)
def _own_rays(pinhole: Pinhole) -> Floats:
    columns = (np.arange(pinhole.width) + 0.5 - pinhole.center_x) / pinhole.focal
    rows = (np.arange(pinhole.height) + 0.5 - pinhole.center_y) / pinhole.focal
    x, y = (grid.ravel().astype(np.float32) for grid in np.meshgrid(columns, rows))
    return np.stack([x, y, np.sqrt(x * x + y * y + np.float32(1.0))])


_COARSE_PIXELS = 14.0
"""Minimum diameter of a model in pixels for its full geometry; smaller ones are drawn coarsely."""


class Surfaces(NamedTuple):
    """Properties of N triangles: normal in the world (N, 3), albedo (N, 3), finish (N,), label (N,), emission (N, 3)
    [cd/m²].
    """

    normal: Floats
    albedo: Floats
    finish: NDArray[np.uint8]
    label: NDArray[np.int32]
    glow: Floats

    @classmethod
    def concatenate(cls, parts: Sequence[Surfaces]) -> Surfaces:
        """Return the triangles of all parts in sequence."""
        return cls(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))

    def take(self, rows: NDArray[np.int64]) -> Surfaces:
        """Return the properties of some triangles."""
        return Surfaces._make(column.take(rows, axis=0) for column in self)


class VisibleGeometry(NamedTuple):
    """Triangles in front of a camera: x, y [px] and 1 / depth [1/m] (3, N) of their corners."""

    x: Array
    y: Array
    nearness: Array
    surfaces: Surfaces


def cull_and_project(instances: Sequence[MeshInstance], pose: Array, pinhole: Pinhole) -> VisibleGeometry:
    """Return triangles that face the camera and may be in its image, clipped at its near plane."""
    sides = _sides(pinhole)
    parts = [
        _facing(instance, pose, pinhole, sides, pixels)
        for instance, pixels in _in_sight(instances, pose, pinhole, sides)
    ]
    if not parts:
        empty = np.empty((0, 3), dtype=np.float32)
        none = Surfaces(empty, empty, np.empty(0, dtype=np.uint8), np.empty(0, dtype=np.int32), empty)
        parts = [(np.empty((0, 3, 3), dtype=np.float32), none)]
    corners = np.concatenate([part for part, _ in parts])
    # Corners and axes first: (3, 3, N).
    (x, y, depth), whose = _cut(np.ascontiguousarray(corners.transpose(2, 1, 0), dtype=np.float64), pinhole.near)
    nearness = 1.0 / depth
    x = pinhole.focal * x * nearness + pinhole.center_x
    y = pinhole.focal * y * nearness + pinhole.center_y
    return VisibleGeometry(x, y, nearness, Surfaces.concatenate([surfaces for _, surfaces in parts]).take(whose))


def _sides(pinhole: Pinhole) -> Array:
    """Return inward unit normals (5, 3) of the planes through the camera and the image edges, and of the near plane."""
    left, right = -pinhole.center_x / pinhole.focal, (pinhole.width - pinhole.center_x) / pinhole.focal
    top, bottom = -pinhole.center_y / pinhole.focal, (pinhole.height - pinhole.center_y) / pinhole.focal
    planes = np.array([(1, 0, -left), (-1, 0, right), (0, 1, -top), (0, -1, bottom), (0, 0, 1)], dtype=float)
    sides: Array = planes / np.linalg.norm(planes, axis=1, keepdims=True)
    return sides


def _in_sight(
    instances: Sequence[MeshInstance], pose: Array, pinhole: Pinhole, sides: Array
) -> list[tuple[MeshInstance, float]]:
    """Return the instances whose spheres overlap the image, with their diameters in pixels."""
    if not instances:
        return []
    centers = (np.array([instance.center for instance in instances]) - pose[:3, 3]) @ pose[:3, :3]
    radii = np.array([instance.model.radius for instance in instances])
    seen = (centers @ sides.T >= -radii[:, None]).all(axis=1) & (centers[:, 2] - radii <= pinhole.far)
    distance = np.maximum(np.sqrt((centers**2).sum(axis=1)), 1e-6)
    pixels = (2.0 * pinhole.focal * radii / distance).tolist()
    return [(instances[row], pixels[row]) for row in np.flatnonzero(seen).tolist()]


def _facing(
    instance: MeshInstance, pose: Array, pinhole: Pinhole, sides: Array, pixels: float
) -> tuple[Floats, Surfaces]:
    """Return the triangles of one instance that face the camera: corners (N, 3, 3) in its frame, and properties."""
    model = instance.model
    to_camera = pose[:3, :3].T @ instance.rotation
    shift = pose[:3, :3].T @ (instance.position - pose[:3, 3])
    viewpoint = -(to_camera.T @ shift).astype(np.float32)
    if model.cells is not None:
        centers = model.cells.center @ to_camera.T + shift
        near = (centers @ sides.T >= -model.cells.radius[:, None]).all(axis=1)
        near &= centers[:, 2] - model.cells.radius <= pinhole.far
        rows = model.cells.rows(near)
        rows = rows[model.normals[rows] @ viewpoint > model.plane[rows]]
    elif instance.label >= 0 and pixels < _COARSE_PIXELS:
        rows = model.coarse[model.normals[model.coarse] @ viewpoint > model.plane[model.coarse]]
    else:
        rows = np.flatnonzero(model.normals @ viewpoint > model.plane)
    # All corners in one table: numpy multiplies a stack of small matrices individually.
    corners = model.triangles[rows].reshape(-1, 3) @ to_camera.T.astype(np.float32) + shift.astype(np.float32)
    glow = np.zeros((len(rows), 3), dtype=np.float32)
    if instance.glow:
        by_material = np.array([instance.glow.get(name, (0.0, 0.0, 0.0)) for name in model.materials], dtype=np.float32)
        glow = by_material[model.material[rows]]
    normal = model.normals[rows] @ instance.rotation.T.astype(np.float32)
    label = np.full(len(rows), instance.label, dtype=np.int32)
    return corners.reshape(-1, 3, 3), Surfaces(normal, model.albedo[rows], model.finish[rows], label, glow)


def _cut(corners: Array, near: float) -> tuple[Array, NDArray[np.int64]]:
    """Return triangles (3, 3, N) by axis and corner, clipped at the near plane, and their original rows.

    A triangle with one corner behind the plane becomes two, one with two corners behind it becomes one.
    """
    behind = corners[2] < near
    count = behind[0].astype(np.int8) + behind[1] + behind[2]
    whole = np.flatnonzero(count == 0)
    if len(whole) == corners.shape[2]:
        return corners, whole
    parts, whose = [corners[:, :, whole]], [whole]
    for number in (1, 2):
        rows = np.flatnonzero(count == number)
        if not len(rows):
            continue
        odd = np.argmax(behind[:, rows] if number == 1 else ~behind[:, rows], axis=0)
        a, b, c = (corners[:, (odd + k) % 3, rows] for k in range(3))
        ab, ac = _crossing(a, b, near), _crossing(a, c, near)
        if number == 1:
            parts += [np.stack([ab, b, c], axis=1), np.stack([ab, c, ac], axis=1)]
            whose += [rows, rows]
        else:
            parts.append(np.stack([a, ab, ac], axis=1))
            whose.append(rows)
    return np.concatenate(parts, axis=2), np.concatenate(whose)


def _crossing(first: Array, second: Array, near: float) -> Array:
    """Return the intersections of edges between corners (3, N) with the near plane."""
    share = (near - first[2]) / (second[2] - first[2])
    corners: Array = first + share * (second - first)
    return corners
