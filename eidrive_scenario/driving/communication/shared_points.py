"""Sharing of lidar points: received point clouds, and detection in merged points."""

from __future__ import annotations

from eidrive_scenario.arrays import Array
from eidrive_scenario.detections import Detections
from eidrive_scenario.fusion.method import FusionMethod
from eidrive_scenario.geometry import points_in_box
from eidrive_scenario.perception.pipeline import Perception
from eidrive_scenario.perception.tracking.uncertain_pose import PoseUncertainty
from eidrive_scenario.sensing.readings import Readings
from eidrive_scenario.tolerances import TIME_TOLERANCE
from eidrive_scenario.v2x.messages.point_cloud import PointCloud


class PointCloudSharing:
    """Received point clouds, and detection in them together with the points of the station.

    perception   separate instance for the merged points, as detectors and trackers have state; None for a station that
                 does not receive messages
    """

    def __init__(self, fusion: FusionMethod, perception: Perception | None) -> None:
        self.own: PointCloud | None = None
        """Newest points of this station, as transmitted."""
        self._fusion = fusion
        self._perception = perception
        self._received: dict[str, tuple[float, Array]] = {}

    def add_points(self, sender: str, cloud: PointCloud, body: Array) -> None:
        """Store a received cloud without points on the ego body (7,) at the time of measurement.

        An out-of-sequence cloud does not replace a newer one.
        """
        held = self._received.get(sender)
        if held is None or cloud.time >= held[0]:
            points = cloud.points()
            self._received[sender] = (cloud.time, points[~points_in_box(points, body)])

    def perceive(self, readings: Readings, alone: Detections | None, pose: PoseUncertainty | None) -> Detections | None:
        """Return newly available objects in merged points, or None.

        alone  objects in the ego points;  pose  uncertainty of the assumed pose; None: it is exact
        """
        self.own = self._fusion.shared_cloud(readings) or self.own
        if self._perception is None:
            return alone
        if pose is not None:
            self._perception.set_pose(pose)
        oldest = readings.time - self._fusion.max_point_age - TIME_TOLERANCE
        self._received = {sender: held for sender, held in self._received.items() if held[0] >= oldest}
        return self._perception.perceive(
            self._fusion.merge_readings(readings, [points for _, (_, points) in sorted(self._received.items())])
        )
