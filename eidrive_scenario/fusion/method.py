"""The seam of fusion: a FusionMethod joins the reports of several stations."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

from eidrive_scenario.detections import Detections


@dataclass(frozen=True)
class Report:
    """What one station perceived, and how it reached this one: measured at `detections.time`, arrived at `arrived`."""

    station: str
    detections: Detections
    arrived: float


class FusionMethod(ABC):
    """Joins reports into one list of objects. Built anew for each station and run."""

    @abstractmethod
    def fuse(self, reports: Sequence[Report], now: float) -> Detections:
        """One box per object; `reports` holds at most the newest report of each station, the own one included."""
