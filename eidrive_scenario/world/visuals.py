"""What cameras see: meshes in pybullet, made when the first picture is asked for."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.geometry import rotation_matrix
from eidrive_scenario.world.bodies import Body, quaternion
from eidrive_scenario.world.bullet import bullet
from eidrive_scenario.world.camera import Array, Picture, metres, projection_matrix, view_matrix
from eidrive_scenario.world.meshes import actor_mesh
from eidrive_scenario.world.meshes.palette import MATERIALS, Colour, paint
from eidrive_scenario.world.scenery import Scenery

_AWAY = (0.0, 0.0, -10_000.0)
SUN = (0.45, -0.35, 0.82)


class Visuals:
    """Bodies without collision shape: one for each material of each actor, moved to the actors before each picture."""

    def __init__(self, scenery: Scenery) -> None:
        self._client: int = bullet.connect(bullet.DIRECT)
        self._scenery = scenery
        self._parts: dict[str, tuple[Body, list[int]]] = {}
        self._row_of_handle = np.empty(0, dtype=np.int32)

    def picture(
        self, shown: Mapping[int, Body], pose: Array, width: int, height: int, fov: float, near: float, far: float
    ) -> Picture:
        """The picture of a camera; `shown` are the actors that can be seen, by their rows."""
        self._place(shown)
        _, _, rgba, depth, handles = bullet.getCameraImage(
            width,
            height,
            viewMatrix=view_matrix(pose),
            projectionMatrix=projection_matrix(width, height, fov, near, far),
            lightDirection=SUN,
            shadow=0,
            lightColor=(1.0, 1.0, 1.0),
            lightAmbientCoeff=0.62,
            lightDiffuseCoeff=0.55,
            lightSpecularCoeff=0.08,
            renderer=bullet.ER_TINY_RENDERER,
            physicsClientId=self._client,
        )
        rgb = np.asarray(rgba, dtype=np.uint8).reshape(height, width, 4)[..., :3]
        seen = np.asarray(handles, dtype=np.int32).reshape(height, width)
        return Picture(rgb, metres(np.asarray(depth, dtype=np.float32).reshape(height, width), near, far), seen)

    def _place(self, shown):
        for row, body in shown.items():
            if body.name not in self._parts:
                hs = []
                for material, tri in actor_mesh(body.spec).items():
                    colour = (
                        (body.spec.colour or paint(body.name, body.spec.shape))
                        if material == "paint"
                        else MATERIALS[material]
                    )
                    hs.append(self._add(tri, colour))
                self._parts[body.name] = (body, hs)
            r = rotation_matrix(body.yaw, body.pitch, body.roll)
            ox, oy, oz = body.spec.offset
            at = np.array([body.x, body.y, body.z]) + r @ (ox, oy, oz - body.spec.size[2] / 2)
            for h in self._parts[body.name][1]:
                bullet.resetBasePositionAndOrientation(
                    h, at.tolist(), quaternion(body.yaw, body.pitch, body.roll), physicsClientId=self._client
                )

    def _add(self, triangles: Array, colour: Colour) -> int:
        normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        keep = np.linalg.norm(normals, axis=1) > 1e-12
        triangles, normals = triangles[keep], normals[keep]
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        shape = bullet.createVisualShape(
            bullet.GEOM_MESH,
            vertices=triangles.reshape(-1, 3).tolist(),
            indices=list(range(3 * len(triangles))),
            normals=np.repeat(normals, 3, axis=0).tolist(),
            rgbaColor=(*colour, 1.0),
            specularColor=(0.1, 0.1, 0.1),
            physicsClientId=self._client,
        )
        return bullet.createMultiBody(0, -1, shape, physicsClientId=self._client)
