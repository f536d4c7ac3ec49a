"""Perception pipeline of a station: localization, detector, latency and tracker."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

from eidrive_scenario.arrays import Array
from eidrive_scenario.detections import Detections
from eidrive_scenario.errors import InvalidResult
from eidrive_scenario.perception.detector import Detector
from eidrive_scenario.perception.faults import FalseObject, PoseError, with_false_objects, with_pose_error
from eidrive_scenario.perception.localization import PLANE, Localizer
from eidrive_scenario.perception.own_bodies import outlines, rows_on_bodies, without_rows
from eidrive_scenario.perception.pose_noise import PoseNoiseProcess
from eidrive_scenario.perception.result_checks import check_detections, check_in_view, describe, is_checked
from eidrive_scenario.perception.tracking.method import TrackingMethod
from eidrive_scenario.registry import is_built_in
from eidrive_scenario.sensing.readings import FIELDS, Readings, SignalReading
from eidrive_scenario.tolerances import TIME_TOLERANCE


class Perception:
    """Perception of one station.

    latency    computing time of the detector [s]: detections of time t are available from t + latency on; readings that
               arrive meanwhile are processed concurrently, each with the same latency
    tracker    None if detections are passed on unchanged
    localizer  None if the station has its true pose
    pose_error     constant error of the pose, in addition to that of the localizer
    pose_noise     random error of the pose, in addition to both
    false_objects  objects that the detector reports, and that do not exist
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
    ) -> None:
        self.detector = detector
        self._checked = is_checked(detector)
        self._tracker = tracker
        self._tracker_checked = tracker is not None and not is_built_in(type(tracker))
        self._localizer = localizer
        self._latency = latency
        self._pose_error = pose_error
        self._pose_noise = pose_noise
        self._false_objects = false_objects
        self._computing: deque[tuple[float, Detections, Readings]] = deque()

    @property
    def pose_covariance(self) -> Array | None:
        """Covariance (3, 3) of the estimated x, y and yaw of the station; None if its pose is exact.

        The covariances of its objects do not contain it: it is common to all objects, and tracking does not reduce it.
        """
        estimated = None if self._localizer is None else self._localizer.estimate.covariance[PLANE]
        if self._pose_noise is None:
            return estimated
        noise = self._pose_noise.covariance
        return noise if estimated is None else estimated + noise

    def locate(self, readings: Readings) -> Readings:
        """Return the readings with the pose that the station assumes: estimated by its localizer, with its error."""
        if self._localizer is not None:
            readings = self._localizer.with_estimated_pose(readings)
        if self._pose_error is not None:
            readings = with_pose_error(readings, self._pose_error)
        return readings if self._pose_noise is None else self._pose_noise.displaced(readings)

    @property
    def has_exact_pose(self) -> bool:
        """Whether the assumed pose is the true one."""
        return self._localizer is None and self._pose_error is None and self._pose_noise is None

    def signals(self, readings: Readings) -> Sequence[SignalReading]:
        """Return the signals in sight: those that the detector reads, and those of the signal sensor."""
        found = self.detector.signals()
        if not isinstance(found, Sequence):
            raise InvalidResult(self.detector, "signals", f"returned {describe(found)} (expected SignalReadings)")
        return (*found, *readings.signals)

    def perceive(self, readings: Readings) -> Detections | None:
        """Return the newest objects that become available now, or None if there is nothing new.

        A tracker predicts the objects to the time of each tick minus the latency. So stations do not report the
        positions of the last reading. The latency applies to all objects.
        """
        now = readings.time
        if _has_all(readings, self.detector.needs):
            found = self.detector.detect(readings)
            if self._checked:
                check_detections(self.detector, "detect", found)
            if len(readings.attached):
                found = without_rows(found, rows_on_bodies(found, outlines(readings.attached)))
            if self._false_objects:
                found = with_false_objects(found, self._false_objects, with_velocity=self.detector.provides_velocity)
            if self._latency <= 0.0 and not self._computing:
                return self._track(found, readings)
            self._computing.append((now + self._latency, found, readings))
        newest = None
        while self._computing and self._computing[0][0] <= now + TIME_TOLERANCE:
            _, found, past = self._computing.popleft()
            newest = self._track(found, past)
        if newest is None and self._tracker is not None:
            self._set_pose(readings)
            newest = self._tracker.predict(now - self._latency)
            if self._tracker_checked and newest is not None:
                check_detections(self._tracker, "predict", newest)
        return newest

    def _set_pose(self, readings: Readings) -> None:
        if self._tracker is not None and self._pose_noise is not None:
            self._tracker.set_pose(self._pose_noise.uncertainty(readings))

    def _track(self, found: Detections, readings: Readings) -> Detections:
        if self._tracker is None:
            return found
        self._set_pose(readings)

        def in_view(boxes: Array) -> Array:
            shares = self.detector.in_view(boxes, readings, found)
            check_in_view(self.detector, shares, len(boxes))
            return shares

        tracked = self._tracker.update(found, in_view)
        if self._tracker_checked:
            check_detections(self._tracker, "update", tracked)
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
