"""Truth sensor: exact boxes of the objects in its line of sight, determined by ray casting."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.geometry import BOX_SAMPLES, points_of_boxes
from eidrive_scenario.sensing.crossing import few_ray_starts, starts_behind_bodies, turned
from eidrive_scenario.sensing.readings import TruthReading
from eidrive_scenario.sensing.sensor import Point, Scene, Sensor, mounting
from eidrive_scenario.sensing.settings import SensorSettings, TruthSettings
from eidrive_scenario.world.actor import ActorSpec
from eidrive_scenario.world.view import GROUND, NOTHING, WorldView

INSET = 0.9
"""Position of the sampled corners as a share of the distance from center to corner, so that a ray to one hits the body.
"""

SAMPLES: Array = INSET * BOX_SAMPLES
"""Sampled points (10, 3) of a box, in half lengths from its center."""

FEW_PAIRS, FEW_RAYS = 64, 80
"""Maximum number of sensor-actor pairs, and of rays, for which scalar arithmetic is faster than arrays. Without it runs
of the library take 1.1 times (pairs) and 1.5 times (rays) longer.
"""

MANY_RAYS = 1000
"""Maximum number of rays of which only the first hits are queried."""


class TruthSensor(Sensor):
    """Sensor of objects whose center is within range and field of view, with enough of their points in sight.

    The range is measured between the centers of the bodies; rays start at the mount and pass through the ego body.
    """

    settings_type: ClassVar[type[SensorSettings]] = TruthSettings
    unique: ClassVar[bool] = True
    settings: TruthSettings

    def __init__(self, settings: TruthSettings, spec: ActorSpec, name: str = "truth", seed: int = 0) -> None:
        super().__init__(settings, spec, name, seed)
        self.mounting = mounting(settings, spec, "roof")
        self.half_field = math.radians(settings.field_of_view) / 2.0
        self.range_squared = settings.range**2

    def read(self, scene: Scene, view: WorldView, row: int) -> TruthReading:
        return self.read_batch([self], [row], scene, view)[0]

    @classmethod
    def read_batch(
        cls, sensors: Sequence[TruthSensor], rows: Sequence[int], scene: Scene, view: WorldView
    ) -> list[TruthReading]:
        """Return the readings of several sensors, whose rays are cast in one batch.

        If the scenario hides actors from named sensors, each sensor is read separately.
        """
        if view.unseen_by and len(sensors) > 1:
            return [sensor.read(scene, view, row) for sensor, row in zip(sensors, rows, strict=True)]
        name = sensors[0].name if view.unseen_by else ""
        unseen = view.hidden_rows(name)
        if len(sensors) * len(view.names) <= FEW_PAIRS:
            targets = few_candidates(sensors, rows, view, unseen)
        else:
            targets = candidates(sensors, rows, view, unseen)
        shares: Sequence[float] = ()
        if any(targets) and (name or sum(map(len, targets)) * len(SAMPLES) > FEW_RAYS):
            shares = visibilities(sensors, rows, targets, scene, view, name)
        elif any(targets):
            shares = few_visibilities(sensors, rows, targets, scene, view)
        readings, start = [], 0
        for sensor, candidate_rows in zip(sensors, targets, strict=True):
            readings.append(_reading(sensor, candidate_rows, shares[start : start + len(candidate_rows)], view))
            start += len(candidate_rows)
        return readings


def _reading(sensor: TruthSensor, targets: Sequence[int], shares: Sequence[float], view: WorldView) -> TruthReading:
    """Return the objects in the rows `targets` with a sufficient share of their points in sight."""
    least = sensor.settings.visibility - 1e-9
    seen = [(row, share) for row, share in zip(targets, shares, strict=True) if share >= least]
    rows = np.array([row for row, _ in seen], dtype=np.intp)
    boxes = view.boxes.take(rows, axis=0)
    # The center of a box moves sideways in a turn, unlike the rear axle.
    x, y = (boxes[:, :2] - view.position.take(rows, axis=0)[:, :2]).T
    turning = view.yaw_rate.take(rows)[:, None] * np.column_stack([-y, x])
    return TruthReading(
        names=tuple([view.names[row] for row, _ in seen]),
        categories=tuple([view.categories[row] for row, _ in seen]),
        boxes=boxes,
        velocity=view.velocity.take(rows, axis=0)[:, :2] + turning,
        visibility=np.array([share for _, share in seen]),
    )


def candidates(
    sensors: Sequence[TruthSensor], own: Sequence[int], view: WorldView, unseen: Sequence[int]
) -> list[list[int]]:
    """Return for each sensor the rows of objects within range and field of view, without the ego body and unseen
    actors."""
    boxes = view.boxes
    stations = np.asarray(own, dtype=np.intp)
    offset = boxes[None, :, :3] - boxes[stations, None, :3]
    reach = np.array([sensor.range_squared for sensor in sensors])
    near = np.einsum("sni,sni->sn", offset, offset) <= reach[:, None]
    near[np.arange(len(stations)), stations] = False
    near[:, unseen] = False
    for index, sensor in enumerate(sensors):
        if sensor.half_field < math.pi:
            heading = float(boxes[own[index], 6]) + sensor.mounting.heading
            ahead = math.cos(heading) * offset[index, :, 0] + math.sin(heading) * offset[index, :, 1]
            aside = math.cos(heading) * offset[index, :, 1] - math.sin(heading) * offset[index, :, 0]
            near[index] &= np.abs(np.arctan2(aside, ahead)) <= sensor.half_field
    return [row.nonzero()[0].tolist() for row in near]


def few_candidates(
    sensors: Sequence[TruthSensor], own: Sequence[int], view: WorldView, unseen: Sequence[int]
) -> list[list[int]]:
    """Return the same as `candidates` in scalar arithmetic."""
    boxes = view.plain_boxes
    candidates: list[list[int]] = []
    for sensor, station in zip(sensors, own, strict=True):
        x, y, z, _, _, _, yaw = boxes[station]
        square, half = sensor.range_squared, sensor.half_field
        ahead = yaw + sensor.mounting.heading
        cos, sin = (math.cos(ahead), math.sin(ahead)) if half < math.pi else (1.0, 0.0)
        rows: list[int] = []
        for row, box in enumerate(boxes):
            dx, dy, dz = box[0] - x, box[1] - y, box[2] - z
            if row == station or row in unseen or dx * dx + dy * dy + dz * dz > square:
                continue
            if half >= math.pi or abs(math.atan2(cos * dy - sin * dx, cos * dx + sin * dy)) <= half:
                rows.append(row)
        candidates.append(rows)
    return candidates


def visibilities(
    sensors: Sequence[TruthSensor],
    own: Sequence[int],
    targets: Sequence[Sequence[int]],
    scene: Scene,
    view: WorldView,
    name: str = "",
) -> list[float]:
    """Return the shares of sampled points in sight, of the objects of each sensor in turn.

    With a name, actors that the scenario hides from the sensor of that name are transparent.
    """
    boxes = view.boxes
    sensor_of = np.arange(len(sensors)).repeat([len(rows) for rows in targets])
    target_of = np.concatenate([np.asarray(rows, dtype=np.intp) for rows in targets])
    mounts = np.array([sensor.mounting.position(view, row) for sensor, row in zip(sensors, own, strict=True)])
    points = turned(points_of_boxes(boxes[target_of], SAMPLES), view, target_of, upright=False)
    origins = mounts[sensor_of][:, None].repeat(len(SAMPLES), axis=1)
    starts = starts_behind_bodies(origins, points, view, np.asarray(own, dtype=np.intp)[sensor_of])
    begin, end = starts.reshape(-1, 3), points.reshape(-1, 3)
    if name or len(begin) > MANY_RAYS:
        rows = (scene.raycast(begin, end, sensor=name) if name else scene.raycast(begin, end)).rows
    else:
        rows = np.array(scene.first_hit(begin.tolist(), end.tolist()))
    met = np.asarray(rows).reshape(len(target_of), len(SAMPLES))
    in_sight = (met == target_of[:, None]) | (met == NOTHING)
    # The road hides what stands on it from below, but bodies are hit up to a millimeter before their underside: these
    # rays are cast again, from inside the body.
    from_below = mounts[sensor_of, 2] < boxes[target_of, 2] - boxes[target_of, 5] / 2.0
    target, ray = np.nonzero(in_sight & from_below[:, None])
    if len(target):
        begin, end = points[target, ray], starts[target, ray]
        in_sight[target, ray] = scene.raycast(begin, end, sensor=name).rows != GROUND
    shares: list[float] = in_sight.mean(axis=1).tolist()
    return shares


def few_visibilities(
    sensors: Sequence[TruthSensor], own: Sequence[int], targets: Sequence[Sequence[int]], scene: Scene, view: WorldView
) -> list[float]:
    """Return the same as `visibilities`, in scalar arithmetic if all bodies are upright and none is seen from below."""
    if not view.is_upright:
        return visibilities(sensors, own, targets, scene, view)
    boxes = view.plain_boxes
    starts: list[Point] = []
    points: list[Point] = []
    free: list[bool] = []
    for sensor, station, rows in zip(sensors, own, targets, strict=True):
        if rows:
            origin, body = sensor.mounting.position(view, station), boxes[station]
            for row in rows:
                if origin[2] < boxes[row][2] - boxes[row][5] / 2.0:
                    return visibilities(sensors, own, targets, scene, view)
                free.append(scene.is_free(station, origin, row))
                if free[-1]:
                    continue
                aims = _few_points(boxes[row])
                starts += (
                    [origin] * len(aims) if _above(origin, body, boxes[row]) else few_ray_starts(origin, aims, body)
                )
                points += aims
    met = scene.first_hit(starts, points) if points else ()
    shares, number, start = [], len(SAMPLES), 0
    for row, sees_all in zip([row for rows in targets for row in rows], free, strict=True):
        if sees_all:
            shares.append(1.0)
            continue
        part = met[start : start + number]
        start += number
        shares.append((part.count(row) + part.count(NOTHING)) / number)
    return shares


def _above(origin: Point, own: Sequence[float], other: Sequence[float]) -> bool:
    """Return whether all rays from an origin above the ego body to another box certainly pass above the ego body."""
    x, y, z = origin
    drop = z - own[2] - own[5] / 2.0
    if drop <= 0.0:
        return False
    reach = math.hypot(x - own[0], y - own[1]) + math.hypot(own[3], own[4]) / 2.0
    nearest = math.hypot(other[0] - x, other[1] - y) - math.hypot(other[3], other[4]) / 2.0
    fall = z - other[2] + other[5] / 2.0
    return fall * reach < drop * nearest


def _few_points(box: Sequence[float]) -> list[Point]:
    """Return the sampled points of one box, in the order of SAMPLES."""
    x, y, z, length, width, height, yaw = box
    ahead, aside, up = INSET / 2.0 * length, INSET / 2.0 * width, z + INSET / 2.0 * height
    down = 2.0 * z - up
    ahead_x, ahead_y = ahead * math.cos(yaw), ahead * math.sin(yaw)
    aside_x, aside_y = -aside * math.sin(yaw), aside * math.cos(yaw)
    points: list[Point] = []
    for corner_x, corner_y in (
        (x + ahead_x + aside_x, y + ahead_y + aside_y),
        (x + ahead_x - aside_x, y + ahead_y - aside_y),
        (x - ahead_x + aside_x, y - ahead_y + aside_y),
        (x - ahead_x - aside_x, y - ahead_y - aside_y),
    ):
        points.append((corner_x, corner_y, up))
        points.append((corner_x, corner_y, down))
    return [*points, (x, y, z), (x, y, up)]
