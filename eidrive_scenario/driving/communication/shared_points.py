"""A station that shares points with others and detects in those of all."""

from __future__ import annotations

from eidrive_scenario.arrays import Array
from eidrive_scenario.detections import Detections
from eidrive_scenario.fusion.method import FusionMethod
from eidrive_scenario.geometry import points_in_box
from eidrive_scenario.perception.pipeline import Perception
from eidrive_scenario.sensing.readings import Readings
from eidrive_scenario.tolerances import TIME_TOLERANCE
from eidrive_scenario.v2x.messages.point_cloud import PointCloud


class PointCloudSharing:
    """The clouds that others sent, and the search for objects in them and the own points together.

    perception   for that search; one of its own, as detectors and trackers remember what they saw. None for a station
                 that hears nobody
    """

    def __init__(self, fusion: FusionMethod, perception: Perception | None) -> None:
        self.own: PointCloud | None = None
        """The newest points of this station, as it sends them."""
        self._fusion = fusion
        self._perception = perception
        self._heard: dict[str, tuple[float, Array]] = {}

    def add_points(self, sender: str, cloud: PointCloud, body: Array) -> None:
        """A cloud has come in; points on the own body (7,), where that was when they were measured, are left out.

        A late cloud does not replace a newer one.
        """
        held = self._heard.get(sender)
        if held is None or cloud.time >= held[0]:
            points = cloud.points()
            self._heard[sender] = (cloud.time, points[~points_in_box(points, body)])

    def perceive(self, readings: Readings, alone: Detections | None) -> Detections | None:
        """The objects that become known now, `alone` being those in the own points; None if there is nothing new."""
        self.own = self._fusion.shared_cloud(readings) or self.own
        if self._perception is None:
            return alone
        oldest = readings.time - self._fusion.max_point_age - TIME_TOLERANCE
        self._heard = {sender: held for sender, held in self._heard.items() if held[0] >= oldest}
        return self._perception.perceive(
            self._fusion.merge_readings(readings, [points for _, (_, points) in sorted(self._heard.items())])
        )
