"""Drawable models: triangles with materials, and their instances."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.arrays import Array, Floats, Integers
from eidrive_scenario.content_digest import content_digest
from eidrive_scenario.rendering.materials import MATERIALS, Color, finish_of

Light = tuple[float, float, float]
"""Red, green, blue of linear sRGB."""

_COARSE_SHARE = 0.97
"""Share of the surface of a model that its coarse version keeps: the largest triangles."""
_CELL = 30.0
"""Side of the squares into which scenery is split [m]; squares out of sight are skipped."""


@dataclass(frozen=True, eq=False)
class Model:
    """Triangles (K, 3, 3) in a local frame [m], flat and visible from the front. Models are equal only if identical.

    normals   (K, 3) unit vectors
    plane     (K,) = normal · corner
    albedo    (K, 3) linear
    finish    (K,) index of FINISHES
    material  (K,) index of `materials`
    coarse    indices of the triangles of the coarse version
    center    (3,), half (3,) and radius: center, half extents and enclosing radius
    """

    triangles: Floats
    normals: Floats
    plane: Floats
    albedo: Floats
    finish: NDArray[np.uint8]
    material: NDArray[np.int16]
    materials: tuple[str, ...]
    coarse: Integers
    center: Array
    half: Array
    radius: float

    cells: Cells | None = None

    @cached_property
    def digest(self) -> bytes:
        """Digest of the content, which is equal for the same model of another run."""
        return content_digest(*(getattr(self, each.name) for each in fields(self)))

    @cached_property
    def is_coarse(self) -> NDArray[np.bool_]:
        """Whether each triangle belongs to the coarse version (K,)."""
        marks = np.zeros(len(self.triangles), dtype=bool)
        marks[self.coarse] = True
        return marks


class Cells(NamedTuple):
    """Grid cells by which a large model is sorted: first triangles, counts, and spheres (center, radius)."""

    first: Integers
    counts: Integers
    center: Array
    radius: Array

    def rows(self, chosen: NDArray[np.bool_]) -> Integers:
        """Return the triangles of the selected cells."""
        first, count = self.first[chosen], self.counts[chosen]
        ends = np.cumsum(count)
        found: Integers = np.arange(ends[-1] if len(ends) else 0) + np.repeat(first - (ends - count), count)
        return found


@dataclass(frozen=True)
class MeshInstance:
    """Instance of a model: rotation (3, 3) and position (3,) in the world, label in the segmentation.

    glow  emission by material [cd/m²]
    """

    model: Model
    rotation: Array
    position: Array
    label: int = -1
    glow: Mapping[str, Light] = field(default_factory=dict)

    @cached_property
    def center(self) -> Array:
        """Center (3,) of the sphere of radius `model.radius` in the world [m]."""
        found: Array = self.rotation @ self.model.center + self.position
        return found


def linear(color: Color) -> Light:
    """Return the linear color of a display color: inverse of the curve of sRGB (IEC 61966-2-1)."""
    red, green, blue = (c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in color)
    return red, green, blue


def model(mesh: Mapping[str, Array], colors: Mapping[str, Color]) -> Model:
    """Return a model of triangles (K, 3, 3) by material; the palette has the colors that are not given."""
    triangles, albedo, finish, material = [], [], [], []
    for number, (name, solid) in enumerate(mesh.items()):
        color = linear(colors[name] if name in colors else MATERIALS[name])
        triangles.append(solid)
        albedo.append(np.broadcast_to(np.array(color, dtype=np.float32), (len(solid), 3)))
        finish.append(np.full(len(solid), finish_of(name), dtype=np.uint8))
        material.append(np.full(len(solid), number, dtype=np.int16))
    corners = np.concatenate(triangles)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normals, axis=1)
    solid_ones = np.flatnonzero(length > 1e-12)
    return _model(
        corners[solid_ones].astype(np.float32),
        (normals[solid_ones] / length[solid_ones, None]).astype(np.float32),
        np.concatenate(albedo)[solid_ones],
        np.concatenate(finish)[solid_ones],
        np.concatenate(material)[solid_ones],
        tuple(mesh),
    )


def merged(models: Iterable[Model]) -> Model:
    """Return several models in one frame as one model, with materials merged by name."""
    parts = list(models)
    names = tuple(dict.fromkeys(name for part in parts for name in part.materials))
    numbers = [np.array([names.index(name) for name in part.materials], dtype=np.int16) for part in parts]
    return _model(
        np.concatenate([part.triangles for part in parts]),
        np.concatenate([part.normals for part in parts]),
        np.concatenate([part.albedo for part in parts]),
        np.concatenate([part.finish for part in parts]),
        np.concatenate([number[part.material] for number, part in zip(numbers, parts, strict=True)]),
        names,
    )


def gridded(source: Model) -> Model:
    """Return the model split by a grid, so that invisible parts are skipped."""
    squares = np.floor(source.triangles.mean(axis=1)[:, :2] / _CELL).astype(np.int64)
    _, cell = np.unique(squares, axis=0, return_inverse=True)
    cell = cell.ravel()
    order = np.argsort(cell, kind="stable")
    count = np.bincount(cell)
    first = np.cumsum(count) - count
    corners = source.triangles[order].astype(np.float64)
    low = np.minimum.reduceat(corners.min(axis=1), first, axis=0)
    high = np.maximum.reduceat(corners.max(axis=1), first, axis=0)
    sorted_one = _model(
        source.triangles[order],
        source.normals[order],
        source.albedo[order],
        source.finish[order],
        source.material[order],
        source.materials,
    )
    return replace(sorted_one, cells=Cells(first, count, (low + high) / 2, np.linalg.norm(high - low, axis=1) / 2))


def placed(part: Model, rotation: Array, position: Array) -> Model:
    """Return the model rotated and translated."""
    turn = rotation.T
    return _model(
        (part.triangles.astype(np.float64) @ turn + position).astype(np.float32),
        (part.normals @ turn).astype(np.float32),
        part.albedo,
        part.finish,
        part.material,
        part.materials,
    )


def _model(
    triangles: Floats,
    normals: Floats,
    albedo: Floats,
    finish: NDArray[np.uint8],
    material: NDArray[np.int16],
    materials: tuple[str, ...],
) -> Model:
    edges = triangles[:, 1:] - triangles[:, :1]
    area = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    order = np.argsort(-area, kind="stable")
    kept = int(np.searchsorted(np.cumsum(area[order]), _COARSE_SHARE * area.sum())) + 1
    corners = triangles.reshape(-1, 3).astype(np.float64)
    low, high = corners.min(axis=0), corners.max(axis=0)
    center = (low + high) / 2
    return Model(
        triangles,
        normals,
        np.einsum("ki,ki->k", normals, triangles[:, 0]),
        np.ascontiguousarray(albedo),
        finish,
        material,
        materials,
        np.sort(order[:kept]),
        center,
        (high - low) / 2,
        float(np.sqrt(((corners - center) ** 2).sum(axis=1).max())),
    )
