"""What cameras see: meshes in a pybullet client of their own, made when the first picture is asked for."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.roads import surface_meshes
from eidrive_scenario.world.bodies import Body, quaternion
from eidrive_scenario.world.bullet import bullet, connect
from eidrive_scenario.world.camera import Array, Picture, Pinhole, Radiance, metres, projection_matrix, sky, view_matrix
from eidrive_scenario.world.meshes import actor_mesh, shadow
from eidrive_scenario.world.meshes.buildings import building as building_mesh
from eidrive_scenario.world.meshes.palette import FACADES, MATERIALS, Colour, by_name, paint
from eidrive_scenario.world.meshes.solids import polygon
from eidrive_scenario.world.scenery import Building, Scenery
from eidrive_scenario.world.weather import Weather

_AWAY = (0.0, 0.0, -10_000.0)
_SUN = (0.45, -0.35, 0.82)
_BESIDE_ROADS = 400.0
"""How far the ground goes on around the roads [m]."""
_BELOW_ROADS = 0.06
"""How far the ground lies below the roads, lest it shows through [m]."""
_MOST_VERTICES = 3 * 20_000
"""In one mesh; pybullet refuses much more."""


class Visuals:
    """Bodies without a collision shape, one for each material of each actor, moved there before each picture.

    pybullet would draw the collision boxes of the physics client too, hence a client that has only meshes.
    """

    def __init__(self, scenery: Scenery) -> None:
        self._client = connect()
        self._scenery = scenery
        self._parts: dict[str, tuple[Body, list[int]]] = {}
        self._shown_buildings = 0
        self._draw_ground()

    def close(self) -> None:
        """Give the client back."""
        bullet.disconnect(physicsClientId=self._client)

    def picture(
        self, shown: Mapping[int, Body], pose: Array, width: int, height: int, fov: float, near: float, far: float
    ) -> Picture:
        """The picture of a camera; `shown` are the actors that can be seen, by their rows."""
        rows = self._arrange(shown)
        _, _, colours, buffer, handles = bullet.getCameraImage(
            width,
            height,
            viewMatrix=view_matrix(pose),
            projectionMatrix=projection_matrix(width, height, fov, near, far),
            lightDirection=_SUN,
            lightColor=(1.0, 1.0, 1.0),
            lightAmbientCoeff=0.62,
            lightDiffuseCoeff=0.55,
            lightSpecularCoeff=0.08,
            shadow=0,
            renderer=bullet.ER_TINY_RENDERER,
            physicsClientId=self._client,
        )
        seen = np.asarray(handles, dtype=np.int32).reshape(height, width)
        depth = metres(np.asarray(buffer, dtype=np.float32).reshape(height, width), near, far)
        nothing = seen < 0
        np.copyto(depth, np.float32(np.inf), where=nothing)
        rgb = np.ascontiguousarray(np.asarray(colours, dtype=np.uint8).reshape(height, width, 4)[..., :3])
        np.copyto(rgb, sky(pose, width, height, fov), where=nothing[..., None])
        return Picture(rgb, depth, rows[seen])

    def radiance(self, shown: Mapping[int, Body], pose: Array, pinhole: Pinhole, weather: Weather) -> Radiance:
        """The light that reaches a camera."""
        fov = 2 * math.atan(pinhole.width / 2 / pinhole.focal)
        rgb, depth, rows = self.picture(shown, pose, pinhole.width, pinhole.height, fov, pinhole.near, pinhole.far)
        up = max(math.sin(math.radians(weather.sun_elevation)), 0.002)
        light = (rgb / np.float32(255.0)) ** np.float32(2.2) * np.float32(
            30_000.0 * up * (1 - 0.7 * weather.cloud_cover)
        )
        through = np.exp(-weather.extinction * np.minimum(depth, np.float32(1e4)))[..., None]
        light = light * through + (1 - through) * np.float32(12_000.0 * up)
        return Radiance(light.astype(np.float32), depth, rows)

    def _arrange(self, shown: Mapping[int, Body]) -> NDArray[np.int32]:
        """Move the meshes to the actors; returns the row of each handle, -1 for what is no actor, also at index -1."""
        for building in self._scenery.buildings[self._shown_buildings :]:
            self._draw_building(building)
        self._shown_buildings = len(self._scenery.buildings)
        bodies = {body.name: body for body in shown.values()}
        for name, (body, handles) in list(self._parts.items()):
            if bodies.get(name) is not body:
                self._move(handles, _AWAY, (0.0, 0.0, 0.0, 1.0))
        for body in shown.values():
            known = self._parts.get(body.name)
            if known is None or known[0].spec != body.spec:
                self._parts[body.name] = (body, self._draw_actor(body))
            elif known[0] is not body:
                self._parts[body.name] = (body, known[1])
        highest = max((max(handles) for _, handles in self._parts.values()), default=0)
        rows = np.full(max(highest, bullet.getNumBodies(physicsClientId=self._client)) + 2, -1, dtype=np.int32)
        for row, body in shown.items():
            handles = self._parts[body.name][1]
            self._move(handles, _foot(body), quaternion(body.yaw, body.pitch, body.roll))
            rows[handles[:-1]] = row
        return rows

    def _move(self, handles: Sequence[int], at: Sequence[float], turn: Sequence[float]) -> None:
        for handle in handles:
            bullet.resetBasePositionAndOrientation(handle, at, turn, physicsClientId=self._client)

    def _draw_actor(self, body: Body) -> list[int]:
        """The handles of an actor's materials, and last that of its shadow."""
        spec = body.spec
        own = spec.colour or paint(spec.name, spec.shape)
        handles: list[int] = []
        for material, triangles in actor_mesh(spec).items():
            handles += self._add(triangles, own if material == "paint" else MATERIALS[material])
        return handles + self._add(shadow(spec), MATERIALS["shadow"])

    def _draw_building(self, building: Building) -> None:
        own = building.colour or by_name(building.name, FACADES)
        foot = (building.centre[0], building.centre[1], building.centre[2] - building.size[2] / 2)
        for material, triangles in building_mesh(building.size).items():
            handles = self._add(triangles, own if material == "wall" else MATERIALS[material])
            self._move(handles, foot, quaternion(building.yaw, 0.0, 0.0))

    def _draw_ground(self) -> None:
        low, high = np.zeros(3), np.zeros(3)
        if self._scenery.roads is not None:
            meshes = surface_meshes(self._scenery.roads)
            for mesh in meshes:
                self._add(mesh.vertices[mesh.faces], mesh.colour)
            points = np.concatenate([mesh.vertices for mesh in meshes]) if meshes else np.zeros((1, 3))
            low, high = points.min(axis=0), points.max(axis=0)
        (x0, y0, z), (x1, y1, _) = (low - _BESIDE_ROADS).tolist(), (high + _BESIDE_ROADS).tolist()
        z += _BESIDE_ROADS - _BELOW_ROADS
        ground = MATERIALS["grass" if self._scenery.roads is not None else "asphalt"]
        self._add(polygon([(x0, y0, z), (x1, y0, z), (x1, y1, z), (x0, y1, z)]), ground)

    def _add(self, triangles: Array, colour: Colour) -> list[int]:
        """Bodies that show triangles (K, 3, 3), each with its own flat shade; one, unless there are very many."""
        normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        lengths = np.linalg.norm(normals, axis=1, keepdims=True)
        solid = lengths[:, 0] > 1e-12
        corners = triangles[solid].reshape(-1, 3)
        normals = np.repeat(normals[solid] / lengths[solid], 3, axis=0)
        handles = []
        for start in range(0, len(corners), _MOST_VERTICES):
            part = slice(start, start + _MOST_VERTICES)
            shape = bullet.createVisualShape(
                bullet.GEOM_MESH,
                vertices=corners[part].tolist(),
                indices=list(range(len(corners[part]))),
                normals=normals[part].tolist(),
                rgbaColor=(*colour, 1.0),
                specularColor=(0.1, 0.1, 0.1),
                physicsClientId=self._client,
            )
            handles.append(bullet.createMultiBody(0, -1, shape, useMaximalCoordinates=1, physicsClientId=self._client))
        return handles


def _foot(body: Body) -> tuple[float, float, float]:
    """The centre of the bottom of an actor's box in the world."""
    ox, oy, oz = body.spec.offset
    oz -= body.spec.size[2] / 2
    cy, sy, cp, sp = math.cos(body.yaw), math.sin(body.yaw), math.cos(body.pitch), math.sin(body.pitch)
    cr, sr = math.cos(body.roll), math.sin(body.roll)
    ahead, aside = ox * cp + oy * sp * sr + oz * sp * cr, oy * cr - oz * sr
    return (
        body.x + cy * ahead - sy * aside,
        body.y + sy * ahead + cy * aside,
        body.z - ox * sp + oy * cp * sr + oz * cp * cr,
    )
