"""Scene of the cameras: models of roads, buildings, road objects, signals and actors."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.content_digest import content_digest
from eidrive_scenario.base.geometry import rotation_matrix
from eidrive_scenario.rendering.lamps import Beam, glow, headlights
from eidrive_scenario.rendering.materials import FACADES, MATERIALS, Color, by_name, paint
from eidrive_scenario.rendering.meshes import actor_mesh
from eidrive_scenario.rendering.meshes.road_objects import building as building_mesh
from eidrive_scenario.rendering.meshes.road_objects import road_object_mesh, traffic_light
from eidrive_scenario.rendering.meshes.signs import sign, sign_face
from eidrive_scenario.rendering.meshes.solids import polygon
from eidrive_scenario.rendering.model import Light, MeshInstance, Model, gridded, merged, model, placed
from eidrive_scenario.rendering.renderer import ImageContent, Renderer, Subjects
from eidrive_scenario.rendering.shadows import REACH
from eidrive_scenario.rendering.surfaces import LEVEL, RoadPlane
from eidrive_scenario.roads import RoadNetwork, surface_meshes
from eidrive_scenario.roads.model.signal_states import GREEN, RED, YELLOW, lamp_colors, lamps, lit
from eidrive_scenario.world.actor import ActorSpec, ExtraAxle, Vector3
from eidrive_scenario.world.appearance import Appearance
from eidrive_scenario.world.camera import FIRST_SIGNAL_LABEL, Pinhole, Radiance, VisibleState
from eidrive_scenario.world.physics.scenery import Scenery
from eidrive_scenario.world.road_objects import Building, RoadObjectBody, SignalHead, signal_heads
from eidrive_scenario.world.view import ActorState

IN_SIGHT = 200.0
"""Maximum distance of drawn signal heads [m]."""
LAMPS: Mapping[str, Light] = {
    RED: (8_000.0, 120.0, 60.0),
    YELLOW: (8_000.0, 3_400.0, 80.0),
    GREEN: (160.0, 8_000.0, 2_800.0),
}
"""Luminance of lit lamps [cd/m²]: 250 cd, as EN 12368 requires of class A 3/1, over a lens of 200 mm."""
UNLIT = {RED: (0.20, 0.03, 0.03), YELLOW: (0.20, 0.15, 0.03), GREEN: (0.03, 0.16, 0.10)}


class Roadside:
    """Meshes of the road objects and signals of one road network, around `origin` (3,) in the world."""

    def __init__(self, pieces: Sequence[RoadObjectBody], heads: Sequence[SignalHead], origin: Array) -> None:
        self._origin = origin
        self._still: Model | None = _standing(pieces, origin)
        self._heads = tuple(heads)
        self._positions = np.array([head.pose[:3] for head in heads]).reshape(-1, 3)
        self._unlit = [
            MeshInstance(
                head_model(head), rotation_matrix(head.pose.h, 0.0, 0.0), position, FIRST_SIGNAL_LABEL - number
            )
            for number, (head, position) in enumerate(zip(heads, self._positions, strict=True))
        ]

    def instances(self, viewpoint: Array, states: Mapping[str, str], time: float) -> list[MeshInstance]:
        """Return all objects within sight of a camera at `viewpoint` (3,), with the signal states at `time` [s]."""
        instances = [] if self._still is None else [MeshInstance(self._still, np.eye(3), self._origin)]
        near = np.flatnonzero(np.linalg.norm(self._positions - viewpoint, axis=1) < IN_SIGHT)
        for number in near.tolist():
            glow = _glow(self._heads[number], states.get(self._heads[number].signal.id), time)
            instances.append(replace(self._unlit[number], glow=glow))
        return instances


def _standing(pieces: Iterable[RoadObjectBody], origin: Array) -> Model | None:
    """Return all road objects as one model relative to `origin`; equal objects are placed together."""
    triangles: dict[str, list[Array]] = {}
    for mesh, poses in equal_road_objects(pieces):
        for material, part in mesh.items():
            triangles.setdefault(material, []).append(_placed(part, poses) - origin)
    if not triangles:
        return None
    return gridded(model({material: np.concatenate(parts) for material, parts in triangles.items()}, {}))


def equal_road_objects(pieces: Iterable[RoadObjectBody]) -> Iterator[tuple[Mapping[str, Array], Array]]:
    """Yield the mesh of each different road object, and the poses (N, 6) of all objects that equal it."""
    equal: dict[tuple[str, str, float, float, float, float], list[RoadObjectBody]] = {}
    for piece in pieces:
        key = (piece.kind, piece.name, piece.length, piece.width, piece.height, piece.radius)
        equal.setdefault(key, []).append(piece)
    for key, group in equal.items():
        yield road_object_mesh(*key), np.array([piece.pose for piece in group])


def _placed(part: Array, poses: Array) -> Array:
    """Return triangles (N K, 3, 3) of a mesh (K, 3, 3) at upright poses (N, 6)."""
    cos, sin = np.cos(poses[:, 3])[:, None, None], np.sin(poses[:, 3])[:, None, None]
    x, y, z = part[None, ..., 0], part[None, ..., 1], part[None, ..., 2]
    px, py, pz = (poses[:, axis][:, None, None] for axis in range(3))
    corners = np.stack([px + cos * x - sin * y, py + sin * x + cos * y, pz + z], axis=-1)
    return corners.reshape(-1, 3, 3)


def head_model(head: SignalHead) -> Model:
    """Return a traffic light with unlit lamps, or a sign."""
    colors = lamp_colors(head.signal)
    if not colors:
        return model(sign(sign_face(head.signal), head.width, head.height), {})
    dark = {f"lamp_{color} {number}": UNLIT[color] for number, color in enumerate(colors)}
    return model(traffic_light(colors, head.width, head.height), dark)


def _glow(head: SignalHead, state: str | None, time: float) -> Mapping[str, Light]:
    """Return the luminance of the lamps of a traffic light."""
    colors = lamp_colors(head.signal)
    if state is None or not colors:
        return {}
    shining = {color for (color, _), on in zip(lamps(state, colors), lit(state, colors, time), strict=True) if on}
    return {f"lamp_{c} {number}": LAMPS[c] for number, c in enumerate(colors) if c in shining}


BESIDE_ROADS = 1500.0
"""Extent of the ground around the roads [m]."""
BELOW_ROADS = 0.06
"""Distance of the ground below the roads, which prevents that it is visible through them [m]."""
DECK = 1.0
"""Thickness of the decks that cast shadows [m]: more than a pixel of a shadow map, so that they do not shade their
roads."""
_LIT_WINDOWS = 0.3
"""Share of the windows of a building that are lit at night."""
WINDOW_LIGHT: Light = (26.0, 19.0, 10.0)
"""Luminance of a lit window [cd/m²]."""
_USUAL = Appearance()


class SceneImage(NamedTuple):
    """Image of a camera that is not drawn yet."""

    renderer: Renderer
    content: ImageContent

    @property
    def digest(self) -> bytes:
        return content_digest(self.content)

    def draw(self) -> Radiance:
        return self.renderer.render(self.content)


class Visuals:
    """Picture maker of a world: drawable models, created once and placed for each image."""

    def __init__(self, scenery: Scenery) -> None:
        self._scenery = scenery
        self._origin = _origin(scenery.roads)
        heads = signal_heads(scenery.roads) if scenery.roads is not None else ()
        self._roadside = Roadside(scenery.road_objects, heads, self._origin)
        self._shown_buildings = 0
        self._ground = self._ground_parts()
        decks = [] if scenery.level else self._ground
        self._decks = [replace(each, position=each.position - (0.0, 0.0, DECK)) for each in decks]
        self._renderer = Renderer()
        self._buildings: Model | None = None

    def image(self, state: VisibleState, pose: Array, pinhole: Pinhole, ignore: Collection[str]) -> SceneImage:
        """Return the image of a camera. Actors that the scenario makes invisible cast no shadows and emit no light."""
        if self._shown_buildings < len(self._scenery.buildings):
            self._shown_buildings = len(self._scenery.buildings)
            self._buildings = gridded(merged(building_model(each, self._origin) for each in self._scenery.buildings))
        weather, time = state.weather, state.time
        actors: list[MeshInstance] = []
        ignored: list[MeshInstance] = []
        beams = []
        for row, (spec, motion) in enumerate(state.actors):
            appearance = state.appearances.get(spec.name, _USUAL)
            if not appearance.visibility.graphics:
                continue
            rotation, foot = _stance(spec, motion)
            emitted = glow(spec, appearance, weather, time)
            instance = MeshInstance(_actor_model(spec, appearance.motion), rotation, foot, row, emitted)
            if spec.name in ignore:
                ignored.append(instance)
            else:
                actors.append(instance)
            lit = headlights(spec, appearance, weather, time)
            if lit is not None:
                lamp = np.array([spec.size[0] / 2, 0.0, min(0.7, 0.45 * spec.size[2])])
                beams.append(Beam(foot + rotation @ lamp, rotation, *lit))
        standing = self._roadside.instances(pose[:3, 3], state.signals, time)
        if self._buildings is not None:
            glowing = {"window_lit": WINDOW_LIGHT} if weather.lamps_on and weather.sun_elevation < 3.0 else {}
            standing.insert(0, MeshInstance(self._buildings, np.eye(3), self._origin, -1, glowing))
        subjects = Subjects(self._ground_around(pose[:2, 3]), standing, actors, ignored, self._decks)
        ground = self._road_below(*pose[:3, 3].tolist())
        content = ImageContent(subjects, beams, weather, pose, pinhole, ground, self._relief(pose[:2, 3], ground))
        return SceneImage(self._renderer, content)

    def _road_below(self, x: float, y: float, z: float) -> RoadPlane:
        """Return the plane of the nearest road at a camera, but of one below it rather than of a bridge above it."""
        roads = self._scenery.roads
        near = None if roads is None or self._scenery.level else roads.locate_at(x, y, z=z, reach=math.inf)
        if roads is None or near is None:
            return LEVEL
        pose = roads.pose(near)
        if pose.z > z:
            below = [pose for pose in map(roads.pose, roads.locations_at(x, y)) if pose.z <= z]
            pose = max(below, key=lambda pose: pose.z, default=pose)
        return RoadPlane(pose.z, rotation_matrix(pose.h, pose.p, pose.r)[:, 2])

    def _relief(self, camera: Array, below: RoadPlane) -> tuple[float, float]:
        """Return the heights of the lowest and the highest road whose shadows a camera at a position (2,) shows [m]."""
        heights = [below.height]
        for part in self._decks:
            if (cells := part.model.cells) is not None:
                gap = np.linalg.norm(cells.center[:, :2] + part.position[:2] - camera, axis=1) - cells.radius
                heights += [*cells.low[gap <= REACH].tolist(), *cells.high[gap <= REACH].tolist()]
        return min(heights), max(heights)

    def _ground_around(self, camera: Array) -> list[MeshInstance]:
        """Return the ground for a camera at a position (2,): the land follows a camera that is beyond the roads."""
        land, *roads = self._ground
        offset, roads_half = camera - land.center[:2], land.model.half[:2] - BESIDE_ROADS
        beyond = offset - np.clip(offset, -roads_half, roads_half)
        return [replace(land, position=land.position + np.append(beyond, 0.0)), *roads]

    def _ground_parts(self) -> list[MeshInstance]:
        """Return roads with markings, and their undersides unless they are level, and surrounding land; split by a
        grid.
        """
        low, high = np.zeros(3), np.zeros(3)
        parts: list[Model] = []
        if self._scenery.roads is not None:
            meshes = [
                replace(mesh, vertices=mesh.vertices - self._origin) for mesh in surface_meshes(self._scenery.roads)
            ]
            parts = [model({mesh.kind: mesh.vertices[mesh.faces]}, {mesh.kind: mesh.color}) for mesh in meshes]
            if not self._scenery.level:
                surfaces = [mesh for mesh in meshes if not mesh.kind.startswith("marking")]
                parts += [model({"concrete": mesh.vertices[mesh.faces[:, ::-1]]}, {}) for mesh in surfaces]
            points = np.concatenate([mesh.vertices for mesh in meshes]) if meshes else np.zeros((1, 3))
            low, high = points.min(axis=0), points.max(axis=0)
        (x0, y0, z), (x1, y1, _) = (low - BESIDE_ROADS).tolist(), (high + BESIDE_ROADS).tolist()
        z += BESIDE_ROADS - BELOW_ROADS
        kind = "grass" if self._scenery.roads is not None else "asphalt"
        land = model({kind: polygon([(x0, y0, z), (x1, y0, z), (x1, y1, z), (x0, y1, z)])}, {})
        pieces = [land, gridded(merged(parts))] if parts else [land]
        return [MeshInstance(piece, np.eye(3), self._origin) for piece in pieces]


def _origin(roads: RoadNetwork | None) -> Array:
    """Return the origin (3,) of the models of scenery: the middle of the roads in plan view, in whole kilometers.

    Single precision resolves 0.06 mm at 1 km, but 0.5 m at the coordinates of UTM.
    """
    low_x, low_y, high_x, high_y = (0.0, 0.0, 0.0, 0.0) if roads is None else roads.bounds()
    return np.array([round((low_x + high_x) / 2.0, -3), round((low_y + high_y) / 2.0, -3), 0.0])


def _actor_model(spec: ActorSpec, motion: str) -> Model:
    axles = spec.wheelbase, spec.wheel_radius, spec.extra_axles
    return shared_model(spec.shape, spec.size, spec.offset, axles, spec.color or paint(spec.name, spec.shape), motion)


@lru_cache(maxsize=256)
def shared_model(
    shape: str,
    size: Vector3,
    offset: Vector3,
    axles: tuple[float, float, tuple[ExtraAxle, ...]],
    color: Color,
    motion: str,
) -> Model:
    """Return the model of all actors with these values: the cache of the renderer compares models by identity."""
    wheelbase, radius, extra = axles
    spec = ActorSpec("", shape, "", size, offset, wheelbase=wheelbase, wheel_radius=radius, extra_axles=extra)
    return model(actor_mesh(spec, motion), {"paint": color})


def _stance(spec: ActorSpec, at: ActorState) -> tuple[Array, Array]:
    """Return the rotation (3, 3) of an actor, and the center of the bottom of its box in the world."""
    ox, oy, oz = spec.offset
    rotation = rotation_matrix(at.yaw, at.pitch, at.roll)
    foot: Array = np.array([at.x, at.y, at.z]) + rotation @ (ox, oy, oz - spec.size[2] / 2)
    return rotation, foot


def building_model(building: Building, origin: Array) -> Model:
    """Return a building relative to `origin` (3,); its name determines the lit windows."""
    own = building.color or by_name(building.name, FACADES)
    mesh = dict(building_mesh(building.size))
    windows = mesh.pop("window", None)
    if windows is not None and len(windows):
        digest = hashlib.blake2b(building.name.encode(), digest_size=8).digest()
        draws = np.random.Generator(np.random.Philox(key=int.from_bytes(digest, "little")))
        lit = np.repeat(draws.random(len(windows) // 2) < _LIT_WINDOWS, 2)
        mesh |= {name: part for name, part in (("window", windows[~lit]), ("window_lit", windows[lit])) if len(part)}
    colors = {"wall": own, "window_lit": MATERIALS["window"]}
    foot = np.array([*building.center[:2], building.center[2] - building.size[2] / 2])
    turn = rotation_matrix(building.yaw, 0.0, 0.0)
    return placed(model(mesh, colors), turn, foot - origin)
