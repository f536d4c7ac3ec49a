"""Drawable models: triangles with materials, and their instances."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Array, Floats, Integers, number_in_groups
from eidrive_scenario.base.content_digest import content_digest
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
    """Grid cells by which a large model is sorted: first triangles, counts, spheres (center, radius), height bounds."""

    first: Integers
    counts: Integers
    center: Array
    radius: Array
    low: Array
    high: Array

    def rows(self, chosen: NDArray[np.bool_]) -> Integers:
        """Return the triangles of the selected cells."""
        cell, number = number_in_groups(self.counts[chosen])
        return np.asarray(self.first[chosen][cell] + number)


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
        center: Array = self.rotation @ self.model.center + self.position
        return center


def linear(color: Color) -> Light:
    """Return the linear color of a display color: inverse of the curve of sRGB (IEC 61966-2-1)."""
    red, green, blue = (c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in color)
    return red, green, blue


class _Columns(NamedTuple):
    """Triangles of a model: the columns that do not follow from others, with the names of Model."""

    triangles: Floats
    normals: Floats
    albedo: Floats
    finish: NDArray[np.uint8]
    material: NDArray[np.int16]

    @classmethod
    def of(cls, source: Model) -> _Columns:
        return cls(source.triangles, source.normals, source.albedo, source.finish, source.material)


def model(mesh: Mapping[str, Array], colors: Mapping[str, Color]) -> Model:
    """Return a model of triangles (K, 3, 3) by material; the palette has the colors that are not given."""
    palette = [linear(colors[name] if name in colors else MATERIALS[name]) for name in mesh]
    material = np.repeat(np.arange(len(mesh), dtype=np.int16), [len(solid) for solid in mesh.values()])
    corners = np.concatenate(list(mesh.values()))
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normals, axis=1)
    # Triangles with an area; those of a body of a few micrometers are small, too.
    kept = np.flatnonzero(length > 1e-12 * min(1.0, float(np.ptp(corners.reshape(-1, 3), axis=0).max()) ** 2))
    material = material[kept]
    columns = _Columns(
        corners[kept].astype(np.float32),
        (normals[kept] / length[kept, None]).astype(np.float32),
        np.array(palette, dtype=np.float32)[material],
        np.array([finish_of(name) for name in mesh], dtype=np.uint8)[material],
        material,
    )
    return _model(columns, tuple(mesh))


def merged(models: Iterable[Model]) -> Model:
    """Return several models in one frame as one model, with materials merged by name."""
    parts = list(models)
    names = tuple(dict.fromkeys(name for part in parts for name in part.materials))
    numbers = [np.array([names.index(name) for name in part.materials], dtype=np.int16) for part in parts]
    columns = [
        _Columns.of(part)._replace(material=number[part.material]) for number, part in zip(numbers, parts, strict=True)
    ]
    return _model(_Columns(*map(np.concatenate, zip(*columns, strict=True))), names)


def gridded(source: Model) -> Model:
    """Return the model split by a grid, so that invisible parts are skipped."""
    squares = np.floor(source.triangles.mean(axis=1)[:, :2] / _CELL).astype(np.int64)
    _, cell = np.unique(squares, axis=0, return_inverse=True)
    cell = cell.ravel()
    order = np.argsort(cell, kind="stable")
    count = np.bincount(cell)
    first = np.cumsum(count) - count
    corners = source.triangles[order].astype(np.float64)
    # The triangles of a cell are consecutive now: bounds of each group, of which a sphere encloses the box.
    low = np.minimum.reduceat(corners.min(axis=1), first, axis=0)
    high = np.maximum.reduceat(corners.max(axis=1), first, axis=0)
    by_cell = _model(_Columns._make(column[order] for column in _Columns.of(source)), source.materials)
    radius = np.linalg.norm(high - low, axis=1) / 2
    return replace(by_cell, cells=Cells(first, count, (low + high) / 2, radius, low[:, 2], high[:, 2]))


def placed(part: Model, rotation: Array, position: Array) -> Model:
    """Return the model rotated and translated."""
    turn = rotation.T
    triangles = (part.triangles.astype(np.float64) @ turn + position).astype(np.float32)
    normals = (part.normals @ turn).astype(np.float32)
    return _model(_Columns.of(part)._replace(triangles=triangles, normals=normals), part.materials)


def _model(columns: _Columns, materials: tuple[str, ...]) -> Model:
    triangles = columns.triangles
    edges = triangles[:, 1:] - triangles[:, :1]
    area = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    # The fewest triangles with the share _COARSE_SHARE of the surface are the coarse version.
    order = np.argsort(-area, kind="stable")
    kept = int(np.searchsorted(np.cumsum(area[order]), _COARSE_SHARE * area.sum())) + 1
    corners = triangles.reshape(-1, 3).astype(np.float64)
    low, high = corners.min(axis=0), corners.max(axis=0)
    center = (low + high) / 2
    return Model(
        **columns._asdict(),
        plane=np.einsum("ki,ki->k", columns.normals, triangles[:, 0]),
        materials=materials,
        coarse=np.sort(order[:kept]),
        center=center,
        half=(high - low) / 2,
        radius=float(np.sqrt(((corners - center) ** 2).sum(axis=1).max())),
    )
