"""The truth sensor: exact boxes of the objects in its line of sight, asked of the world by rays."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.sensing.mounting import mounting
from eidrive_scenario.sensing.readings import TruthReading
from eidrive_scenario.sensing.scene import NOTHING, Scene
from eidrive_scenario.sensing.settings import TruthSettings
from eidrive_scenario.world.actor import ActorSpec
from eidrive_scenario.world.view import WorldView

Array = NDArray[np.float64]

INSET = 0.9
"""The sampled corners lie at this share of the way from centre to corner, so that a ray to one meets the body."""

SAMPLES = np.array(
    [[x * INSET, y * INSET, z * INSET] for x in (1, -1) for y in (1, -1) for z in (1, -1)]
    + [[0.0, 0.0, 0.0], [0.0, 0.0, INSET]]
)
"""(10, 3) points of a box, in half lengths from its centre: eight corners, the centre, the middle of the top."""

BEYOND_OWN_BODY = 1e-3
"""A ray that leaves the own body starts this share of its length behind it."""


class TruthSensor:
    """Reports an object if its centre is within range and field of view and enough of its points are in sight.

    Range is measured between the centres of the bodies; rays start at the mount and pass through the own body.
    """

    def __init__(self, settings: TruthSettings, spec: ActorSpec) -> None:
        self.settings = settings
        self.mounting = mounting(settings, spec, "roof")
        self.half_field = math.radians(settings.field_of_view) / 2.0


def read_truth(
    sensors: Sequence[TruthSensor], rows: Sequence[int], scene: Scene, view: WorldView
) -> list[TruthReading]:
    """What each sensor sees from the actor in its row; all rays of all sensors go out in one batch."""
    boxes = view.boxes
    own = np.asarray(rows, dtype=np.intp)
    unseen = [view.rows[name] for name in view.unseen if name in view.rows]
    sensor_of, target_of = _candidates(sensors, own, boxes, unseen)
    visibility = np.empty(0)
    if len(sensor_of):
        visibility = _visibility(sensors, own, sensor_of, target_of, boxes, scene, view)
    readings = []
    for index, sensor in enumerate(sensors):
        mine = sensor_of == index
        share = visibility[mine]
        seen = share >= sensor.settings.visibility - 1e-9
        found = target_of[mine][seen]
        readings.append(
            TruthReading(
                names=tuple(view.names[row] for row in found),
                categories=tuple(view.categories[row] for row in found),
                boxes=boxes[found],
                velocity=view.velocity[found, :2],
                visibility=share[seen],
            )
        )
    return readings


def _candidates(
    sensors: Sequence[TruthSensor], own: NDArray[np.intp], boxes: Array, unseen: Sequence[int]
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Pairs (sensor, row of an object) within range and field of view, the own body and unseen ones left out."""
    offset = boxes[None, :, :3] - boxes[own, None, :3]
    reach = np.array([sensor.settings.range for sensor in sensors])
    near = np.einsum("sni,sni->sn", offset, offset) <= (reach * reach)[:, None]
    near[np.arange(len(own)), own] = False
    near[:, unseen] = False
    for index, sensor in enumerate(sensors):
        if sensor.half_field < math.pi:
            heading = float(boxes[own[index], 6]) + sensor.mounting.yaw
            ahead = math.cos(heading) * offset[index, :, 0] + math.sin(heading) * offset[index, :, 1]
            aside = math.cos(heading) * offset[index, :, 1] - math.sin(heading) * offset[index, :, 0]
            near[index] &= np.abs(np.arctan2(aside, ahead)) <= sensor.half_field
    pairs = np.nonzero(near)
    return pairs[0], pairs[1]


def _visibility(
    sensors: Sequence[TruthSensor],
    own: NDArray[np.intp],
    sensor_of: NDArray[np.intp],
    target_of: NDArray[np.intp],
    boxes: Array,
    scene: Scene,
    view: WorldView,
) -> Array:
    """(P,) share of each object's sampled points that are in sight of its sensor."""
    mounts = np.array([sensor.mounting.position(view, row) for sensor, row in zip(sensors, own, strict=True)])
    targets = _points(boxes[target_of])
    origins = np.repeat(mounts[sensor_of][:, None], len(SAMPLES), axis=1)
    starts = past_box(origins, targets, boxes[own[sensor_of]])
    hits = scene.cast(starts.reshape(-1, 3), targets.reshape(-1, 3))
    met = np.asarray(hits.rows).reshape(len(target_of), len(SAMPLES))
    in_sight = (met == target_of[:, None]) | (met == NOTHING)
    return np.asarray(in_sight.mean(axis=1))


def _points(boxes: Array) -> Array:
    """(P, 10, 3) sampled points of boxes (P, 7)."""
    local = SAMPLES * (boxes[:, None, 3:6] / 2.0)
    cos, sin = np.cos(boxes[:, 6:7]), np.sin(boxes[:, 6:7])
    points = np.empty_like(local)
    points[..., 0] = boxes[:, 0:1] + cos * local[..., 0] - sin * local[..., 1]
    points[..., 1] = boxes[:, 1:2] + sin * local[..., 0] + cos * local[..., 1]
    points[..., 2] = boxes[:, 2:3] + local[..., 2]
    return points


def crossing(origins: Array, targets: Array, boxes: Array) -> tuple[Array, Array]:
    """Where rays (P, K, 3) enter and leave boxes (P, 7), as shares of the way; enter > leave where they miss.

    The slab method (Kay and Kajiya, Ray tracing complex scenes, 1986) in the frame of the box.
    """
    cos, sin = np.cos(boxes[:, 6])[:, None], np.sin(boxes[:, 6])[:, None]
    enter = np.full(origins.shape[:2], -np.inf)
    leave = np.full(origins.shape[:2], np.inf)
    start, way = origins - boxes[:, None, :3], targets - origins
    axes = (
        (cos * start[..., 0] + sin * start[..., 1], cos * way[..., 0] + sin * way[..., 1]),
        (cos * start[..., 1] - sin * start[..., 0], cos * way[..., 1] - sin * way[..., 0]),
        (start[..., 2], way[..., 2]),
    )
    for axis, (place, step) in enumerate(axes):
        half = boxes[:, None, 3 + axis] / 2.0
        step = np.where(np.abs(step) < 1e-12, 1e-12, step)
        first, second = (-half - place) / step, (half - place) / step
        enter = np.maximum(enter, np.minimum(first, second))
        leave = np.minimum(leave, np.maximum(first, second))
    return enter, leave


def past_box(origins: Array, targets: Array, boxes: Array) -> Array:
    """(P, K, 3) starts of the rays: behind the box where a ray crosses it on its way, else where it was."""
    enter, leave = crossing(origins, targets, boxes)
    crosses = (enter < leave) & (leave > 0.0) & (enter < 1.0)
    share = np.where(crosses, np.minimum(leave + BEYOND_OWN_BODY, 1.0), 0.0)
    return np.asarray(origins + share[..., None] * (targets - origins))
