"""Interface of trackers (abstract base class `TrackingMethod`)."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import ClassVar

from eidrive_scenario.arrays import Array
from eidrive_scenario.detections import Detections
from eidrive_scenario.perception.tracking.settings import TrackerKind
from eidrive_scenario.perception.tracking.uncertain_pose import PoseUncertainty


class TrackingMethod(ABC):
    """Tracker of one station: associates detections over time. Built as `cls(settings)` for each station and run.

    A class is registered in the entry points `eidrive_scenario.trackers`; the property `tracker` selects it by name.
    """

    settings_type: ClassVar[type[TrackerKind]] = TrackerKind
    """Type of the settings that the property `tracker` may give, if it is a mapping."""

    def __init__(self, settings: TrackerKind) -> None:
        self.settings = settings

    def set_pose(self, pose: PoseUncertainty) -> None:  # noqa: B027 - an optional hook
        """Store the pose of the station and its uncertainty; called in each time step, before the calls below, if the
        pose has random errors. With a latency of the detector, `update` gets detections of an earlier time step.

        Detections have a common error then, which their covariances do not contain.
        """

    @abstractmethod
    def update(self, detections: Detections, in_view: Callable[[Array], Array] | None = None) -> Detections:
        """Return the tracked objects at the time of these detections, with track numbers.

        in_view  returns the share (N,) in [0, 1] of boxes (N, 7) that the sensors can show; None: all of them
        """

    @abstractmethod
    def predict(self, time: float) -> Detections | None:
        """Return the objects predicted to a time after the last detections [s]; None if no prediction is possible."""
