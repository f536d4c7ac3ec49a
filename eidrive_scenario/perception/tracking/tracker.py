"""Multi-object tracking: association of detections over time, with positions and velocities."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Array, Bools
from eidrive_scenario.base.detections import VULNERABLE, Detections
from eidrive_scenario.base.geometry import iou_bev, on_two_levels, wrap_angle
from eidrive_scenario.base.tolerances import TIME_TOLERANCE
from eidrive_scenario.perception.tracking.association import (
    MOST,
    associate,
    detected,
    likelihood_ratio,
    make_plausible,
    missed,
    squared_mahalanobis,
    survived,
)
from eidrive_scenario.perception.tracking.interacting_models import SIGNIFICANT, InteractingModels, Tracks
from eidrive_scenario.perception.tracking.method import NO_TRACKER, TrackerKind, TrackerSettings, TrackingMethod
from eidrive_scenario.perception.tracking.motion_models import (
    KNOWN_SPEED,
    ConstantVelocity,
    Estimates,
    MovingModel,
    TurnRate,
)
from eidrive_scenario.perception.tracking.uncertain_pose import PoseErrors, PoseUncertainty


@dataclass(slots=True, eq=False)
class TrackHistory:
    """Detection history of one track.

    is_often_detected  whether the object was detected in n of m successive scans
    number             track number once the track is confirmed
    score              of the last detection
    parts              number of detections whose box was a part of the object
    """

    is_often_detected: bool = False
    number: int | None = None
    hits: int = 0
    parts: int = 0
    score: float = 0.0
    _recent: list[bool] = field(default_factory=list)
    _names: dict[str, float] = field(default_factory=dict)
    _last_detection: float = -math.inf

    @property
    def name(self) -> str:
        """Class with the largest sum of detection scores."""
        return max(self._names, key=lambda name: self._names[name])

    def record_scan(self, hit: bool, settings: TrackerSettings) -> None:
        """Record whether the scan, which could show the object, contained a detection of it."""
        self.hits += hit
        if not self.is_often_detected:
            self._recent = [*self._recent, hit][-settings.confirm[1] :]
            self.is_often_detected = sum(self._recent) >= settings.confirm[0]

    def record_detection(self, detections: Detections, column: int) -> None:
        """Record the detection that is assigned to the object."""
        self._last_detection = detections.time
        self.score = float(detections.scores[column])
        name = detections.classes[column]
        self._names[name] = self._names.get(name, 0.0) + self.score

    def is_alive(self, now: float, settings: TrackerSettings) -> bool:
        """Return whether the track is kept."""
        if now - self._last_detection > settings.coast + TIME_TOLERANCE:
            return False
        return self.is_often_detected or self._recent.count(False) <= settings.confirm[1] - settings.confirm[0]


MODELS: Mapping[str, type[MovingModel]] = {"cv": ConstantVelocity, "ctrv": TurnRate}

ACROSS = math.cos(math.pi / 4.0)
"""Cosine of the angle between two axes from which on one is across the other."""
PART = 0.5
"""Share of the length of a track below which a box shows a part of the object."""
LARGEST_OVERLAP = 0.1
"""Maximum overlap of two bodies (intersection over union) by errors of their boxes: 0.8 m of two cars in a row."""
SETTLED = 6
"""Number of detections of a track from which on its velocity counts whatever its uncertainty: half a second."""
SLOW = frozenset({"pedestrian", "bicycle"})
"""Classes whose velocity counts from the first detections: they are slow, and set off at once. Motorbikes are as fast
as cars, and partly visible cars resemble them."""
SMOOTHING = 0.2
"""Weight of a new box in the size, height and heading of an object with many detections."""


class Tracker(TrackingMethod):
    """Multi-object tracker: one Kalman filter per object, gated global nearest neighbors, and track management.

    The assignment of tracks and boxes maximizes the total likelihood (Hungarian method). Each pair has a squared
    Mahalanobis distance within the gate of the chi-square distribution (Bar-Shalom and Li, Multitarget-multisensor
    tracking, 1995, section 2.3.2). An unassigned box initiates a track, which is reported after confirmation. Each
    track has a probability of existence (`perception.tracking.association`). The reported score of an object is that of
    its last detection times this probability.
    """

    settings_type: ClassVar[type[TrackerKind]] = TrackerSettings
    settings: TrackerSettings

    def __init__(self, settings: TrackerSettings) -> None:
        super().__init__(settings)
        if settings.kind == NO_TRACKER:
            raise ValueError("tracker settings: kind 'none' disables tracking (expected cv or ctrv)")
        self._pose_errors: PoseErrors | None = None
        self._velocity_deviation = KNOWN_SPEED
        self._filter = self._new_filter()
        self._gate = -2.0 * math.log1p(-settings.gate)
        self._time: float | None = None
        self._tracks = self._filter.no_tracks()
        self._shape = np.empty((0, 5))
        """z, length, width, height and yaw (N, 5)."""
        self._existence = np.empty(0)
        self._histories: list[TrackHistory] = []
        self._confirmed = 0

    def setup(self, velocity_deviation: float) -> None:
        self._velocity_deviation = velocity_deviation
        self._filter = self._new_filter()

    def _new_filter(self) -> InteractingModels:
        return InteractingModels(MODELS[self.settings.kind](self._velocity_deviation), self._pose_errors)

    def set_pose(self, pose: PoseUncertainty) -> None:
        if self._pose_errors is None and self._time is None:
            self._pose_errors = PoseErrors()
            self._filter = self._new_filter()
            self._tracks = self._filter.no_tracks()
        if self._pose_errors is not None:
            self._pose_errors.add(pose)

    def update(self, detections: Detections, in_view: Callable[[Array], Array] | None = None) -> Detections:
        """Return the confirmed objects at the time of these detections, with velocities, covariances and track numbers.

        in_view  returns the share (N,) in [0, 1] of boxes (N, 7) that the sensors can show; None: all of them.
                 An object out of view is not expected to be detected.

        Raise ValueError if the detections are older than those of the last call.
        """
        step = 0.0 if self._time is None else detections.time - self._time
        if step < 0.0:
            raise ValueError(
                f"detections are out of sequence (got {detections.time} s; expected at least {self._time} s)"
            )
        self._time = detections.time
        if step > 0.0 and self._histories:
            self._tracks = self._filter.predict(self._tracks, step)
            self._existence = survived(self._existence, step, self.settings.lifetime)
        if self._pose_errors is not None:
            self._pose_errors.advance(detections.time)
        stated = detections.covariance.copy()
        make_plausible(stated)
        noise = stated.copy()
        confirmed = np.array([history.number is not None for history in self._histories], dtype=bool)
        expected = self._filter.combined(self._tracks)
        boxes, shape = detections.boxes, self._shape
        apart = on_two_levels(shape[:, :1], shape[:, 3:4], boxes[:, 2], boxes[:, 5])
        rows, columns = associate(expected, confirmed, apart, boxes, noise, self._gate)
        unassigned = np.setdiff1d(np.arange(len(detections)), columns)
        on_bodies = self._boxes_on_bodies(expected, confirmed, apart, rows, unassigned, boxes, noise)
        for column, row in on_bodies.items():
            if row not in rows:
                rows.append(row)
                columns.append(column)
                # It says that the object is there, and little about its place: as much as a box at the limit of the
                # gate. If it said nothing, a track that falls behind its object would stay there.
                offset = boxes[column, :2] - expected.state[row, :2]
                squared = float(squared_mahalanobis(offset, expected.covariance[row, :2, :2] + noise[column])[0])
                noise[column] += (1.0 / self._gate - 1.0 / max(squared, self._gate)) * np.outer(offset, offset)
        hit = set(rows)
        share = self._update_existence(expected, rows, detections, columns, noise, in_view)
        if rows:
            self._tracks = self._filter.add_common_errors(self._tracks, rows, stated[columns])
            self._correct(rows, detections, columns, noise)
        for row in np.flatnonzero(share > 0.0).tolist():
            self._histories[row].record_scan(row in hit, self.settings)
        for row, column in zip(rows, columns, strict=True):
            self._histories[row].record_detection(detections, column)
        self._initiate(detections, [column for column in unassigned.tolist() if column not in on_bodies], noise)
        # Tracks are deleted that cannot be confirmed any more, hardly exist, or have coasted for too long.
        kept = [
            row
            for row, (history, existence) in enumerate(zip(self._histories, self._existence.tolist(), strict=True))
            if existence >= self.settings.delete_existence and history.is_alive(detections.time, self.settings)
        ]
        if len(kept) < len(self._histories):
            self._tracks, self._shape = self._tracks.take(kept), self._shape[kept]
            self._existence, self._histories = self._existence[kept], [self._histories[row] for row in kept]
        # Road users on foot and on two wheels set off at any time: that they stand must not be concluded.
        vulnerable = [row for row, history in enumerate(self._histories) if history.name in VULNERABLE]
        self._tracks.probability[:, vulnerable] = np.array([[0.0], [1.0]])
        for history, existence in zip(self._histories, self._existence.tolist(), strict=True):
            if history.number is None and history.is_often_detected and existence >= self.settings.confirm_existence:
                self._confirmed += 1
                history.number = self._confirmed
        shown = [row for row, history in enumerate(self._histories) if history.number is not None]
        return self._report(detections.time, shown, self._tracks.take(shown), self._existence[shown])

    def _boxes_on_bodies(
        self,
        expected: Estimates,
        confirmed: Bools,
        apart: Bools,
        detected: list[int],
        columns: NDArray[np.intp],
        boxes: Array,
        noise: Array,
    ) -> dict[int, int]:
        """Return which of the boxes in `columns` overlap with the body of a confirmed track, with its row.

        Of several bodies it is one with a detected box, or else the one in which the box is nearest to the middle,
        relative to its size. The boxes are in this order.

        apart  (N, M) whether track and box are on two levels

        Two bodies cannot overlap, so that they show this object: a part of it, or all of it outside the gate. A body
        without a detected box may be beside its place, by the error of its position relative to the box.
        """
        tracks = np.flatnonzero(confirmed)
        if not len(columns) or not len(tracks):
            return {}
        bodies = self._boxes(tracks, expected.state[tracks])
        offset = boxes[columns, :2] - bodies[:, None, :2]
        axes = _axes(bodies[:, 6])
        spread = expected.covariance[tracks, None, :2, :2] + noise[columns]
        deviation = np.sqrt(np.einsum("tai,tbij,taj->tba", axes, spread, axes))
        is_detected = np.isin(tracks, detected)
        deviation[is_detected] = 0.0
        half = bodies[:, None, 3:5] / 2.0
        offset = np.abs(np.einsum("tai,tbi->tba", axes, offset))
        on_body = np.all(offset < half + SIGNIFICANT * deviation, axis=-1)
        on_body |= iou_bev(bodies, boxes[columns]) > LARGEST_OVERLAP
        on_body &= ~apart[np.ix_(tracks, columns)]
        bodies_on, boxes_on = np.nonzero(on_body)
        order = np.lexsort([(offset / half).max(axis=-1)[on_body], ~is_detected[bodies_on]])
        row_of: dict[int, int] = {}
        for row, column in zip(tracks[bodies_on[order]].tolist(), columns[boxes_on[order]].tolist(), strict=True):
            row_of.setdefault(column, row)
        return row_of

    def _update_existence(
        self,
        expected: Estimates,
        rows: list[int],
        detections: Detections,
        columns: list[int],
        noise: Array,
        in_view: Callable[[Array], Array] | None,
    ) -> Array:
        """Update the existence of all tracks; those in `rows` are detected.

        Return the shares (N,) of the objects in view; those of detected ones are 1.
        """
        settings = self.settings
        share = np.ones(len(self._histories))
        if rows:
            offset = detections.boxes[columns, :2] - expected.state[rows, :2]
            spread = expected.covariance[rows][:, :2, :2] + noise[columns]
            determinant = spread[:, 0, 0] * spread[:, 1, 1] - spread[:, 0, 1] ** 2
            squared = np.einsum("ni,nij,nj->n", offset, np.linalg.inv(spread), offset)
            ratio = likelihood_ratio(
                squared,
                determinant,
                detections.scores[columns],
                settings.detection_probability,
                settings.birth_density,
            )
            self._existence[rows] = detected(self._existence[rows], ratio)
        lost = np.setdiff1d(np.arange(len(self._histories)), rows)
        if len(lost):
            if in_view is not None:
                share[lost] = np.clip(in_view(self._boxes(lost, expected.state[lost])), 0.0, 1.0)
            self._existence[lost] = missed(self._existence[lost], settings.detection_probability * share[lost])
        return share

    def _boxes(self, rows: NDArray[np.intp] | list[int], state: Array) -> Array:
        """Return boxes (N, 7) of these tracks with these states (N, D)."""
        shape = self._shape[rows]
        return np.concatenate([state[:, :2], shape[:, :4], wrap_angle(shape[:, 4:])], axis=1)

    def _correct(self, rows: list[int], detections: Detections, columns: list[int], noise: Array) -> None:
        boxes = detections.boxes[columns]
        shape = self._shape[rows]
        confirmed = np.array([self._histories[row].number is not None for row in rows], dtype=bool)
        is_part = confirmed & (boxes[:, 3] < PART * shape[:, 1])
        for number in np.flatnonzero(is_part).tolist():
            history = self._histories[rows[number]]
            history.parts += 1
            # If most boxes are so short, the first ones were too long: those of distant objects rest on few points.
            is_part[number] = 2 * history.parts <= history.hits + 1
        noise = noise[columns] + _extent_noise(shape, boxes)
        self._tracks = self._filter.share_pose_change(self._tracks, rows, boxes, noise)
        tracks = self._filter.update(self._tracks.take(rows), boxes, noise)
        self._tracks.put(rows, tracks)
        share = np.array([max(SMOOTHING, 1.0 / (self._histories[row].hits + 1.0)) for row in rows])
        of_size = np.where(is_part, 0.0, share)
        shape[:, :4] += of_size[:, None] * (boxes[:, 2:6] - shape[:, :4])
        shape[:, 4] = self._headings(shape[:, 4], boxes[:, 6], self._filter.course(tracks), of_size)
        self._shape[rows] = shape

    def _headings(self, held: Array, measured: Array, course: Array, share: Array) -> Array:
        """Return headings (N,): the axis of the boxes, with the front in the direction of motion, NaN if unknown, or
        else unchanged."""
        course = np.where(np.isnan(course), held, course)
        turned = np.where(np.cos(measured - course) < 0.0, measured + math.pi, measured)
        # A velocity across the axis says nothing about the front.
        held = np.where(np.cos(held - course) < -ACROSS, held + math.pi, held)
        # An axis across the course is the other axis of the box: the L-shape fit mistook the width for the length.
        turned = np.where(np.cos(turned - course) < ACROSS, held, turned)
        return np.asarray(held + share * ((turned - held + math.pi) % (2.0 * math.pi) - math.pi))

    def _initiate(self, detections: Detections, columns: list[int], noise: Array) -> None:
        if not columns:
            return
        boxes = detections.boxes[columns]
        self._tracks = self._tracks.join(self._filter.begin(boxes, detections.velocity[columns], noise[columns]))
        self._shape = np.concatenate([self._shape, boxes[:, 2:7]])
        self._existence = np.concatenate([self._existence, np.clip(detections.scores[columns], 0.0, MOST)])
        for column in columns:
            history = TrackHistory()
            history.record_scan(True, self.settings)
            history.record_detection(detections, column)
            self._histories.append(history)

    def predict(self, time: float) -> Detections | None:
        """Return the confirmed objects predicted to a time [s] after the last detections.

        None before the first detections, and more than `coast` after the last ones.
        """
        if self._time is None or not 0.0 <= time - self._time <= self.settings.coast + TIME_TOLERANCE:
            return None
        step = time - self._time
        shown = [
            row
            for row, history in enumerate(self._histories)
            if history.number is not None and history.is_alive(time, self.settings)
        ]
        tracks = self._tracks.take(shown)
        if shown and step > 0.0:
            tracks = self._filter.predict(tracks, step)
        return self._report(time, shown, tracks, survived(self._existence[shown], step, self.settings.lifetime))

    def _report(self, time: float, rows: list[int], tracks: Tracks, existence: Array) -> Detections:
        histories = [self._histories[row] for row in rows]
        state, covariance = self._filter.combined(tracks)
        recent = np.array([history.hits < SETTLED and history.name not in SLOW for history in histories], dtype=bool)
        velocity = self._filter.velocity(tracks, recent, _axes(self._shape[rows, 4])[:, 1])
        return Detections(
            time,
            self._boxes(rows, state),
            np.array([history.score for history in histories]) * existence,
            tuple([history.name for history in histories]),
            velocity,
            covariance[:, :2, :2],
            tuple([history.number or 0 for history in histories]),
            existence,
            velocity_variance=self._filter.velocity_variance(tracks, velocity, recent),
        )


def _extent_noise(shape: Array, boxes: Array) -> Array:
    """Return the covariance (N, 2, 2) of centers of boxes (N, 7) that show another extent than their tracks [m²].

    The same visible corner belongs to both: along each axis of the track, the centers differ by half the difference of
    the extents.
    """
    is_across = np.abs(np.cos(boxes[:, 6] - shape[:, 4])) < ACROSS
    extent = np.where(is_across[:, None], boxes[:, [4, 3]], boxes[:, 3:5])
    axes = _axes(shape[:, 4])
    return np.asarray(np.einsum("nai,na,nak->nik", axes, np.square(shape[:, 1:3] - extent) / 4.0, axes))


def _axes(yaw: Array) -> Array:
    """Return the directions (N, 2, 2) along and across bodies with headings (N,)."""
    cos, sin = np.cos(yaw), np.sin(yaw)
    return np.stack([np.stack([cos, sin], -1), np.stack([-sin, cos], -1)], -2)
