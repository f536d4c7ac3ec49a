"""The seam of perception: a Detector turns readings into boxes."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

from eidrive_scenario.detections import Detections
from eidrive_scenario.sensing.readings import Readings


class Detector(ABC):
    """Turns the readings of one station into boxes in the world frame. Built anew for each station and run."""

    needs: ClassVar[frozenset[str]] = frozenset()
    """The kinds of sensors it reads: truth, camera, lidar."""

    @abstractmethod
    def detect(self, readings: Readings) -> Detections:
        """The objects in these readings."""
