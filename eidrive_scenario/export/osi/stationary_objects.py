"""Stationary objects of a GroundTruth message, from the OpenDRIVE map of the run."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.geometry import rotation_matrix
from eidrive_scenario.export.osi.schemas import Identifiers, Osi, set_orientation
from eidrive_scenario.roads import PlacedObject, Pose, RoadNetwork, outlines, placed_objects
from eidrive_scenario.world.road_objects import (
    KINDS,
    LEAST,
    SIZES,
    STEP,
    STOREY,
    WITHOUT_TYPE,
    bounding_box,
    footprint,
    object_bodies,
    object_height,
)

_TYPES: Mapping[str, str] = {
    "building": "BUILDING",
    "tree": "TREE",
    "vegetation": "VEGETATION",
    "pole": "POLE",
    "lamp": "EMITTING_STRUCTURE",
    "guide post": "DELINEATOR",
    "barrier": "BARRIER",
    "railing": "BARRIER",
    "gantry": "OVERHEAD_STRUCTURE",
    "wall": "WALL",
    "rail-pole": "POLE",
}
"""Types by the kind of the object, or by its type in OpenDRIVE; OTHER for the rest."""


class _Solid(NamedTuple):
    """Box of an object: pose of the center of its base, length, width and height [m].

    polygon  outline (N, 2) in the world [m]; None if it is the box
    """

    kind: str
    pose: Pose
    length: float
    width: float
    height: float
    polygon: Array | None = None


def add_stationary_objects(
    osi: Osi, message: Any, roads: RoadNetwork, ids: Identifiers, without: Collection[str]
) -> None:
    """Add the buildings and objects of a map, except those with some ids. Areas painted on the road are none."""
    kinds = osi.stationary_object.Classification
    for number, placed in enumerate(placed_objects(roads)):
        road_object = placed.object
        for index, solid in enumerate(() if road_object.id in without else _solids(roads, placed)):
            stationary = message.stationary_object.add()
            stationary.id.value = ids.of("object", number, index)
            name = _TYPES.get(road_object.type) or _TYPES.get(solid.kind, "OTHER")
            stationary.classification.type = kinds.Type.Value(f"TYPE_{name}")
            base, (x, y, z, yaw, *_) = stationary.base, solid.pose
            base.position.x, base.position.y, base.position.z = x, y, z + 0.5 * solid.height
            base.dimension.length, base.dimension.width, base.dimension.height = solid[2:5]
            set_orientation(base.orientation, yaw)
            if solid.polygon is not None:
                for ahead, aside in _counterclockwise((solid.polygon - (x, y)) @ rotation_matrix(yaw)[:2, :2]):
                    base.base_polygon.add(x=ahead, y=aside)
            identifier = ["object", road_object.id]
            stationary.source_reference.add(type="net.asam.opendrive", identifier=identifier)


def _solids(roads: RoadNetwork, placed: PlacedObject) -> Iterator[_Solid]:
    """Yield the box around the outline of an object, or the boxes of which it consists in the simulation."""
    road_object = placed.object
    is_building = road_object.type == "building"
    kind = "building" if is_building else KINDS.get(road_object.type, "")
    height = object_height(placed) or (STOREY if is_building else SIZES[kind][2] if kind else 0.0)
    is_solid = height >= LEAST if kind else road_object.type in WITHOUT_TYPE and height >= STEP
    if is_solid and placed.shift is not None and len(road_object.outlines) == 1 and not road_object.lines:
        (polygon,) = outlines(roads, placed)
        yield _Solid(kind, *bounding_box(roads, placed), height, polygon[:, :2])
    elif is_building:
        for pose, length, width in footprint(roads, placed):
            yield _Solid(kind, pose, length or 1.0, width or 1.0, height)
    else:
        for body in object_bodies(roads, placed):
            yield _Solid(body.kind, body.pose, body.length, body.width, body.height)


def _counterclockwise(polygon: Array) -> list[list[float]]:
    """Return the corners of a polygon (N, 2) counterclockwise, without a last one that repeats the first."""
    if np.allclose(polygon[0], polygon[-1]):
        polygon = polygon[:-1]
    x, y = polygon.T
    corners: list[list[float]] = polygon[:: 1 if x @ np.roll(y, -1) >= y @ np.roll(x, -1) else -1].tolist()
    return corners
