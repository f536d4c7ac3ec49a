"""Newest report of each station, from received messages and from the own sensors."""

from __future__ import annotations

import math
from collections.abc import Sequence

from msgspec.structs import replace

from eidrive_scenario.arrays import Array
from eidrive_scenario.detections import Detections
from eidrive_scenario.driving.communication.own_body import OwnBody
from eidrive_scenario.driving.communication.partial_reports import PartialReportAssembler
from eidrive_scenario.driving.communication.perception_regions import PerceptionRegionStore
from eidrive_scenario.driving.communication.relative_pose import relative_state
from eidrive_scenario.driving.communication.shared_points import PointCloudSharing
from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.fusion.method import FusionMethod, Report
from eidrive_scenario.sensing.readings import EgoState
from eidrive_scenario.tolerances import TIME_TOLERANCE
from eidrive_scenario.v2x.messages.message import Message, ReceivedMessage, StationState

SENDER_REPORT_SUFFIX = " itself"
"""Suffix of the reports of a station about itself, which are kept as those of another station."""


class ReportStore:
    """Newest report of each station until the end of its lifetime. Every report is passed to the fusion method, except
    those that are too old when they arrive.

    regions  perception regions that received CPMs are added to; None if the station does not use them
    points   received point clouds; None if the station does not use them
    """

    def __init__(
        self,
        name: str,
        settings: AgentSettings,
        *,
        fusion: FusionMethod,
        own_body: OwnBody,
        regions: PerceptionRegionStore | None,
        points: PointCloudSharing | None,
    ) -> None:
        self._name = name
        self._clock = settings.clock
        self._fusion = fusion
        self._own_body = own_body
        self._regions = regions
        self._points = points
        self._reports: dict[str, Report] = {}
        self._partial: dict[str, PartialReportAssembler] = {}
        self._lifetime = min(settings.report_lifetime, fusion.max_report_age)
        """Maximum age of a report that is used [s]."""
        self._next_deletion = math.inf
        """Time up to which no report exceeds its lifetime [s]."""

    @property
    def newest(self) -> Sequence[Report]:
        """Newest report of each station."""
        return list(self._reports.values())

    def process(
        self,
        inbox: Sequence[ReceivedMessage],
        now: float,
        ego: EgoState,
        *,
        pose_covariance: Array | None,
        own_perception: bool,
    ) -> tuple[int, ...]:
        """Store the newest report of each sender, and delete reports that exceed their lifetime.

        Return the rows of messages in the inbox that are not used because they are too old.

        ego              assumed pose of the station, with (3, 3) `pose_covariance` of x, y and yaw; None: it is exact
        own_perception   whether the channel carries the detections of a station back to itself
        """
        name, regions, points = self._name, self._regions, self._points
        expired: list[int] = []
        for row, received in enumerate(inbox):
            message = self._clock.with_local_timestamps(received.message, now)
            sender, perceived, complete = message.sender, message.kind == "cpm", message.objects is None
            own = sender == name
            if own and not (own_perception and perceived):
                continue
            if regions is not None:
                regions.add_message(message)
            if points is not None and message.points is not None and not own:
                if self._is_expired(message.points.time, self._fusion.max_point_age, now):
                    expired.append(row)
                else:
                    points.add_points(sender, message.points, self._own_body.box(message.points.time))
                continue
            if self._is_expired(message.detections.time, self._lifetime, now):
                expired.append(row)
                continue
            detections = _numbered(message)
            state: StationState | None = message.state
            pose_change: Array | None = None
            if not own:
                detections = self._without_own_body(message, detections, pose_covariance)
                state = relative_state(state, ego, pose_covariance)
            elif state is not None and state.pose_covariance is not None:
                # Messages to itself may be lost: the change between two of them is at most that of independent errors.
                pose_change = 2.0 * state.pose_covariance
                state = replace(state, pose_covariance=None)
            station = sender if perceived else sender + SENDER_REPORT_SUFFIX
            self.add(
                Report(station, detections, received.arrived, state, complete, pose_change),
                None if complete else self._assembled_detections(message, pose_covariance),
            )
        if now > self._next_deletion:
            self._delete_old(now)
        return tuple(expired)

    def add(self, report: Report, completed: Detections | None = None) -> None:
        """Pass a report to the fusion method, and store it unless a newer one of its station is stored.

        An incomplete report is stored with all known objects of its station, `completed`.
        """
        self._fusion.add_report(report)
        if completed is not None:
            report = replace(report, detections=completed, complete=True)
        station = report.station
        held = self._reports.get(station)
        if held is None:
            self._next_deletion = min(self._next_deletion, self._end_of_life(report))
        if held is None or report.detections.time >= held.detections.time:
            self._reports[station] = report

    @staticmethod
    def _is_expired(time: float, lifetime: float, now: float) -> bool:
        """Return whether a measurement at `time` [s] exceeds its lifetime [s]."""
        return time + lifetime < now - TIME_TOLERANCE

    def _end_of_life(self, report: Report) -> float:
        """Return the time up to which a report is stored [s], also if the clock of its sender is fast."""
        return min(report.detections.time, report.arrived) + self._lifetime

    def _delete_old(self, now: float) -> None:
        """Delete reports that exceed their lifetime."""
        oldest, expired = math.inf, []
        for station, held in self._reports.items():
            end = self._end_of_life(held)
            if end < now - TIME_TOLERANCE:
                expired.append(station)
            elif end < oldest:
                oldest = end
        for station in expired:
            del self._reports[station]
        self._next_deletion = oldest

    def _assembled_detections(self, message: Message, pose_covariance: Array | None) -> Detections:
        """Return all known objects of the sender of a message that lists a part of them."""
        memory = self._partial.get(message.sender)
        if memory is None:
            memory = self._partial[message.sender] = PartialReportAssembler(self._lifetime)
        return self._without_own_body(message, memory.update(message), pose_covariance)

    def _without_own_body(self, message: Message, detections: Detections, pose_covariance: Array | None) -> Detections:
        """Return detections of a message without the ego body."""
        if message.kind != "cpm" or message.sender == self._name:
            return self._own_body.without(detections)
        own = self._reports.get(self._name)
        return self._own_body.without_perceived(
            detections, message.sender, message.state, None if own is None else own.detections, pose_covariance
        )


def _numbered(message: Message) -> Detections:
    """Return the detections of a message, with the object ids of the sender as track numbers if it has none."""
    if message.objects is None or message.detections.tracks:
        return message.detections
    return replace(message.detections, tracks=message.objects)
