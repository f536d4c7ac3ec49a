"""Labels of an image: boxes from the segmentation, visible shares from silhouettes."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.geometry import rotation_matrix
from eidrive_scenario.perception.learned.image_network import IMAGE_CLASSES, LIGHT, STOP_SIGN
from eidrive_scenario.rendering.meshes import actor_mesh
from eidrive_scenario.rendering.meshes.signs import sign_face
from eidrive_scenario.roads.model.signal_states import lamp_colors, lamps, lit
from eidrive_scenario.sensing.readings import CameraReading
from eidrive_scenario.world.actor import ActorSpec
from eidrive_scenario.world.camera import FIRST_SIGNAL_LABEL
from eidrive_scenario.world.road_objects import SignalHead
from eidrive_scenario.world.view import WorldView
from eidrive_scenario.world.weather import Weather

NEAREST = 0.3
"""Distance to the camera below which bodies are labeled without a silhouette [m]."""
LEAST_CONTRAST = 0.05
"""Minimum share of the contrast of an object that fog and rain transmit."""
DARK = 10
"""Minimum gray level, of 255, in or around an object."""
LEAST_FACING = 0.25
"""Minimum cosine of the angle between the direction of a readable signal and that to the camera."""


class Label(NamedTuple):
    """Object in an image.

    number   of its class in IMAGE_CLASSES;  box  x1 y1 x2 y2 of its visible part [px]
    visible_pixels     in the image;  silhouette_pixels  those of its silhouette within the image without occlusion
    distance from the camera to its center [m];  world_box  x y z l w h yaw in the world [m, rad]
    readable whether its class is visible: False for traffic lights from behind, in dense fog and in the dark
    """

    number: int
    box: tuple[float, float, float, float]
    visible_pixels: int
    silhouette_pixels: int
    distance: float
    world_box: tuple[float, ...]
    readable: bool = True


def actor_labels(
    reading: CameraReading, view: WorldView, specs: Mapping[str, ActorSpec], skip: Iterable[str] = ()
) -> list[Label]:
    """Return the visible actors of the image classes, except those in `skip`."""
    skipped = set(skip)
    labels = []
    for index in np.unique(reading.segmentation[reading.segmentation >= 0]).tolist():
        name = view.categories[index].replace("van", "car")  # the networks do not distinguish them
        if view.names[index] in skipped or name not in IMAGE_CLASSES:
            continue
        box, visible_pixels = _extent(reading, index)
        silhouette_pixels = max(silhouette(reading, view, index, specs[view.names[index]]), visible_pixels)
        world_box = view.boxes[index]
        distance = float(np.linalg.norm(world_box[:3] - reading.pose[:3, 3]))
        number, body = IMAGE_CLASSES.index(name), tuple(world_box.tolist())
        labels.append(Label(number, box, visible_pixels, silhouette_pixels, distance, body))
    return labels


def _extent(reading: CameraReading, label: int) -> tuple[tuple[float, float, float, float], int]:
    """Return the box x1 y1 x2 y2 [px] around the pixels with this label of the segmentation, and their number."""
    lines, columns = np.nonzero(reading.segmentation == label)
    box = (float(columns.min()), float(lines.min()), float(columns.max() + 1), float(lines.max() + 1))
    return box, len(lines)


def mark_readable(labels: Iterable[Label], reading: CameraReading, weather: Weather) -> list[Label]:
    """Return the labels; objects that fog hides or that are black on black are marked as not readable."""
    gray = cv2.blur(cv2.cvtColor(reading.rgb, cv2.COLOR_RGB2GRAY), (3, 3))
    marked = []
    for label in labels:
        left, top, right, bottom = (int(side) for side in label.box)
        dark = int(gray[max(top - 3, 0) : bottom + 3, max(left - 3, 0) : right + 3].max()) < DARK
        in_fog = math.exp(-weather.extinction * label.distance) < LEAST_CONTRAST
        marked.append(label._replace(readable=label.readable and not dark and not in_fog))
    return marked


def silhouette(reading: CameraReading, view: WorldView, row: int, spec: ActorSpec) -> int:
    """Return the pixels of the actor without occlusion; 0 if it extends behind the camera."""
    triangles = np.concatenate(list(actor_mesh(spec).values()))
    body = rotation_matrix(view.yaw[row], view.pitch[row], view.roll[row])
    foot = np.array(spec.offset) - (0.0, 0.0, spec.size[2] / 2.0)
    world = view.position[row] + (triangles.reshape(-1, 3) + foot) @ body.T
    points = to_camera(world, reading.pose)
    if points[:, 2].min() < NEAREST:
        return 0
    pixels = project(points, reading).reshape(-1, 3, 2)
    edge_a, edge_b = pixels[:, 1] - pixels[:, 0], pixels[:, 2] - pixels[:, 0]
    towards = edge_a[:, 0] * edge_b[:, 1] - edge_a[:, 1] * edge_b[:, 0] < 0.0
    height, width = reading.segmentation.shape
    low = np.floor(pixels.min(axis=(0, 1)).clip(0, (width, height))).astype(int)
    high = np.ceil(pixels.max(axis=(0, 1)).clip(0, (width, height))).astype(int)
    if (high <= low).any():
        return 0
    canvas = np.zeros((high[1] - low[1], high[0] - low[0]), dtype=np.uint8)
    for corners in _sixteenths(pixels[towards] - low):
        cv2.fillConvexPoly(canvas, corners, 1, shift=4)
    return int(canvas.sum())


def _sixteenths(corners: NDArray[Any]) -> NDArray[np.int32]:
    """Return pixel coordinates in sixteenths, from the center of a pixel as OpenCV counts."""
    return np.rint((corners - 0.5) * 16.0).clip(-(2**26), 2**26).astype(np.int32)


def signal_labels(reading: CameraReading, heads: Sequence[SignalHead], states: Mapping[str, str]) -> list[Label]:
    """Return the visible traffic lights and stop signs; those that do not face the camera are not readable."""
    labels = []
    segmentation = reading.segmentation
    for number in np.unique(segmentation[segmentation <= FIRST_SIGNAL_LABEL]).tolist():
        head = heads[FIRST_SIGNAL_LABEL - number]
        name = signal_class(head, states.get(head.signal.id, ""))
        if name is None:
            continue
        box, visible_pixels = _extent(reading, number)
        pose = head.pose
        corners, center = head_box(head)
        to_camera_center = reading.pose[:3, 3] - center
        towards_camera = math.cos(pose.h) * to_camera_center[0] + math.sin(pose.h) * to_camera_center[1]
        facing = towards_camera / float(np.hypot(*to_camera_center[:2]))
        labels.append(
            Label(
                IMAGE_CLASSES.index(name),
                box,
                visible_pixels,
                max(_outline(reading, corners), visible_pixels),
                float(np.linalg.norm(to_camera_center)),
                (*center.tolist(), 0.0, head.width, head.height, pose.h),
                readable=facing > LEAST_FACING,
            )
        )
    return labels


def signal_class(head: SignalHead, state: str) -> str | None:
    """Return the class of a traffic light or stop sign; None for all other signs."""
    colors = lamp_colors(head.signal)
    if not colors:
        return STOP_SIGN if sign_face(head.signal).shape == "octagon" else None
    shining = [color for (color, _), on in zip(lamps(state, colors), lit(state, colors, 0.0), strict=True) if on]
    return f"{LIGHT} {shining[0] if shining else 'off'}"


def head_box(head: SignalHead) -> tuple[Array, Array]:
    """Return corners (8, 3) and center (3,) of the box of a signal head [m]; the depth of a light is half its width."""
    pose = head.pose
    cos, sin = math.cos(pose.h), math.sin(pose.h)
    depth = 0.5 * head.width if lamp_colors(head.signal) else 0.0
    corners = np.array(
        [
            (pose.x + cos * x - sin * y, pose.y + sin * x + cos * y, pose.z + z)
            for x in (-depth, 0.0)
            for y in (-head.width / 2, head.width / 2)
            for z in (0.0, head.height)
        ]
    )
    return corners, np.asarray(corners.mean(axis=0))


def _outline(reading: CameraReading, corners: Array) -> int:
    """Return the pixels in the image that the hull of corners (8, 3) covers; 0 if it extends behind the camera."""
    points = to_camera(corners, reading.pose)
    if points[:, 2].min() < NEAREST:
        return 0
    hull = cv2.convexHull(project(points, reading).astype(np.float32)).reshape(-1, 2)
    canvas = np.zeros(reading.segmentation.shape, dtype=np.uint8)
    cv2.fillConvexPoly(canvas, _sixteenths(hull), 1, shift=4)
    return int(canvas.sum())


def to_camera(points: Array, pose: Array) -> Array:
    """Return world points (N, 3) in the frame of a camera of this pose."""
    return np.asarray((points - pose[:3, 3]) @ pose[:3, :3])


def project(points: Array, reading: CameraReading) -> Array:
    """Return pixels (N, 2) of points (N, 3) in the camera frame, in front of it, with lens distortion."""
    pixels, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), reading.intrinsics, reading.distortion)
    return np.asarray(pixels, dtype=float).reshape(-1, 2)
