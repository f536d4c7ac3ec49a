"""Visible objects beside the roads: road objects, signs, and traffic lights with lamps."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from eidrive_scenario.arrays import Array
from eidrive_scenario.geometry import rotation_matrix
from eidrive_scenario.roads.model.signal_states import GREEN, RED, YELLOW, lamp_colors, lamps, lit
from eidrive_scenario.world.meshes.road_objects import road_object_mesh, traffic_light
from eidrive_scenario.world.meshes.sign_faces import sign_face
from eidrive_scenario.world.meshes.signs import sign
from eidrive_scenario.world.render.model import Light, MeshInstance, Model, gridded, model
from eidrive_scenario.world.road_objects import RoadObjectBody, SignalHead

FIRST_LABEL = -10
"""Segmentation label of the head of the first signal; the next one has -11, and so on."""
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
    """Meshes of the road objects and signals of one road network."""

    def __init__(self, pieces: Sequence[RoadObjectBody], heads: Sequence[SignalHead]) -> None:
        self._still: Model | None = _standing(pieces)
        self._heads = tuple(heads)
        self._models = [_head_model(head) for head in heads]
        self._turns = [rotation_matrix(head.pose.h, 0.0, 0.0) for head in heads]
        self._places = np.array([head.pose[:3] for head in heads]).reshape(-1, 3)

    def instances(self, viewpoint: Array, states: Mapping[str, str], time: float) -> list[MeshInstance]:
        """Return all objects within sight of a camera at `viewpoint` (3,), with the signal states at `time` [s]."""
        found = [] if self._still is None else [MeshInstance(self._still, np.eye(3), np.zeros(3))]
        near = np.flatnonzero(np.linalg.norm(self._places - viewpoint, axis=1) < IN_SIGHT)
        for row in near.tolist():
            glow = _glow(self._heads[row], states.get(self._heads[row].signal.id), time)
            label = FIRST_LABEL - row
            found.append(MeshInstance(self._models[row], self._turns[row], self._places[row], label, glow))
        return found


def _standing(pieces: Iterable[RoadObjectBody]) -> Model | None:
    """Return all road objects as one model; equal objects are placed together."""
    equal: dict[tuple[str, str, float, float, float, float], list[RoadObjectBody]] = {}
    for piece in pieces:
        key = (piece.kind, piece.name, piece.length, piece.width, piece.height, piece.radius)
        equal.setdefault(key, []).append(piece)
    triangles: dict[str, list[Array]] = {}
    for key, group in equal.items():
        poses = np.array([piece.pose for piece in group])
        for material, part in road_object_mesh(*key).items():
            triangles.setdefault(material, []).append(_placed(part, poses))
    if not triangles:
        return None
    return gridded(model({material: np.concatenate(parts) for material, parts in triangles.items()}, {}))


def _placed(part: Array, poses: Array) -> Array:
    """Return triangles (N K, 3, 3) of a mesh (K, 3, 3) at upright poses (N, 6)."""
    cos, sin = np.cos(poses[:, 3])[:, None, None], np.sin(poses[:, 3])[:, None, None]
    x, y, z = part[None, ..., 0], part[None, ..., 1], part[None, ..., 2]
    px, py, pz = (poses[:, axis][:, None, None] for axis in range(3))
    corners = np.stack([px + cos * x - sin * y, py + sin * x + cos * y, pz + z], axis=-1)
    return corners.reshape(-1, 3, 3)


def _head_model(head: SignalHead) -> Model:
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
