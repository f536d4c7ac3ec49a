"""Solids as triangles (K, 3, 3) [m], counter-clockwise seen from outside, of which all meshes consist; wheels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.world.actor import ExtraAxle

Point = Sequence[float] | Array

# Four corners of the bottom counter-clockwise from above, then four of the top
_BOX_FACES = ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))


@dataclass
class Mesh:
    """Triangles by material, in the frame of the center of the bounding box on the ground."""

    triangles: dict[str, list[Array]] = field(default_factory=dict)

    def add(self, material: str, *solids: Array) -> None:
        """Add solids (K, 3, 3) to the mesh."""
        self.triangles.setdefault(material, []).extend(solids)

    def add_mirrored(self, material: str, *solids: Array) -> None:
        """Add solids and their mirror images on the other side (y -> -y)."""
        self.add(material, *solids, *(mirrored(solid) for solid in solids))

    def add_sided(self, material: str, *solids: Array) -> None:
        """Add solids of the left side (y > 0) and their mirror images as separate materials."""
        self.add(f"{material}_left", *solids)
        self.add(f"{material}_right", *(mirrored(solid) for solid in solids))

    def materials(self) -> dict[str, Array]:
        """Return the triangles (K, 3, 3) by material."""
        return {material: np.concatenate(solids) for material, solids in self.triangles.items()}


def mirrored(solid: Array) -> Array:
    """Return the mirror image at the plane y = 0 with faces that point outwards."""
    flipped: Array = (solid * (1.0, -1.0, 1.0))[:, ::-1]
    return flipped


def polygon(points: Sequence[Point] | Array) -> Array:
    """Return a flat convex face (M, 3), given counter-clockwise as seen from outside."""
    corners = np.asarray(points, dtype=float)
    return np.stack([[corners[0], corners[k], corners[k + 1]] for k in range(1, len(corners) - 1)])


def box(center: Point, size: Point) -> Array:
    """Return an upright cuboid."""
    return tapered_box(center, size, size[:2])


def tapered_box(center: Point, size: Point, top: Point, shift: float = 0.0) -> Array:
    """Return a frustum of length, width and height `size`.

    Its top has the length and width `top` and is `shift` further ahead.
    """
    x, y, z = center
    length, width, height = size
    signs = ((-1, -1), (1, -1), (1, 1), (-1, 1))
    bottom = [(x + sx * length / 2, y + sy * width / 2, z - height / 2) for sx, sy in signs]
    upper = [(x + shift + sx * top[0] / 2, y + sy * top[1] / 2, z + height / 2) for sx, sy in signs]
    points = np.array(bottom + upper, dtype=float)
    return np.concatenate([polygon(points[list(face)]) for face in _BOX_FACES])


def bevelled_box(center: Point, size: Point, bevel: float) -> Array:
    """Return an upright cuboid with edges bevelled by `bevel`, like sheet metal."""
    x, y, z = center
    length, width, height = (extent / 2 for extent in size)

    def ring(at: float, inset: float) -> Array:
        w, h, b = width - inset, height - inset, bevel
        right = [(w - b, -h), (w, -h + b), (w, h - b), (w - b, h)]
        left = [(-across, up) for across, up in reversed(right)]
        outline = [left[-1], *right, *left[:-1]]
        return np.array([(x + at, y + across, z + up) for across, up in reversed(outline)])

    return loft([ring(-length, bevel), ring(bevel - length, 0.0), ring(length - bevel, 0.0), ring(length, bevel)])


def loft(rings: Sequence[Array] | Array) -> Array:
    """Return a skin over rings (S, M, 3), closed by a fan at each end.

    The rings are counter-clockwise as seen from the side of the first ring.
    """
    stack = np.asarray(rings, dtype=float)
    following = np.roll(stack, -1, axis=1)
    a, b, c, d = stack[:-1], following[:-1], following[1:], stack[1:]
    skin = np.concatenate([np.stack([a, c, b], axis=-2), np.stack([a, d, c], axis=-2)]).reshape(-1, 3, 3)
    return np.concatenate([skin, _fan(stack[0]), _fan(stack[-1])[:, ::-1]])


def cylinder(start: Point, end: Point, radius: float, end_radius: float | None = None, sides: int = 14) -> Array:
    """Return a cylinder, or the frustum of a cone, between two points."""
    begin, finish = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
    axis = (finish - begin) / np.linalg.norm(finish - begin)
    across = np.cross(axis, (0.0, 0.0, 1.0) if abs(axis[2]) < 0.9 else (1.0, 0.0, 0.0))
    across /= np.linalg.norm(across)
    up = np.cross(axis, across)
    turns = np.linspace(0.0, 2 * np.pi, sides, endpoint=False)
    circle = -np.cos(turns)[:, None] * across + np.sin(turns)[:, None] * up
    last = radius if end_radius is None else end_radius
    return loft([begin + radius * circle, finish + last * circle])


def ball(center: Point, radius: Point, rings: int = 6, sides: int = 10) -> Array:
    """Return an ellipsoid with its half-axes along x, y, z."""
    tilt = np.linspace(-np.pi / 2, np.pi / 2, rings + 1)[:, None, None]
    turn = np.linspace(0.0, 2 * np.pi, sides, endpoint=False)[None, :, None]
    level = np.cos(tilt)
    unit = np.concatenate(np.broadcast_arrays(level * np.cos(turn), -level * np.sin(turn), np.sin(tilt)), axis=-1)
    return loft(unit * np.asarray(radius) + np.asarray(center))


def moved(solid: Array, by: Point) -> Array:
    """Return a translated solid."""
    elsewhere: Array = solid + np.asarray(by, dtype=float)
    return elsewhere


def _fan(ring: Array) -> Array:
    center = np.broadcast_to(ring.mean(axis=0), ring.shape)
    return np.stack([center, ring, np.roll(ring, -1, axis=0)], axis=1)


@dataclass(frozen=True)
class BodyDimensions:
    """Bounding box of an actor: origin at its center on the ground, x forward; all in meters.

    front, rear  x of the axles
    """

    length: float
    width: float
    height: float
    front: float
    rear: float
    wheel_radius: float
    extra_axles: tuple[ExtraAxle, ...] = ()
    """Additional axles; their x is in the frame of front and rear."""

    def x(self, share: float) -> float:
        """Return x at a share of the length, 0 at the rear end and 1 at the front."""
        return (share - 0.5) * self.length

    def z(self, share: float) -> float:
        """Return z at a share of the height."""
        return share * self.height

    @property
    def side(self) -> float:
        """Half the width."""
        return self.width / 2


def add_wheels(mesh: Mesh, frame: BodyDimensions, side: float, tire: float, *, axles: tuple[float, ...] = ()) -> None:
    """Add wheels of width `tire` with rims and dark arches, whose outer faces are at y = ±side.

    By default the wheels of all axles are added; the body then hides their inner parts.
    """
    for x in axles or (frame.front, frame.rear):
        _add_pair(mesh, x, frame.wheel_radius, side, tire)
    for axle in () if axles else frame.extra_axles:
        _add_pair(mesh, axle.x, axle.wheel_radius or frame.wheel_radius, side, tire)


def add_extra_wheels(mesh: Mesh, frame: BodyDimensions, side: float, tire: float, steered: float | None = None) -> None:
    """Add the wheels of additional axles below a body with their track widths, within y = ±side.

    tire     width of a wheel, or of twin tires
    steered  width for a steered axle, if it differs
    """
    for axle in frame.extra_axles:
        wide = steered if steered is not None and axle.max_steering > 0.0 else tire
        outer = min((axle.track + wide) / 2, side) if axle.track > 0.0 else side
        _add_pair(mesh, axle.x, axle.wheel_radius or frame.wheel_radius, max(outer, wide), wide)


def _add_pair(mesh: Mesh, x: float, radius: float, side: float, tire: float) -> None:
    arch = cylinder((x, side - tire, radius), (x, side - 0.012, radius), 1.16 * radius, sides=18)
    arch[..., 2] = np.maximum(arch[..., 2], 0.5 * radius)
    mesh.add_mirrored("trim", arch)
    mesh.add_mirrored("tire", cylinder((x, side - tire, radius), (x, side, radius), radius, sides=18))
    mesh.add_mirrored("rim", cylinder((x, side - 0.05, radius), (x, side + 0.006, radius), 0.64 * radius, sides=12))
    mesh.add_mirrored("trim", cylinder((x, side, radius), (x, side + 0.01, radius), 0.18 * radius, sides=8))
