"""Identification of the ego body among received objects."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.detections import VULNERABLE, Detections
from eidrive_scenario.base.geometry import on_two_levels
from eidrive_scenario.base.tolerances import TIME_TOLERANCE
from eidrive_scenario.fusion.pairs import AssociationGate
from eidrive_scenario.fusion.tracks import pose_part
from eidrive_scenario.perception.pipeline import BODY_MARGIN, Outline, outlines, rows_on_bodies, without_rows
from eidrive_scenario.perception.tracking.association import UNASSIGNED_GATE
from eidrive_scenario.sensing.readings import NOTHING_ATTACHED, EgoState
from eidrive_scenario.v2x.messages.message import StationState
from eidrive_scenario.world.actor import ActorSpec

GATE = AssociationGate.of(0.99, 0.0)
"""Gate of the offset between a reported object and the ego body, given the covariances of both."""

VELOCITY_DEVIATION = 2.0
"""Standard deviation of a reported velocity in each axis by which objects within the gate are compared [m/s]; a choice,
between that of trackers and of first estimates."""
REPEATED = 1.0
"""Time for which a station that has reported the ego body is expected to report it again [s]: the longest interval
between two reports of an object (ETSI TS 103 324, T_GenCpmMax)."""


class BodyPose(NamedTuple):
    """Pose of the body at one time [s].

    reference  position of the reference point [m], heading [rad]
    body       outline of the body
    trailers   outlines of the trailers
    driven     length of the path of the center since the first pose [m]
    velocity   velocity of the body [m/s]
    """

    time: float
    reference: tuple[float, float, float, float]
    body: Outline
    trailers: Sequence[Outline]
    driven: float
    velocity: tuple[float, float]


class OwnBody:
    """Ego body in the recent past, and the objects of other stations that are this body."""

    def __init__(self, spec: ActorSpec, *, duration: float, dt: float) -> None:
        """Store the poses of the last `duration` seconds.

        dt  time between two poses [s]
        """
        self._spec = spec
        length, width, _ = spec.size
        self._half_size = length / 2.0 + BODY_MARGIN, width / 2.0 + BODY_MARGIN
        self._extent = 1.001 * math.hypot(*self._half_size)
        """Half the diagonal of the body [m]; infinity from the first pose with trailers on."""
        self._poses: deque[BodyPose] = deque(maxlen=math.ceil(duration / dt) + 2)
        self._vicinity = 0.0, 0.0, math.inf
        """Last center of the body, and the distance from it within which all stored outlines are [m]."""
        self._tracks: dict[str, int] = {}
        """Object id of the ego body at each station."""
        self._reported: dict[str, float] = {}
        """Time of the last report of each station that contains the ego body [s]."""

    def record(self, ego: EgoState, attached: Array = NOTHING_ATTACHED) -> None:
        """Store the pose of the body, and the boxes (K, 7) of its trailers."""
        x, y, z = ego.position.tolist()
        reference = x, y, z, ego.yaw
        cos, sin = math.cos(ego.yaw), math.sin(ego.yaw)
        ahead, aside, up = self._spec.offset
        x, y = x + cos * ahead - sin * aside, y + sin * ahead + cos * aside
        is_vulnerable = self._spec.category in VULNERABLE
        body = Outline(x, y, cos, sin, *self._half_size, z + up, self._spec.size[2], is_vulnerable)
        trailers = outlines(attached) if len(attached) else ()
        driven = 0.0
        if self._poses:
            last = self._poses[-1]
            driven = last.driven + math.hypot(x - last.body.x, y - last.body.y)
        self._poses.append(BodyPose(ego.time, reference, body, trailers, driven, (ego.speed * cos, ego.speed * sin)))
        if trailers:
            self._extent = math.inf
        self._vicinity = x, y, driven - self._poses[0].driven + self._extent

    def at(self, time: float) -> BodyPose:
        """Return the last pose up to `time` [s], or the first one."""
        for stored in reversed(self._poses):
            if stored.time <= time + TIME_TOLERANCE:
                return stored
        return self._poses[0]

    def box(self, time: float, duration: float = 0.0) -> Array:
        """Return the box (7,) that covers the outline in the last `duration` seconds up to that time.

        It has a margin that covers objects on the body.
        """
        last, first = self.at(time), self.at(time - duration)
        _, (_, _, z, yaw), (x, y, cos, sin, *_), *_ = last
        length, width, height = self._spec.size
        offsets = np.array(
            [
                (cos * (pose.body.x - x) + sin * (pose.body.y - y), cos * (pose.body.y - y) - sin * (pose.body.x - x))
                for pose in self._poses
                if first.time <= pose.time <= last.time
            ]
        )
        low, high = offsets.min(axis=0), offsets.max(axis=0)
        (ahead, left), (along, across) = (low + high) / 2.0, high - low
        x, y = x + cos * ahead - sin * left, y + sin * ahead + cos * left
        return np.array([x, y, z, length + along + BODY_MARGIN, width + across + BODY_MARGIN, 4.0 * height, yaw])

    def without(self, detections: Detections) -> Detections:
        """Return received detections without those on the ego body and its trailers, for which it must not brake.

        The boxes are compared with the ego pose at the time of measurement, so that delay has no effect.
        """
        center_x, center_y, reach = self._vicinity
        boxes = detections.boxes
        if len(boxes) == 1 and math.hypot(boxes.item(0) - center_x, boxes.item(1) - center_y) > reach:
            return detections  # a single object that is far from all stored poses
        stored = self.at(detections.time)
        return without_rows(detections, rows_on_bodies(detections, [stored.body, *stored.trailers]))

    def without_perceived(
        self,
        detections: Detections,
        station: str,
        state: StationState | None,
        own: Detections | None,
        pose_covariance: Array | None,
    ) -> Detections:
        """Return detections of another station without the ego body as that station perceives it.

        A camera measures the distance of a far vehicle with an error of several meters, so that the body can be
        reported beside the outline, and another vehicle on it. Beside the boxes on the outline, the likeliest vehicle
        within the gate, by position and velocity, is the body, unless an own detection explains it better: a station
        reports each object once. It remains the body for as long as the station tracks it.

        state            pose of the station, whose covariance adds to that of its objects
        own              newest own detections
        pose_covariance  (3, 3) of the own x, y and yaw; None: the pose is exact
        """
        stored = self.at(detections.time)
        if stored.trailers:
            detections = without_rows(detections, rows_on_bodies(detections, stored.trailers))
        inside = rows_on_bodies(detections, [stored.body])
        likeliest: int | None = None
        if not inside or not _is_precise(detections, inside[0], state, pose_covariance):
            likeliest = self._likeliest_row(detections, inside, station, state, own, pose_covariance)
        if likeliest is None and len(inside) == 1:
            likeliest = inside[0]
        if likeliest is not None or inside:
            self._reported[station] = detections.time
        if likeliest is not None and detections.tracks:
            self._tracks[station] = detections.tracks[likeliest]
        return without_rows(detections, inside if likeliest is None else {*inside, likeliest})

    def _likeliest_row(
        self,
        detections: Detections,
        inside: Sequence[int],
        station: str,
        state: StationState | None,
        own: Detections | None,
        pose_covariance: Array | None,
    ) -> int | None:
        """Return the row of the likeliest object within the gate and on the level of the body, or None.

        Own detections do not explain objects `inside` the outline, which are not kept in any case.

        The gate refers to positions only: the first velocities of a track may be wrong.
        """
        track = self._tracks.get(station)
        is_repeated = detections.time - self._reported.get(station, -math.inf) <= REPEATED
        body: Array | None = None
        best: tuple[float, int] | None = None
        for row, kind in enumerate(detections.classes):
            # A station may be reported as of its group: a roadside unit, a vulnerable road user, or a vehicle.
            category = self._spec.category
            if kind != category and (category == "misc" or (kind in VULNERABLE) is not (category in VULNERABLE)):
                continue
            if not math.isfinite(detections.covariance[row, 0, 0]):
                continue
            if body is None:
                here = self.at(detections.time)
                body, body_velocity = np.array(here.body[:2]), np.array(here.velocity)
            if on_two_levels(here.body.z, here.body.height, *detections.boxes[row, [2, 5]].tolist()):
                continue
            covariance = _position_covariance(detections, row, state)
            position = detections.boxes[row, :2]
            spread = covariance if pose_covariance is None else covariance + pose_covariance[:2, :2]
            distance, cost = _squared_mahalanobis(position - body, spread)
            is_wide = detections.tracks[row] == track if detections.tracks else is_repeated
            if distance > (UNASSIGNED_GATE if is_wide else GATE.chi_square):
                continue
            vx, vy = np.nan_to_num(detections.velocity[row] - body_velocity).tolist()
            total = cost + (vx * vx + vy * vy) / VELOCITY_DEVIATION**2
            if best is not None and total >= best[0]:
                continue
            if row in inside or not _explained(position, covariance, detections.time, cost, own):
                best = total, row
        return None if best is None else best[1]


def _position_covariance(detections: Detections, row: int, state: StationState | None) -> Array:
    """Return the covariance (2, 2) of the position of an object, with that of the pose of its station."""
    covariance: Array = detections.covariance[row]
    if state is not None and state.pose_covariance is not None:
        point = detections.boxes[row : row + 1, :2]
        covariance = covariance + pose_part(point, state.x, state.y, state.pose_covariance)[0]
    return covariance


def _is_precise(detections: Detections, row: int, state: StationState | None, pose_covariance: Array | None) -> bool:
    """Return whether errors within the gate are below the margin of the outline: the body is reported on it then."""
    variance = float(np.trace(_position_covariance(detections, row, state)))
    if pose_covariance is not None:
        variance += float(np.trace(pose_covariance[:2, :2]))
    return GATE.chi_square * variance < BODY_MARGIN**2


def _explained(position: Array, covariance: Array, time: float, cost: float, own: Detections | None) -> bool:
    """Return whether an own detection is likelier than this cost to be the object."""
    if own is None or not len(own):
        return False
    positions = own.boxes[:, :2] + np.nan_to_num(own.velocity) * (time - own.time)
    return any(
        math.isfinite(spread[0, 0]) and _squared_mahalanobis(position - other, covariance + spread)[1] <= cost
        for other, spread in zip(positions, own.covariance, strict=True)
    )


def _squared_mahalanobis(offset: Array, covariance: Array) -> tuple[float, float]:
    """Return the squared Mahalanobis distance, and the negative log-likelihood of the offset without constants."""
    (xx, xy), (_, yy) = covariance.tolist()
    x, y = offset.tolist()
    determinant = xx * yy - xy * xy
    if determinant <= 0.0:
        return math.inf, math.inf
    distance = (yy * x * x - 2.0 * xy * x * y + xx * y * y) / determinant
    return distance, distance + math.log(determinant)
