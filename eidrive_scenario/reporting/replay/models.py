"""Models of a run for the view in three dimensions, as plain values of the page: those that the cameras see.

A model is {"parts": [[material, color, vertices, triangles], …], "data": text}. The color is linear red, green, blue.
The text is the base64 of a zlib stream of 32-bit integers (little endian): for each part x, y, z of its vertices [mm],
and the three corners of its triangles as indices of vertices, row by row. Each number is the difference from the one
before it in its row.
"""

from __future__ import annotations

import base64
import math
import zlib
from collections.abc import Iterator, Mapping
from functools import cache, lru_cache
from importlib.resources import files
from typing import Any

import numpy as np
from pydantic import ValidationError

from eidrive_scenario.base.arrays import Array, Integers
from eidrive_scenario.driving.agent_factory import station_sensors
from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.errors import EidriveError
from eidrive_scenario.rendering.materials import MATERIALS, paint
from eidrive_scenario.rendering.meshes import BUILDERS
from eidrive_scenario.rendering.model import Model, linear, merged, model
from eidrive_scenario.rendering.scene import (
    BELOW_ROADS,
    BESIDE_ROADS,
    building_model,
    equal_road_objects,
    head_model,
    shared_model,
)
from eidrive_scenario.roads import RoadNetwork, surface_meshes
from eidrive_scenario.sensing.sensor import mounting
from eidrive_scenario.sensing.settings import CameraSettings
from eidrive_scenario.simulation.recorded_outcome import Body
from eidrive_scenario.world.actor import ActorSpec, ExtraAxle, Vector3
from eidrive_scenario.world.road_objects import buildings, road_object_bodies, signal_heads

Data = dict[str, Any]
_SENSOR_SETTINGS = ("detector", "localization", "sensors", "range", "field_of_view", "visibility", "mount")
"""Settings of a station on which its sensors depend."""
_LARGEST = 1000.0
"""Maximum extent of an actor that has a model [m]."""


@cache
def three_library() -> list[str]:
    """Return the two modules of three.js, the core first, each as the base64 of a zlib stream."""
    folder = files("eidrive_scenario.reporting") / "templates" / "replay" / "three"
    return [_packed((folder / f"three.{part}.min.js").read_bytes()) for part in ("core", "module")]


def encoded_model(source: Model) -> Data:
    """Return a model as the page contains it."""
    parts: list[list[Any]] = []
    numbers: list[Array] = []
    keys = np.column_stack([source.material, source.albedo])
    for key in np.unique(keys, axis=0):
        corners = source.triangles[(keys == key).all(axis=1)].reshape(-1, 3).astype(np.float64)
        vertices, faces = _indexed(np.rint(1000.0 * corners).astype(np.int64))
        color = [round(float(value), 4) for value in key[1:]]
        parts.append([source.materials[int(key[0])], color, len(vertices), len(faces)])
        numbers += [np.diff(rows, axis=1, prepend=0).ravel() for rows in (vertices.T, faces.T)]
    return {"parts": parts, "data": _packed(np.concatenate(numbers).astype("<i4").tobytes() if numbers else b"")}


def _indexed(corners: Integers) -> tuple[Integers, Integers]:
    """Return the different corners (V, 3) in the order of their first use, and the triangles (F, 3) as their rows."""
    vertices, first, inverse = np.unique(corners, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return vertices[order], rank[inverse.ravel()].reshape(-1, 3)


def _packed(content: bytes) -> str:
    return base64.b64encode(zlib.compress(content, 9)).decode("ascii")


def street_models(network: RoadNetwork | None) -> Data:
    """Return what stands still.

    origin    of `surfaces` and `houses` in the world, the middle of the land
    surfaces  model of roads and markings; None without roads
    houses    model of all buildings; None without any
    objects   [model, poses] of road objects, signals and signs; a pose is [x, y, z, heading]
    land      rectangle [left, bottom, right, top, z] around the roads [m], and its color
    level     whether all roads are at z = 0
    """
    if network is None:
        land = _land(np.zeros((1, 3)), "asphalt")
        return {"origin": [0, 0, 0], "surfaces": None, "houses": None, "objects": [], "land": land, "level": True}
    meshes = surface_meshes(network)
    points = np.concatenate([mesh.vertices for mesh in meshes]) if meshes else np.zeros((1, 3))
    # Integers of 32 bits in millimeters reach 2,147 km, less than coordinates of UTM.
    origin = np.rint((points.min(axis=0) + points.max(axis=0)) / 2.0) * (1.0, 1.0, 0.0)
    surfaces = [model({mesh.kind: mesh.vertices[mesh.faces] - origin}, {mesh.kind: mesh.color}) for mesh in meshes]
    houses = [building_model(each, origin) for each in buildings(network)]
    return {
        "origin": origin.tolist(),
        "surfaces": encoded_model(merged(surfaces)) if surfaces else None,
        "houses": encoded_model(merged(houses)) if houses else None,
        "objects": [[encoded_model(source), np.round(poses, 3).tolist()] for source, poses in _objects(network)],
        "land": _land(points, "grass"),
        "level": network.is_level,
    }


def _objects(network: RoadNetwork) -> Iterator[tuple[Model, Array]]:
    """Yield the models of road objects, signals and signs, and the poses (N, 4) of each."""
    for mesh, poses in equal_road_objects(road_object_bodies(network)):
        yield model(mesh, {}), poses[:, :4]
    for head in signal_heads(network):
        yield head_model(head), np.array([head.pose[:4]])


def _land(points: Array, material: str) -> Data:
    (left, bottom, z), (right, top, _) = points.min(axis=0).tolist(), points.max(axis=0).tolist()
    sides = [left - BESIDE_ROADS, bottom - BESIDE_ROADS, right + BESIDE_ROADS, top + BESIDE_ROADS]
    return {
        "area": [round(side, 1) for side in sides],
        "z": round(z - BELOW_ROADS, 3),
        "color": list(linear(MATERIALS[material])),
    }


class ActorModels:
    """Models, paints and sensors of the actors of a run.

    bodies    of the actors of the scenario, by name; other actors have the model of their category
    stations  settings of the stations, by name, as plain values
    """

    def __init__(self, bodies: Mapping[str, Body] | None = None, stations: Mapping[str, Any] | None = None) -> None:
        self._bodies = bodies or {}
        self._stations = stations if isinstance(stations, Mapping) else {}
        self._numbers: dict[tuple[Any, ...], int] = {}
        self._models: dict[int, Data] = {}

    def describe(self, name: str, category: str, size: Vector3, offset: Vector3) -> Data:
        """Return what the page needs to draw an actor.

        model    number of its model, see `take`; None for an actor whose box has no extent
        paint    color of its material `paint`, linear red, green, blue
        sensors  [name, kind, x, y, z, yaw, pitch, angle, range or None] of the sensors of a station, in the frame of
                 the center of the bottom of its box [m, rad]
        """
        offset = offset if math.isfinite(sum(offset)) else (0.0, 0.0, size[2] / 2.0)
        spec = _spec(self._bodies.get(name), category, size, offset)
        drawn: Data = {
            "model": None,
            "paint": [round(part, 4) for part in linear(spec.color or paint(name, spec.shape))],
        }
        if min(size) > 0.0 and max(size) < _LARGEST:
            key = (spec.shape, size, offset, (spec.wheelbase, spec.wheel_radius, spec.extra_axles))
            if key not in self._numbers:
                self._models[len(self._numbers)] = _actor_model(*key)
                self._numbers[key] = len(self._numbers)
            drawn["model"] = self._numbers[key]
        if name in self._stations:
            drawn["sensors"] = _sensor_poses(self._stations[name], spec)
        return drawn

    def take(self) -> dict[int, Data]:
        """Return the models since the last call, by number."""
        models, self._models = self._models, {}
        return models


def _spec(body: Body | None, category: str, size: Vector3, offset: Vector3) -> ActorSpec:
    """Return the specification of an actor; its shape follows from the category if its body is unknown."""
    if body is None or body.shape not in BUILDERS:
        slender = size[2] > 2.0 * max(size[:2])
        shape = category if category in BUILDERS else "rsu" if slender else "box"
        wheelbase = 0.0 if category in ("pedestrian", "misc") else 2.0 * offset[0] if offset[0] > 0.0 else 0.6 * size[0]
        return ActorSpec("", shape, category, size, offset, wheelbase=wheelbase, wheel_radius=min(0.35, 0.3 * size[2]))
    return ActorSpec(
        "", body.shape, category, size, offset, wheelbase=body.wheelbase, wheel_radius=body.wheel_radius,
        extra_axles=body.extra_axles, color=body.color,
    )  # fmt: skip


@lru_cache(maxsize=256)
def _actor_model(shape: str, size: Vector3, offset: Vector3, axles: tuple[float, float, tuple[ExtraAxle, ...]]) -> Data:
    return encoded_model(shared_model(shape, size, offset, axles, (1.0, 1.0, 1.0), ""))


def _sensor_poses(station: Any, spec: ActorSpec) -> list[list[Any]]:
    """Return the sensors of a station with an opening angle; none for settings that this version cannot read."""
    try:
        given = {name: station[name] for name in _SENSOR_SETTINGS if station.get(name) is not None}
        sensors = station_sensors(AgentSettings.model_validate(given))
    except (EidriveError, ValidationError, AttributeError, LookupError, TypeError, ValueError, ImportError):
        return []
    poses: list[list[Any]] = []
    for name, sensor in sensors.items():
        angle = getattr(sensor, "fov", getattr(sensor, "field_of_view", None))
        if angle is not None:
            mount = mounting(sensor, spec, "front" if isinstance(sensor, CameraSettings) else "roof")
            foot = np.array([mount.x, mount.y, mount.z]) - spec.offset + (0.0, 0.0, spec.size[2] / 2.0)
            pose = [round(value, 4) for value in (*foot.tolist(), mount.yaw, mount.pitch, math.radians(angle))]
            reach = getattr(sensor, "range", math.inf)
            poses.append([name, sensor.kind, *pose, reach if math.isfinite(reach) else None])
    return poses
