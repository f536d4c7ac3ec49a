"""Small world of upright boxes whose rays are computed individually."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
import pytest
from numpy.typing import NDArray

from eidrive_scenario.world.actor import ActorSpec
from eidrive_scenario.world.camera import Pinhole, Radiance
from eidrive_scenario.world.surfaces import LEVEL_GROUND, Surfaces
from eidrive_scenario.world.view import WorldView
from eidrive_scenario.world.weather import Weather

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Hits:
    rows: NDArray[np.int64]
    fraction: Array
    normal: Array


@dataclass
class BoxScene:
    """Scene of the boxes of a view, and walls that are not actors. `casts` counts the batches of rays."""

    view: WorldView
    walls: list[tuple[float, ...]] = field(default_factory=list)
    ground: bool = False
    casts: list[int] = field(default_factory=list)
    images: list[tuple[Array, Pinhole]] = field(default_factory=list)
    weather: Weather = field(default_factory=Weather)

    def raycast(self, origins: Array, targets: Array) -> Hits:
        self.casts.append(len(origins))
        bodies = [(row, tuple(box)) for row, box in enumerate(self.view.boxes.tolist())]
        bodies += [(-1, wall) for wall in self.walls]
        rows, fractions, normals = [], [], []
        for origin, target in zip(origins.tolist(), targets.tolist(), strict=True):
            nearest, row, normal = 1.0, -2, (0.0, 0.0, 0.0)
            for name, box in bodies:
                share = hit_share(origin, target, box)
                if share is not None and share < nearest:
                    nearest, row, normal = share, name, face(origin, target, share, box)
            if self.ground and origin[2] > 0.0 > target[2] and origin[2] / (origin[2] - target[2]) < nearest:
                nearest, row, normal = origin[2] / (origin[2] - target[2]), -1, (0.0, 0.0, 1.0)
            rows.append(row)
            fractions.append(nearest)
            normals.append(normal)
        return Hits(np.array(rows, dtype=np.int64), np.array(fractions), np.array(normals).reshape(-1, 3))

    def spec(self, name: str) -> ActorSpec:
        row = self.view.row(name)
        size, offset = self.view.size[row].tolist(), self.view.offset[row].tolist()
        return ActorSpec(name, "box", self.view.categories[row], tuple(size), tuple(offset))

    def motion(self, name: str) -> str:
        return ""

    def surfaces(self) -> Surfaces:
        standing = np.reshape(self.walls, (-1, 7)).astype(float)
        standing[:, 2] -= standing[:, 5] / 2.0
        return Surfaces.join(*[LEVEL_GROUND] * self.ground, Surfaces.of_boxes(standing))

    def first_hit(self, origins: Sequence[tuple[float, ...]], targets: Sequence[tuple[float, ...]]) -> list[int]:
        rows: list[int] = self.raycast(np.array(origins), np.array(targets)).rows.tolist()
        return rows

    def is_free(self, own: int, origin: tuple[float, ...], target: int) -> bool:
        return False

    def image(self, pose: Array, pinhole: Pinhole, *, ignore: Iterable[str] = ()) -> PlainImage:
        self.images.append((pose, pinhole))
        return PlainImage((pinhole.height, pinhole.width))

    def radiance(self, pose: Array, pinhole: Pinhole, *, ignore: Iterable[str] = ()) -> Radiance:
        return self.image(pose, pinhole).draw()


@dataclass(frozen=True)
class PlainImage:
    """Evenly bright image of one distance."""

    shape: tuple[int, int]

    @property
    def digest(self) -> bytes:
        return repr(self.shape).encode()

    def draw(self) -> Radiance:
        light = np.full((*self.shape, 3), 1000.0, np.float32)
        return Radiance(light, np.full(self.shape, 50.0, np.float32), np.full(self.shape, -1, np.int32))


def hit_share(origin: list[float], target: list[float], box: tuple[float, ...]) -> float | None:
    """Return where a ray from outside hits a box, as a share of its length; None without a hit or from inside."""
    x, y, z, length, width, height, yaw = box
    cos, sin = math.cos(yaw), math.sin(yaw)
    start = [origin[0] - x, origin[1] - y, origin[2] - z]
    ray = [b - a for a, b in zip(origin, target, strict=True)]
    start = [cos * start[0] + sin * start[1], cos * start[1] - sin * start[0], start[2]]
    ray = [cos * ray[0] + sin * ray[1], cos * ray[1] - sin * ray[0], ray[2]]
    enter, leave = 0.0, 1.0
    inside = True
    for place, step, size in zip(start, ray, (length, width, height), strict=True):
        half = size / 2
        inside &= abs(place) < half
        if abs(step) < 1e-15:
            if abs(place) > half:
                return None
            continue
        first, second = sorted(((-half - place) / step, (half - place) / step))
        enter, leave = max(enter, first), min(leave, second)
    return enter if enter < leave and not inside else None


def face(origin: list[float], target: list[float], share: float, box: tuple[float, ...]) -> tuple[float, float, float]:
    """Return the outward normal of the face of a box on which a ray ends."""
    x, y, z, length, width, height, yaw = box
    cos, sin = math.cos(yaw), math.sin(yaw)
    dx, dy, dz = (a + share * (b - a) - c for a, b, c in zip(origin, target, (x, y, z), strict=True))
    local = ((cos * dx + sin * dy) / length, (cos * dy - sin * dx) / width, dz / height)
    axis = max(range(3), key=lambda k: abs(local[k]))
    sign = math.copysign(1.0, local[axis])
    return ((cos * sign, sin * sign, 0.0), (-sin * sign, cos * sign, 0.0), (0.0, 0.0, sign))[axis]


CAR = (4.892, 1.837, 1.49)
TRUCK = (8.468, 2.891, 3.827)


def make_view(
    actors: dict[str, tuple[float, float, float]],
    sizes: dict[str, tuple[float, float, float]] | None = None,
    *,
    time: float = 0.0,
    categories: dict[str, str] | None = None,
    velocity: dict[str, tuple[float, float]] | None = None,
) -> WorldView:
    """Return a view of actors as name: x, y of the box center, yaw; the reference point is below the center, on the
    ground."""
    sizes, categories, velocity = sizes or {}, categories or {}, velocity or {}
    count = len(actors)
    size = np.array([sizes.get(name, CAR) for name in actors])
    offset = np.zeros((count, 3))
    offset[:, 2] = size[:, 2] / 2
    speeds = np.array([(*velocity.get(name, (0.0, 0.0)), 0.0) for name in actors])
    return WorldView(
        time=time,
        tick=round(time / 0.05),
        names=tuple(actors),
        categories=tuple(categories.get(name, "car") for name in actors),
        position=np.array([(x, y, 0.0) for x, y, _ in actors.values()]),
        yaw=np.array([yaw for _, _, yaw in actors.values()]),
        pitch=np.zeros(count),
        roll=np.zeros(count),
        velocity=speeds,
        acceleration=np.zeros((count, 3)),
        yaw_rate=np.zeros(count),
        speed=np.hypot(speeds[:, 0], speeds[:, 1]),
        size=size,
        offset=offset,
    )


def make_spec(name: str, size: tuple[float, float, float] = CAR, wheelbase: float = 2.85) -> ActorSpec:
    return ActorSpec(name, "car", "car", size, (0.0, 0.0, size[2] / 2), wheelbase=wheelbase)


@dataclass(frozen=True)
class Boxes:
    """Helpers for the tests of this folder."""

    view = staticmethod(make_view)
    spec = staticmethod(make_spec)
    scene = BoxScene
    truck = TRUCK


@pytest.fixture
def boxes() -> Boxes:
    return Boxes()
