"""Perception pipeline of a station: localization, detector, latency and tracker."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from msgspec.structs import replace

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.detections import VULNERABLE, Detections
from eidrive_scenario.base.geometry import on_two_levels
from eidrive_scenario.base.tolerances import TIME_TOLERANCE
from eidrive_scenario.errors import InvalidResult
from eidrive_scenario.perception.detector import Detector
from eidrive_scenario.perception.faults import FalseObject, PoseError, with_false_objects
from eidrive_scenario.perception.localization import Localizer, PoseNoiseProcess, add_pose_error
from eidrive_scenario.perception.result_checks import (
    ROUNDING,
    check_array,
    checked_detections,
    describe,
    is_checked,
    raise_outside,
)
from eidrive_scenario.perception.tracking.method import TrackingMethod
from eidrive_scenario.perception.tracking.motion_models import KNOWN_SPEED
from eidrive_scenario.perception.tracking.uncertain_pose import PoseErrors, PoseUncertainty
from eidrive_scenario.sensing.readings import FIELDS, Readings, SignalReading

BODY_MARGIN = 0.9
"""Maximum distance of a detected box center from the outline of a body at which the box shows this body [m]. It is half
the width of a car: the center of another car is closer only after a collision. That of a pedestrian may be."""


class Outline(NamedTuple):
    """Outline of a body with the margin: center [m], cosine and sine of its heading, half length and half width, height
    of the center and of the body [m], and whether it is a vulnerable road user."""

    x: float
    y: float
    cos: float
    sin: float
    half_length: float
    half_width: float
    z: float
    height: float
    is_vulnerable: bool = False


def outlines(bodies: Array) -> list[Outline]:
    """Return the outlines of bodies (K, 7)."""
    return [
        Outline(x, y, math.cos(yaw), math.sin(yaw), length / 2.0 + BODY_MARGIN, width / 2.0 + BODY_MARGIN, z, height)
        for x, y, z, length, width, height, yaw in bodies.tolist()
    ]


def rows_on_bodies(detections: Detections, bodies: Sequence[Outline]) -> list[int]:
    """Return the rows of the detections whose centers are on bodies on their level, or within the margin of them.

    Vulnerable road users within the margin are others, unless the body is one.
    """
    rows = []
    for row, (bx, by, bz, _, _, tall, _) in enumerate(detections.boxes.tolist()):
        is_vulnerable = detections.classes[row] in VULNERABLE
        for x, y, cos, sin, half_length, half_width, z, height, is_alike in bodies:
            ahead, left = cos * (bx - x) + sin * (by - y), cos * (by - y) - sin * (bx - x)
            beyond = max(abs(ahead) - half_length, abs(left) - half_width)
            limit = -BODY_MARGIN if is_vulnerable and not is_alike else 0.0
            if beyond <= limit and not on_two_levels(z, height, bz, tall):
                rows.append(row)
                break
    return rows


def without_rows(detections: Detections, rows: Iterable[int]) -> Detections:
    """Return the detections without these rows."""
    removed = set(rows)
    if not removed:
        return detections
    return detections.subset([row for row in range(len(detections)) if row not in removed])


class Perception:
    """Perception of one station.

    latency    computing time of the detector [s]: detections of time t are available from t + latency on; readings that
               arrive meanwhile are processed concurrently, each with the same latency
    tracker    None if detections are passed on unchanged
    localizer  None if the station has its true pose
    pose_error     constant error of the pose, in addition to that of the localizer
    pose_noise     random error of the pose, in addition to both
    false_objects  objects that the detector reports, and that do not exist
    first_track    added to the numbers of the tracker, which a station that returns must not repeat
    """

    def __init__(
        self,
        detector: Detector,
        *,
        tracker: TrackingMethod | None = None,
        localizer: Localizer | None = None,
        latency: float = 0.0,
        pose_error: PoseError | None = None,
        pose_noise: PoseNoiseProcess | None = None,
        false_objects: Sequence[FalseObject] = (),
        first_track: int = 0,
    ) -> None:
        self.detector = detector
        self._checked = is_checked(detector)
        self._tracker = tracker
        if tracker is not None:
            tracker.setup(detector.velocity_deviation or KNOWN_SPEED)
        self._localizer = localizer
        self._latency = latency
        self._pose_error = pose_error
        self._pose_noise = pose_noise
        self._false_objects = false_objects
        self._first_track = first_track
        self.next_track = first_track
        """Lowest number above those of all tracks."""
        self._pose_sources = [source for source in (localizer, pose_noise) if source is not None]
        """Independent random errors of the pose."""
        self._pose_errors = PoseErrors()
        self.pose: PoseUncertainty | None = None
        """Uncertainty of the pose that `locate` returned last; None: it is exact."""
        self.measured = -math.inf
        """Time of the last readings whose objects are available [s]; later objects are predictions of the tracker."""
        self._computing: deque[tuple[float, Detections, Readings]] = deque()

    @property
    def pose_covariance(self) -> Array | None:
        """Covariance (3, 3) of the estimated x, y and yaw of the station; None if its pose is exact.

        The covariances of its objects do not contain it: it is common to all objects, and tracking does not reduce it.
        """
        if not self._pose_sources:
            return None
        return sum((source.pose_covariance for source in self._pose_sources), np.zeros((3, 3)))

    def locate(self, readings: Readings) -> Readings:
        """Return the readings with the pose that the station assumes: estimated by its localizer, with its error."""
        if self._localizer is not None:
            readings = self._localizer.with_estimated_pose(readings)
        if self._pose_error is not None:
            error = self._pose_error
            readings = add_pose_error(readings, error.x, error.y, math.radians(error.yaw))
        if self._pose_noise is not None:
            readings = add_pose_error(readings, *self._pose_noise.error(readings.time).tolist())
        if (covariance := self.pose_covariance) is not None:
            x, y, _ = readings.ego.position.tolist()
            lagged = sum((source.lagged_covariance for source in self._pose_sources), np.zeros((3, 3)))
            before = np.linalg.pinv(self._pose_errors.last_covariance, hermitian=True)
            self.pose = PoseUncertainty(readings.time, x, y, covariance, lagged @ before)
            self._pose_errors.add(self.pose)
            self.set_pose(self.pose)
        return readings

    def set_pose(self, pose: PoseUncertainty) -> None:
        """Pass the uncertainty of the assumed pose in a time step to the tracker."""
        if self._tracker is not None:
            self._tracker.set_pose(pose)

    def pose_change(self, time: float) -> Array | None:
        """Return the covariance (3, 3) of the change of the pose error since the last call, until `time` [s].

        By this the positions of all objects relative to the assumed pose change together. None: the pose is exact.
        """
        if not self._pose_sources:
            return None
        return self._pose_errors.advance(time)

    @property
    def has_exact_pose(self) -> bool:
        """Whether the assumed pose is the true one."""
        return self._localizer is None and self._pose_error is None and self._pose_noise is None

    def signals(self, readings: Readings) -> Sequence[SignalReading]:
        """Return the signals in sight: those that the detector reads, and those of the signal sensor."""
        signals = self.detector.signals()
        if not isinstance(signals, Sequence):
            raise InvalidResult(self.detector, "signals", f"returned {describe(signals)} (expected SignalReadings)")
        return (*signals, *readings.signals)

    def perceive(self, readings: Readings) -> Detections | None:
        """Return the newest objects that become available now, or None if there is nothing new.

        A tracker predicts the objects to the time of each tick minus the latency. So stations do not report the
        positions of the last reading. The latency applies to all objects.
        """
        now = readings.time
        if _has_all(readings, self.detector.needs):
            detections = self.detector.detect(readings)
            if self._checked:
                detections = checked_detections(self.detector, "detect", detections, now=now)
            if len(readings.attached):
                detections = without_rows(detections, rows_on_bodies(detections, outlines(readings.attached)))
            if self._false_objects:
                detections = with_false_objects(
                    detections, self._false_objects, with_velocity=self.detector.provides_velocity
                )
            detections.freeze()
            if self._latency <= 0.0 and not self._computing:
                return self._track(detections, readings)
            self._computing.append((now + self._latency, detections, readings))
        newest = None
        while self._computing and self._computing[0][0] <= now + TIME_TOLERANCE:
            _, detections, past = self._computing.popleft()
            newest = self._track(detections, past)
        if newest is None and self._tracker is not None:
            newest = self._tracker.predict(now - self._latency)
            if newest is not None:
                newest = self._numbered(checked_detections(self._tracker, "predict", newest, now=now))
        return newest

    def _track(self, detections: Detections, readings: Readings) -> Detections:
        self.measured = readings.time
        if self._tracker is None:
            if self.detector.velocity_deviation is None:
                return detections
            return replace(detections, velocity_deviation=self.detector.velocity_deviation)

        def in_view(boxes: Array) -> Array:
            shares = self.detector.in_view(boxes, readings, detections)
            check_array(self.detector, "in_view", "shares", shares, (len(boxes),))
            raise_outside(self.detector, "in_view", "shares", shares, 0.0, 1.0, ROUNDING)
            return shares

        tracked = self._tracker.update(detections, in_view)
        return self._numbered(checked_detections(self._tracker, "update", tracked, now=readings.time))

    def _numbered(self, tracked: Detections) -> Detections:
        """Return objects of the tracker with numbers that are unique for the station."""
        if self._first_track:
            tracked = replace(tracked, tracks=tuple([self._first_track + number for number in tracked.tracks]))
        self.next_track = max(self.next_track, 1 + max(tracked.tracks, default=-1))
        return tracked


def _has_all(readings: Readings, kinds: frozenset[str]) -> bool:
    """Return whether there are readings of all these kinds of sensors."""
    return (
        ("truth" not in kinds or readings.truth is not None)
        and ("camera" not in kinds or bool(readings.cameras))
        and ("lidar" not in kinds or bool(readings.lidars))
        and ("gnss" not in kinds or readings.gnss is not None)
        and ("imu" not in kinds or readings.imu is not None)
        and (kinds <= FIELDS or all(readings.others.get(kind) for kind in kinds - FIELDS))
    )
