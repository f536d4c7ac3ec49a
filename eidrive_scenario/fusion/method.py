"""The seam of fusion: a FusionMethod joins the reports of several stations."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from eidrive_scenario.detections import Detections
from eidrive_scenario.records import fast_frozen
from eidrive_scenario.settings import Settings
from eidrive_scenario.v2x.messages.message import StationState


@fast_frozen
@dataclass(frozen=True)
class Report:
    """What one station perceived, and how it reached this one: measured at `detections.time`, arrived at `arrived`.

    state     where the station said it was, if it did
    complete  whether an object that is not in the list is no longer seen; else nothing is said of it
    """

    station: str
    detections: Detections
    arrived: float
    state: StationState | None = None
    complete: bool = True


class FusionMethod(ABC):
    """Joins reports into one list of objects. Built anew for each station and run.

    A class is registered in the entry points `eidrive_scenario.fusion`. It is built as `cls()`, or as `cls(settings)`
    where it has a `settings_type`: an instance of that, read from the controller's property `fusion_settings`.
    """

    settings_type: ClassVar[type[Settings] | None] = None
    """What the property `fusion_settings` may say; nothing where None."""

    def add_report(self, report: Report) -> None:  # noqa: B027 - a hook for methods with a memory
        """A report has come in: each one, in the order of arrival, before the next `fuse`. Also those that are older
        than another of their station, and those that do not say all that their station knows."""

    @abstractmethod
    def fuse(self, reports: Sequence[Report], now: float) -> Detections:
        """One box per object; `reports` holds at most the newest report of each station, the own one included."""
