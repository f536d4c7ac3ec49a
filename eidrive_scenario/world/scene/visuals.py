"""Scene of the cameras: models of roads, buildings and actors, created for the first image."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from functools import lru_cache
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from eidrive_scenario.arrays import Array
from eidrive_scenario.content_digest import content_digest
from eidrive_scenario.geometry import rotation_matrix
from eidrive_scenario.roads import surface_meshes
from eidrive_scenario.world.actor import ActorSpec, ExtraAxle
from eidrive_scenario.world.appearance import Appearance
from eidrive_scenario.world.camera import Pinhole, Radiance
from eidrive_scenario.world.meshes import actor_mesh
from eidrive_scenario.world.meshes.buildings import building as building_mesh
from eidrive_scenario.world.meshes.palette import FACADES, MATERIALS, Color, by_name, paint
from eidrive_scenario.world.meshes.solids import polygon
from eidrive_scenario.world.physics.bodies import Body
from eidrive_scenario.world.physics.ground import GroundUnder
from eidrive_scenario.world.physics.scenery import Scenery
from eidrive_scenario.world.render.illumination.lamps import Beam
from eidrive_scenario.world.render.model import Light, MeshInstance, Model, gridded, merged, model, placed
from eidrive_scenario.world.render.renderer import ImageContent, Renderer, Subjects
from eidrive_scenario.world.road_objects import Building, signal_heads
from eidrive_scenario.world.scene.roadside import Roadside
from eidrive_scenario.world.scene.vehicle_lamps import beam, glow
from eidrive_scenario.world.weather import Weather

_BESIDE_ROADS = 1500.0
"""Extent of the ground around the roads [m]."""
_BELOW_ROADS = 0.06
"""Distance of the ground below the roads, which prevents that it is visible through them [m]."""
_LIT_WINDOWS = 0.3
"""Share of the windows of a building that are lit at night."""
WINDOW_LIGHT: Light = (26.0, 19.0, 10.0)
"""Luminance of a lit window [cd/m²]."""


class DisplayState(NamedTuple):
    """Visible state in addition to the poses: time [s], signal states, and appearances of actors."""

    time: float = 0.0
    signals: Mapping[str, str] = MappingProxyType({})
    appearances: Mapping[str, Appearance] = MappingProxyType({})


class UndrawnImage:
    """Image of a camera that is not drawn yet. Its content is fixed: it does not follow the world."""

    def __init__(self, renderer: Renderer, content: ImageContent) -> None:
        self._renderer = renderer
        self._content = content

    @property
    def digest(self) -> bytes:
        """Digest of everything that determines the image: equal digests mean equal images."""
        return content_digest(self._content)

    def draw(self) -> Radiance:
        """Return the light that reaches the camera."""
        return self._renderer.render(self._content)


class Visuals:
    """Drawable models, placed for each image."""

    def __init__(self, scenery: Scenery) -> None:
        self._scenery = scenery
        heads = signal_heads(scenery.roads) if scenery.roads is not None else ()
        self._roadside = Roadside(scenery.road_objects, heads)
        self._shown_buildings = 0
        self._ground = self._ground_parts()
        self._renderer = Renderer()
        self._buildings: Model | None = None
        self._below: GroundUnder | None = None if scenery.level else GroundUnder(scenery.roads)

    def image(
        self,
        actors: Iterable[Body],
        hidden: Iterable[str],
        pose: Array,
        pinhole: Pinhole,
        weather: Weather,
        shown: DisplayState = DisplayState(),  # noqa: B008 - it is immutable
    ) -> UndrawnImage:
        """Return the image of a camera; `actors` are in the order of their rows.

        Bodies in `hidden` are not drawn, but cast shadows and emit light. Bodies that the scenario makes invisible do
        neither.
        """
        all_bodies = dict(enumerate(actors))
        looks = {body.name: shown.appearances.get(body.name, _USUAL) for body in all_bodies.values()}
        bodies = {row: body for row, body in all_bodies.items() if looks[body.name].visibility.graphics}
        if self._shown_buildings < len(self._scenery.buildings):
            self._shown_buildings = len(self._scenery.buildings)
            self._buildings = gridded(merged(_building_model(each) for each in self._scenery.buildings))
        dark = weather.lamps_on
        instances = {
            body.name: _actor_instance(
                row, body, glow(body.spec, looks[body.name], weather, shown.time), looks[body.name].motion
            )
            for row, body in bodies.items()
        }
        glowing = {"window_lit": WINDOW_LIGHT} if dark and weather.sun_elevation < 3.0 else {}
        houses = []
        if self._buildings is not None:
            houses = [MeshInstance(self._buildings, np.eye(3), np.zeros(3), -1, glowing)]
        beams = [
            _beam(body, *lit)
            for body in bodies.values()
            if (lit := beam(body.spec, looks[body.name], weather, shown.time)) is not None
        ]
        left_out = frozenset(hidden)
        roadside = self._roadside.instances(pose[:3, 3], shown.signals, shown.time)
        subjects = Subjects(
            self._ground,
            [*houses, *roadside],
            [each for name, each in instances.items() if name not in left_out],
            [each for name, each in instances.items() if name in left_out],
        )
        ground = self._below.at(float(pose[0, 3]), float(pose[1, 3]), 0.0)[0] if self._below is not None else 0.0
        return UndrawnImage(self._renderer, ImageContent(subjects, beams, weather, pose, pinhole, ground))

    def _ground_parts(self) -> list[MeshInstance]:
        """Return roads, markings and surrounding land, split by a grid."""
        low, high = np.zeros(3), np.zeros(3)
        parts: list[Model] = []
        if self._scenery.roads is not None:
            meshes = surface_meshes(self._scenery.roads)
            parts = [model({mesh.kind: mesh.vertices[mesh.faces]}, {mesh.kind: mesh.color}) for mesh in meshes]
            points = np.concatenate([mesh.vertices for mesh in meshes]) if meshes else np.zeros((1, 3))
            low, high = points.min(axis=0), points.max(axis=0)
        (x0, y0, z), (x1, y1, _) = (low - _BESIDE_ROADS).tolist(), (high + _BESIDE_ROADS).tolist()
        z += _BESIDE_ROADS - _BELOW_ROADS
        kind = "grass" if self._scenery.roads is not None else "asphalt"
        land = model({kind: polygon([(x0, y0, z), (x1, y0, z), (x1, y1, z), (x0, y1, z)])}, {})
        pieces = [land, gridded(merged(parts))] if parts else [land]
        return [MeshInstance(piece, np.eye(3), np.zeros(3)) for piece in pieces]


_USUAL = Appearance()


def _beam(body: Body, brightness: float, high: bool) -> Beam:
    """Return the headlamps of an actor."""
    rotation, foot = _stance(body)
    length, _, height = body.spec.size
    lamp = np.array([length / 2, 0.0, min(0.7, 0.45 * height)])
    return Beam(foot + rotation @ lamp, rotation, brightness, high)


def _actor_instance(row: int, body: Body, emitted: Mapping[str, Light], motion: str) -> MeshInstance:
    spec = body.spec
    rotation, foot = _stance(body)
    axles = spec.wheelbase, spec.wheel_radius, spec.extra_axles
    shape = _actor_model(spec.shape, spec.size, spec.offset, axles, _paint(spec), motion)
    return MeshInstance(shape, rotation, foot, row, emitted)


def _paint(spec: ActorSpec) -> Color:
    return spec.color or paint(spec.name, spec.shape)


@lru_cache(maxsize=256)
def _actor_model(
    shape: str,
    size: tuple[float, float, float],
    offset: tuple[float, float, float],
    axles: tuple[float, float, tuple[ExtraAxle, ...]],
    color: Color,
    motion: str,
) -> Model:
    wheelbase, radius, extra = axles
    spec = ActorSpec("", shape, "", size, offset, wheelbase=wheelbase, wheel_radius=radius, extra_axles=extra)
    return model(actor_mesh(spec, motion), {"paint": color})


def _stance(body: Body) -> tuple[Array, Array]:
    """Return the rotation (3, 3) of an actor, and the center of the bottom of its box in the world."""
    ox, oy, oz = body.spec.offset
    rotation = rotation_matrix(body.yaw, body.pitch, body.roll)
    foot: Array = np.array([body.x, body.y, body.z]) + rotation @ (ox, oy, oz - body.spec.size[2] / 2)
    return rotation, foot


def _building_model(building: Building) -> Model:
    """Return a building; its name determines the lit windows."""
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
    return placed(model(mesh, colors), turn, foot)
