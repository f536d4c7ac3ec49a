"""From the readings of a station to the objects that it knows of: detector, its latency, tracker."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

from eidrive_scenario.arrays import Array
from eidrive_scenario.detections import Detections
from eidrive_scenario.errors import InvalidResult
from eidrive_scenario.perception.detector import Detector
from eidrive_scenario.perception.localization import PLANE, Localizer
from eidrive_scenario.perception.result_checks import check_detections, check_in_view, describe, is_checked
from eidrive_scenario.perception.tracking.tracker import Tracker
from eidrive_scenario.sensing.readings import Readings, SignalReading
from eidrive_scenario.tolerances import TIME_TOLERANCE


class Perception:
    """What one station makes of its sensors.

    latency    how long the detector computes: what it saw at t is known from t + latency on; readings that come
               meanwhile are worked on beside each other, each as long [s]
    tracker    None where the boxes are passed on as they are
    localizer  None where the station knows where it is
    """

    def __init__(
        self,
        detector: Detector,
        *,
        tracker: Tracker | None = None,
        localizer: Localizer | None = None,
        latency: float = 0.0,
    ) -> None:
        self.detector = detector
        self._checked = is_checked(detector)
        self._tracker = tracker
        self._localizer = localizer
        self._latency = latency
        self._computing: deque[tuple[float, Detections, Readings]] = deque()

    @property
    def pose_covariance(self) -> Array | None:
        """(3, 3) of the own x, y and yaw as the station estimates them; None where it knows them exactly.

        The covariances of its objects do not contain it: it is common to all of them, and tracking does not lessen it.
        """
        return None if self._localizer is None else self._localizer.estimate.covariance[PLANE]

    def locate(self, readings: Readings) -> Readings:
        """The readings as the station can know them, if it has to find out by itself where it is."""
        return readings if self._localizer is None else self._localizer.with_estimated_pose(readings)

    def signals(self, readings: Readings) -> Sequence[SignalReading]:
        """The traffic lights and stop signs in sight: those that the detector reads, and the lookout's."""
        found = self.detector.signals()
        if not isinstance(found, Sequence):
            raise InvalidResult(self.detector, "signals", f"returned {describe(found)} (expected SignalReadings)")
        return (*found, *readings.signals)

    def perceive(self, readings: Readings) -> Detections | None:
        """The newest objects that become known now; None if there is nothing new.

        A tracker predicts them to the time of each tick, so that stations do not report where objects were when the
        sensors were last read; less the latency, which is that of all that becomes known.
        """
        now = readings.time
        if _has_all(readings, self.detector.needs):
            found = self.detector.detect(readings)
            if self._checked:
                check_detections(self.detector, "detect", found)
            if self._latency <= 0.0 and not self._computing:
                return self._tracked(found, readings)
            self._computing.append((now + self._latency, found, readings))
        newest = None
        while self._computing and self._computing[0][0] <= now + TIME_TOLERANCE:
            _, found, seen = self._computing.popleft()
            newest = self._tracked(found, seen)
        if newest is None and self._tracker is not None:
            newest = self._tracker.predicted(now - self._latency)
        return newest

    def _tracked(self, found: Detections, readings: Readings) -> Detections:
        if self._tracker is None:
            return found

        def in_view(boxes: Array) -> Array:
            shares = self.detector.in_view(boxes, readings, found)
            check_in_view(self.detector, shares, len(boxes))
            return shares

        return self._tracker.update(found, in_view)


def _has_all(readings: Readings, kinds: frozenset[str]) -> bool:
    """Whether a sensor of each of these kinds was due."""
    return (
        ("truth" not in kinds or readings.truth is not None)
        and ("camera" not in kinds or bool(readings.cameras))
        and ("lidar" not in kinds or bool(readings.lidars))
    )
