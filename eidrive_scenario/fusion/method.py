"""Interface of fusion: a `FusionMethod` fuses the reports of several stations."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import ClassVar, Literal, Self

import msgspec

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.detections import Detections
from eidrive_scenario.extensions.settings import Settings
from eidrive_scenario.perception.detector import Detector
from eidrive_scenario.sensing.readings import Readings
from eidrive_scenario.v2x.messages.message import Payload, StationState


class Report(msgspec.Struct, frozen=True, gc=False):
    """Detections of one station, measured at `detections.time` and received at `arrived` [s].

    state     reported state of the station; None if it is not reported
    pose_change  covariance (3, 3) of the change of the error of x, y [m] and yaw [rad] of the station since its last
              report, of which positions relative to its assumed pose are a sum; None: its detections have no such error
    complete  whether the list contains all detected objects; if False, objects that are not listed stay unchanged
    describes_sender  whether the sender reports itself; objects of two such reports are different bodies
    """

    station: str
    detections: Detections
    arrived: float
    state: StationState | None = None
    complete: bool = True
    pose_change: Array | None = None
    describes_sender: bool = False


class FusionMethod(ABC):
    """Abstract base class of fusion methods, which fuse reports into one object list. One instance per station and run.

    Classes are registered in the entry points `eidrive_scenario.fusion`. They are constructed as `cls()`, or, with a
    `settings_type`, as `cls(settings)`. The settings are read from the controller property `fusion_settings`.
    """

    settings_type: ClassVar[type[Settings] | None] = None
    """Settings class of the property `fusion_settings`; None if the method has no settings."""
    shares: ClassVar[Literal["points", "features"] | None] = None
    """Sensor data that stations send beside their detections. They detect in them together with those of others."""
    is_finite_by_construction: ClassVar[bool] = False
    """Whether this class, without those derived from it, only copies and averages finite numbers: its results are not
    checked."""

    def add_report(self, report: Report) -> None:  # noqa: B027 - optional
        """Process a received report. Every report that is not too old is passed in order of arrival, before the next
        `fuse`. This includes out-of-sequence and incomplete reports.
        """

    @property
    def max_report_age(self) -> float:
        """Maximum age of reports that the method uses [s], in addition to the lifetime of reports of the station."""
        return math.inf

    @property
    def max_payload_age(self) -> float:
        """Maximum age of received sensor data that are merged, and maximum lead of the clock of their sender [s]."""
        return 0.0

    def setup(self, detector: Detector) -> None:  # noqa: B027 - optional
        """Store the detector of a station that shares sensor data, before the first reading."""

    def payloads(self, readings: Readings, limit: int) -> tuple[Payload, ...]:
        """Return the sensor data of a station as it sends them; empty if the readings contain none.

        Points are part of a CPM. Features are frames of at most `limit` bytes, each in a separate message.
        """
        return ()

    def add_payload(self, sender: str, payload: Payload, body: Array) -> None:  # noqa: B027 - optional
        """Store received sensor data within this age, without those on the ego body (7,) while they were measured."""

    def merge_readings(self, readings: Readings, alone: Detections | None = None) -> Readings:
        """Return the readings of a station with the received sensor data that are not too old.

        alone  new objects in the sensor data of the station alone; None if there are none
        """
        return readings

    @abstractmethod
    def fuse(self, reports: Sequence[Report], now: float) -> Detections:
        """Return one box per object; `reports` holds the newest report of each station, including the own one."""

    @classmethod
    def fuse_batch(
        cls, methods: Sequence[Self], reports: Sequence[Sequence[Report]], now: float
    ) -> Sequence[Detections]:
        """Return the results of `fuse` of several receiving stations, one method of this class each.

        A class that overrides `fuse` may override it to process all stations in common arrays, with the results of
        separate calls. Errors in a batch name all its stations.
        """
        return [method.fuse(held, now) for method, held in zip(methods, reports, strict=True)]
