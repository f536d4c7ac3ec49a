"""What can be seen in a picture, and how much of it: boxes from the segmentation, shares from silhouettes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.geometry import rotation_matrix
from eidrive_scenario.perception.learned.classes import IMAGE_CLASSES, image_class
from eidrive_scenario.sensing.readings import CameraReading
from eidrive_scenario.world.actor import ActorSpec
from eidrive_scenario.world.meshes import actor_mesh
from eidrive_scenario.world.view import WorldView

Array = NDArray[np.float64]

NEAREST = 0.3
"""Bodies that come nearer to the camera than this are labelled without a silhouette [m]."""


class Label(NamedTuple):
    """One object in a picture.

    number   of its class in IMAGE_CLASSES;  box  x1 y1 x2 y2 of what is seen of it [px]
    seen     its pixels in sight;  whole  those of its silhouette within the picture, were it alone
    distance from the camera to its centre [m];  place  x y z l w h yaw in the world [m, rad]
    """

    number: int
    box: tuple[float, float, float, float]
    seen: int
    whole: int
    distance: float
    place: tuple[float, ...]


def actor_labels(
    reading: CameraReading, view: WorldView, specs: Mapping[str, ActorSpec], skip: Iterable[str] = ()
) -> list[Label]:
    """The actors of the classes looked for that are in sight, those in `skip` aside."""
    skipped = set(skip)
    segmentation = reading.segmentation
    counts = np.bincount(segmentation[segmentation >= 0], minlength=len(view.names))
    found = []
    for row in np.flatnonzero(counts).tolist():
        name = image_class(view.categories[row])
        if view.names[row] in skipped or name not in IMAGE_CLASSES:
            continue
        lines, columns = np.nonzero(segmentation == row)
        box = (float(columns.min()), float(lines.min()), float(columns.max() + 1), float(lines.max() + 1))
        seen = int(counts[row])
        whole = silhouette(reading, view, row, specs[view.names[row]])
        place = view.boxes[row]
        distance = float(np.linalg.norm(place[:3] - reading.pose[:3, 3]))
        found.append(
            Label(IMAGE_CLASSES.index(name), box, seen, max(whole or seen, seen), distance, tuple(place.tolist()))
        )
    return found


def silhouette(reading: CameraReading, view: WorldView, row: int, spec: ActorSpec) -> int | None:
    """Pixels that the actor would fill were nothing before it; None where it reaches behind the camera."""
    triangles = np.concatenate(list(actor_mesh(spec).values()))
    body = rotation_matrix(view.yaw[row], view.pitch[row], view.roll[row])
    foot = np.array(spec.offset) - (0.0, 0.0, spec.size[2] / 2.0)
    world = view.position[row] + (triangles.reshape(-1, 3) + foot) @ body.T
    points = to_camera(world, reading.pose)
    if points[:, 2].min() < NEAREST:
        return None
    pixels = project(points, reading).reshape(-1, 3, 2)
    edge_a, edge_b = pixels[:, 1] - pixels[:, 0], pixels[:, 2] - pixels[:, 0]
    towards = edge_a[:, 0] * edge_b[:, 1] - edge_a[:, 1] * edge_b[:, 0] < 0.0
    height, width = reading.segmentation.shape
    low = np.floor(pixels.min(axis=(0, 1)).clip(0, (width, height))).astype(int)
    high = np.ceil(pixels.max(axis=(0, 1)).clip(0, (width, height))).astype(int)
    if (high <= low).any():
        return 0
    canvas = np.zeros((high[1] - low[1], high[0] - low[0]), dtype=np.uint8)
    shown = np.rint((pixels[towards] - low - 0.5) * 16.0).clip(-(2**26), 2**26).astype(np.int32)
    for corners in shown:
        cv2.fillConvexPoly(canvas, corners, 1, shift=4)
    return int(canvas.sum())


def box_label(reading: CameraReading, number: int, corners: Array, centre: Array, tolerance: float) -> Label | None:
    """A thing that is no actor, by the corners (8, 3) of its box in the world: seen where the depth is its own.

    None if it is out of the picture or wholly hidden.
    """
    points = to_camera(corners, reading.pose)
    if points[:, 2].min() < NEAREST:
        return None
    pixels = project(points, reading)
    height, width = reading.depth.shape
    hull = cv2.convexHull(pixels.astype(np.float32)).reshape(-1, 2)
    canvas = np.zeros((height, width), dtype=np.uint8)
    cv2.fillConvexPoly(canvas, np.rint((hull - 0.5) * 16.0).clip(-(2**26), 2**26).astype(np.int32), 1, shift=4)
    inside = canvas.astype(bool)
    whole = int(inside.sum())
    near, far = points[:, 2].min() - tolerance, points[:, 2].max() + tolerance
    lines, columns = np.nonzero(inside & (reading.depth >= near) & (reading.depth <= far))
    if not len(lines):
        return None
    box = (float(columns.min()), float(lines.min()), float(columns.max() + 1), float(lines.max() + 1))
    distance = float(np.linalg.norm(centre - reading.pose[:3, 3]))
    return Label(number, box, len(lines), whole, distance, (*centre.tolist(), 0.0, 0.0, 0.0, 0.0))


def to_camera(points: Array, pose: Array) -> Array:
    """World points (N, 3) in the frame of a camera of this pose."""
    return np.asarray((points - pose[:3, 3]) @ pose[:3, :3])


def project(points: Array, reading: CameraReading) -> Array:
    """(N, 2) pixels of points (N, 3) in the camera's frame, in front of it; by the lens's distortion."""
    pixels, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), reading.intrinsics, reading.distortion)
    return np.asarray(pixels, dtype=float).reshape(-1, 2)
