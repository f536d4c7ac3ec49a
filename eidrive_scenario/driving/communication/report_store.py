"""Newest report of each station, from messages and own sensors, with perception regions and shared sensor data."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence

import numpy as np
from msgspec.structs import replace

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.coverage import PerceptionRegion, ViewSector
from eidrive_scenario.base.detections import Detections
from eidrive_scenario.base.feature_map import FeatureMap
from eidrive_scenario.base.tolerances import TIME_TOLERANCE
from eidrive_scenario.driving.communication.own_body import OwnBody
from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.errors import InvalidResult
from eidrive_scenario.fusion.method import FusionMethod, Report
from eidrive_scenario.fusion.prediction import added_variance
from eidrive_scenario.perception.lidar.station import StationLidars
from eidrive_scenario.perception.pipeline import Perception
from eidrive_scenario.perception.result_checks import describe
from eidrive_scenario.perception.tracking.motion_models import ACCELERATION_DENSITY, KNOWN_SPEED, UNKNOWN_SPEED
from eidrive_scenario.perception.tracking.uncertain_pose import PoseUncertainty, pose_covariance_at
from eidrive_scenario.sensing.readings import EgoState, Readings
from eidrive_scenario.v2x.messages.feature_frames import FeatureFrame
from eidrive_scenario.v2x.messages.message import Message, Payload, ReceivedMessage, StationState, shift_timestamps
from eidrive_scenario.v2x.messages.point_cloud import PointCloud


def relative_state(state: StationState | None, ego: EgoState, covariance: Array | None) -> StationState | None:
    """Return the reported state of another station with the covariance of its pose relative to that of the receiver.

    ego         assumed pose of the receiver
    covariance  (3, 3) of its x, y and yaw; None: the pose is exact

    The receiver steers relative to its assumed pose, of which its own detections are free of error. The two pose errors
    are independent, so that objects of the other station have both.
    """
    if state is None or covariance is None:
        return state
    dx, dy = state.x - float(ego.position[0]), state.y - float(ego.position[1])
    own = pose_covariance_at(dx, dy, covariance)
    return replace(state, pose_covariance=own if state.pose_covariance is None else state.pose_covariance + own)


class PartialReportAssembler:
    """Store of the last report of each object for at most `timeout` [s]."""

    def __init__(self, timeout: float) -> None:
        self._timeout = timeout
        self._objects: dict[int, Detections] = {}

    def update(self, ids: Sequence[int], detections: Detections) -> Detections:
        """Add a message; return all known objects predicted to the time of the newest measurement.

        Objects are predicted at their last velocity; objects of unknown velocity keep their position. Their covariances
        grow as those of predicted tracks.

        ids         of the objects in the message
        detections  those of them that are not the ego body, with their ids
        """
        for number in set(ids).difference(detections.tracks):
            self._objects.pop(number, None)
        for row, number in enumerate(detections.tracks):
            held = self._objects.get(number)
            if held is None or held.time <= detections.time:
                self._objects[number] = detections.subset([row])
        time = max([detections.time, *(known_object.time for known_object in self._objects.values())])
        self._objects = {
            number: known_object
            for number, known_object in sorted(self._objects.items())
            if time - known_object.time <= self._timeout
        }
        objects = [*self._objects.values()]
        predicted = Detections.concatenate(time, objects)
        age = time - np.array([known_object.time for known_object in objects])
        predicted.boxes[:, :2] += np.nan_to_num(predicted.velocity) * age[:, None]
        moving = np.isfinite(predicted.velocity).all(axis=1)
        variance = np.where(moving, predicted.velocity_deviation or KNOWN_SPEED, UNKNOWN_SPEED) ** 2
        if len(predicted.velocity_variance):
            variance = np.maximum(variance, predicted.velocity_variance)
            predicted.velocity_variance[:] += ACCELERATION_DENSITY * age
        predicted.covariance[:] += added_variance(variance, age)[:, None, None] * np.eye(2)
        return predicted


REGION_LIFETIME = 1.0
"""Time for which a perception region counts as perceived [s]."""


class PerceptionRegionStore:
    """Newest perception region of each station, kept for REGION_LIFETIME.

    CPMs list the sensors of the sender once per second only (ETSI TS 103 324); the others apply them at a new pose.
    """

    def __init__(self) -> None:
        self._sensors: dict[str, tuple[ViewSector, ...]] = {}
        self._regions: dict[str, PerceptionRegion] = {}

    def add(
        self, station: str, time: float, pose: tuple[float, float, float, float], sectors: tuple[ViewSector, ...]
    ) -> None:
        """Store the region of a measurement at `time` [s], unless a newer one of the station is stored.

        pose     x, y, z and yaw of the station [m, rad]
        sectors  covered sectors in the frame of the station
        """
        held = self._regions.get(station)
        if held is None or held.time <= time:
            placed = tuple([sector.placed(*pose) for sector in sectors])
            self._regions[station] = PerceptionRegion(station, time, placed)

    def add_message(self, message: Message, arrived: float) -> None:
        """Store the region of a CPM at its last measurement, not later than its arrival, also if the clock of its
        sender is fast. Without information about the sensors of its sender it has none.

        The message has the pose of the sender at its generation; since the measurement it drove straight on.
        """
        if message.kind != "cpm":
            return
        if message.sensors is not None:
            self._sensors[message.sender] = message.sensors
        sectors = self._sensors.get(message.sender, ())
        if sectors:
            state = message.state
            time = message.detections.time if message.measured is None else message.measured
            driven = state.speed * (state.time - time)
            x, y = state.x - driven * math.cos(state.yaw), state.y - driven * math.sin(state.yaw)
            self.add(message.sender, min(time, arrived), (x, y, state.z, state.yaw), sectors)

    def newest(self, now: float) -> tuple[PerceptionRegion, ...]:
        """Return the regions that do not exceed the lifetime at `now` [s], one for each station."""
        for station, region in list(self._regions.items()):
            if region.time < now - REGION_LIFETIME - TIME_TOLERANCE:
                del self._regions[station]
        return tuple(self._regions.values())


class SensorDataSharing:
    """Sensor data of the station as it sends them, and detection in them together with received ones.

    fusion      method of the station, which shares sensor data
    perception  perception of the station alone
    joint       separate instance for the merged data, as detectors and trackers have state; None for a station that
                does not receive messages
    lidars      of the station, whose last revolution is shared
    limit       maximum size of a message with features [bytes]
    latency     computing time after which features are sent [s]; points are sent at once
    """

    def __init__(
        self,
        fusion: FusionMethod,
        perception: Perception,
        joint: Perception | None,
        *,
        lidars: StationLidars,
        limit: int,
        latency: float,
    ) -> None:
        self.own: tuple[Payload, ...] = ()
        """Newest sensor data of this station that are ready for transmission."""
        self._fusion = fusion
        self._perception = perception
        self._joint = joint
        self._lidars = lidars
        self._limit = limit
        self._latency = latency if fusion.shares == "features" else 0.0
        self._features: FeatureMap | None = None
        self._computing: deque[tuple[float, tuple[Payload, ...]]] = deque()

    def accepts(self, payload: Payload) -> bool:
        """Return whether the station merges sensor data of this type."""
        return isinstance(payload, PointCloud if self._fusion.shares == "points" else FeatureFrame)

    def perceive(self, readings: Readings, alone: Detections | None, pose: PoseUncertainty | None) -> Detections | None:
        """Return newly available objects in merged sensor data, or None.

        alone  objects in the ego data;  pose  uncertainty of the assumed pose; None: it is exact
        """
        if self._fusion.shares == "features":
            newest = self._perception.detector.feature_map
            readings = replace(readings, features=None if newest is self._features else newest)
            self._features = newest
        else:
            readings = replace(readings, lidars=self._lidars.newest_revolutions(readings, self._fusion.max_payload_age))
        now = readings.time
        payloads = self._fusion.payloads(readings, self._limit)
        if payloads:
            self._computing.append((now + self._latency, payloads))
        while self._computing and self._computing[0][0] <= now + TIME_TOLERANCE:
            self.own = self._computing.popleft()[1]
        if self._joint is None:
            return alone
        if pose is not None:
            self._joint.set_pose(pose)
        merged: object = self._fusion.merge_readings(readings, alone)
        if not isinstance(merged, Readings):
            raise InvalidResult(self._fusion, "merge_readings", f"returned {describe(merged)} (expected Readings)")
        return self._joint.perceive(merged)


SENDER_REPORT_SUFFIX = " itself"
"""Suffix of the station of reports of a sender about itself, which are kept as those of another station."""


class ReportStore:
    """Newest report of each station until the end of its lifetime. Every report is passed to the fusion method, except
    those that are too old when they arrive.

    regions  perception regions that received CPMs are added to; None if the station does not use them
    sharing  received sensor data; None if the station does not use them
    """

    def __init__(
        self,
        name: str,
        settings: AgentSettings,
        *,
        fusion: FusionMethod,
        own_body: OwnBody,
        regions: PerceptionRegionStore | None,
        sharing: SensorDataSharing | None,
    ) -> None:
        self._name = name
        self._clock = settings.clock
        self._fusion = fusion
        self._own_body = own_body
        self._regions = regions
        self._sharing = sharing
        self._reports: dict[str, Report] = {}
        self._partial: dict[str, PartialReportAssembler] = {}
        self._lifetime = min(settings.report_lifetime, fusion.max_report_age)
        """Maximum age of a report that is used [s]."""
        self._next_deletion = math.inf
        """Time up to which no report exceeds its lifetime [s]."""
        self._joint: list[Detections] = []
        """Objects in merged sensor data that wait for the own message of their time."""

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
        name, regions, sharing = self._name, self._regions, self._sharing
        expired: list[int] = []
        for row, received in enumerate(inbox):
            message = shift_timestamps(received.message, -self._clock.error(now))
            sender, perceived, complete = message.sender, message.kind == "cpm", message.objects is None
            own = sender == name
            if own and not (own_perception and perceived):
                continue
            if regions is not None:
                regions.add_message(message, received.arrived)
            payload = message.payload
            if sharing is not None and payload is not None and sharing.accepts(payload) and not own:
                longest = self._fusion.max_payload_age
                # Data of the far future would replace all later ones of their sender.
                if abs(payload.time - now) <= longest + TIME_TOLERANCE:
                    duration = payload.duration if isinstance(payload, PointCloud) else 0.0
                    self._fusion.add_payload(sender, payload, self._own_body.box(payload.time, duration))
                elif message.kind == "features" and payload.time < now:
                    expired.append(row)
            if message.kind == "features":
                continue
            if message.detections.time + self._lifetime < now - TIME_TOLERANCE:
                expired.append(row)
                continue
            detections, objects = message.identified, message.objects
            joint = [held for held in self._joint if own and held.time <= message.detections.time + TIME_TOLERANCE]
            if joint:
                detections, objects, complete = joint[-1], None, True
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
            completed: Detections | None = None
            if objects is not None:  # the message lists a part of the objects of its sender
                if sender not in self._partial:
                    self._partial[sender] = PartialReportAssembler(self._lifetime)
                completed = self._partial[sender].update(objects, detections).freeze()
            report = Report(station, detections.freeze(), received.arrived, state, complete, pose_change, not perceived)
            self.add(report, completed)
        if now > self._next_deletion:
            ends = {station: self._end_of_life(held) for station, held in self._reports.items()}
            for station, end in ends.items():
                if end < now - TIME_TOLERANCE:
                    del self._reports[station]
            self._next_deletion = min((ends[station] for station in self._reports), default=math.inf)
        return tuple(expired)

    def keep_joint(self, detections: Detections, now: float) -> None:
        """Store objects in merged sensor data. They are used when a message of the station to itself arrives, with
        which they are delayed and lost; it contains the objects in the own data only.
        """
        self._joint = [held for held in self._joint if held.time + self._lifetime >= now - TIME_TOLERANCE]
        self._joint.append(detections)

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

    def _end_of_life(self, report: Report) -> float:
        """Return the time up to which a report is stored [s], also if the clock of its sender is fast."""
        return min(report.detections.time, report.arrived) + self._lifetime

    def _without_own_body(self, message: Message, detections: Detections, pose_covariance: Array | None) -> Detections:
        """Return detections of a message without the ego body."""
        if message.kind != "cpm" or message.sender == self._name:
            return self._own_body.without(detections)
        own = self._reports.get(self._name)
        return self._own_body.without_perceived(
            detections, message.sender, message.state, None if own is None else own.detections, pose_covariance
        )
