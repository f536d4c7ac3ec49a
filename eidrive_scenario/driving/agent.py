"""Agent of one station: detection, fusion, planning, control and message generation."""

from __future__ import annotations

import math
from collections.abc import Sequence

from msgspec.structs import replace

from eidrive_scenario.coverage import ViewSector
from eidrive_scenario.detections import Detections
from eidrive_scenario.driving.communication.message_generator import MessageGenerator
from eidrive_scenario.driving.communication.own_body import OwnBody
from eidrive_scenario.driving.communication.partial_reports import PartialReportAssembler
from eidrive_scenario.driving.communication.perception_regions import PerceptionRegionStore
from eidrive_scenario.driving.communication.relative_pose import relative_state
from eidrive_scenario.driving.communication.shared_points import PointCloudSharing
from eidrive_scenario.driving.control.vehicle_controller import VehicleController
from eidrive_scenario.driving.planning.planner import Planner
from eidrive_scenario.driving.result_checks import check_control, check_followed, check_plan, is_valid_control
from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.driving.station_action import OWN_DECISIONS, StationAction
from eidrive_scenario.driving.step import AgentStep, Plan, StationPerception
from eidrive_scenario.fusion.method import FusionMethod, Report
from eidrive_scenario.perception.pipeline import Perception
from eidrive_scenario.perception.result_checks import check_detections, is_checked
from eidrive_scenario.registry import is_built_in
from eidrive_scenario.requests import Goal
from eidrive_scenario.sensing.readings import EgoState, Readings
from eidrive_scenario.tolerances import TIME_TOLERANCE
from eidrive_scenario.v2x.messages.message import Message, ReceivedMessage, StationState
from eidrive_scenario.world.actor import ActorSpec, Control

REGION_LIFETIME = 1.0
"""Time for which a perception region counts as perceived [s]."""

SENDER_REPORT_SUFFIX = " itself"
"""Suffix of the reports of a station about itself, which are kept as those of another station."""


class Agent:
    """Agent of one station. Its only inputs are sensor readings, received messages and the goal.

    It keeps the newest report of each sender until `report_timeout`. It transmits its own detections, not fused ones,
    which avoids data incest.
    """

    def __init__(
        self,
        spec: ActorSpec,
        settings: AgentSettings,
        *,
        perception: Perception,
        fusion: FusionMethod,
        planner: Planner | None,
        controller: VehicleController | None,
        message_generator: MessageGenerator,
        dt: float,
        receives_messages: bool = True,
        points: PointCloudSharing | None = None,
    ) -> None:
        self.name = spec.name
        self.spec = spec
        self.settings = settings
        self.perception = perception
        self.fusion = fusion
        self._fusion_checked = is_checked(fusion)
        self.planner = planner
        self._planner_checked = planner is not None and not is_built_in(type(planner))
        self.controller = controller
        self.receives_messages = receives_messages
        """Whether the station receives messages; a station that does not drive may only transmit."""
        self.points = points
        self._message_generator = message_generator
        self._clock = settings.clock
        self._partial: dict[str, PartialReportAssembler] = {}
        self._detections = Detections(0.0)
        self._reports: dict[str, Report] = {}
        self._usual_lifetime = settings.lifetime(complete=True)
        self._lifetimes: dict[str, float] = {}
        """Lifetime of the reports of each station [s]."""
        self._regions: PerceptionRegionStore | None = None
        if planner is not None and planner.observes_regions:
            self._regions = PerceptionRegionStore(REGION_LIFETIME)
            everywhere = ViewSector(*spec.offset, 0.0, math.pi, math.inf)
            self._view = (everywhere,) if planner.view is None else planner.view
        self._own_body = OwnBody(spec, duration=settings.lifetime(complete=False), dt=dt)

    @property
    def next_message_number(self) -> int:
        """Sequence number of the next message of the station."""
        return self._message_generator.number

    @property
    def error_subject(self) -> str:
        """Station that errors of its extensions name."""
        return f"station {self.name!r}"

    def receives_from(self, sender: str, *, own_perception: bool) -> bool:
        """Return whether messages of `sender` are sent to this station: the only place that decides on reception.

        own_perception  whether the channel carries the detections of a station back to itself
        """
        if not self.receives_messages:
            return False
        if sender == self.name:
            return own_perception
        return self.settings.cooperates_with is None or sender in self.settings.cooperates_with

    def act(
        self,
        readings: Readings,
        inbox: Sequence[ReceivedMessage],
        now: float,
        goal: Goal | None,
        *,
        message_interval: float = 0.0,
        own_perception: bool = False,
    ) -> AgentStep:
        """Return the step of the station at `now` [s]; the arguments are those of `perceive`."""
        return self.decide(
            self.perceive(readings, inbox, now, goal, message_interval=message_interval, own_perception=own_perception)
        )

    def perceive(
        self,
        readings: Readings,
        inbox: Sequence[ReceivedMessage],
        now: float,
        goal: Goal | None,
        *,
        message_interval: float = 0.0,
        own_perception: bool = False,
    ) -> StationPerception:
        """Return what the station perceives at `now` [s]; `decide` completes its step.

        inbox             messages delivered since the last tick
        goal              request of the scenario
        message_interval  minimum time between two messages under congestion control [s]
        own_perception    whether the channel carries the detections of a station back to itself; a receiving station
                          then uses its own detections only after that delay
        """
        own_perception = own_perception and self.receives_messages
        readings = self.perception.locate(readings)
        ego = readings.ego
        self._own_body.record(ego, readings.attached)
        fresh = self.perception.perceive(readings)
        if fresh is not None:
            self._detections = fresh
        detections = self._detections
        self._process_inbox(inbox, now, own_perception, ego)
        state = self._state(ego)
        found = fresh if self.points is None else self.points.perceive(readings, fresh)
        if found is not None and not own_perception:
            self._accept_report(Report(self.name, found, now, replace(state, pose_covariance=None)))
            self._add_own_region(found.time)
        fused = self.fusion.fuse(list(self._reports.values()), now)
        if self._fusion_checked:
            check_detections(self.fusion, "fuse", fused)
        obeys = self.planner is not None and self.settings.obey_signals
        return StationPerception(
            now,
            ego,
            state,
            detections,
            tuple(inbox),
            fused,
            goal,
            self.perception.signals(readings) if obeys else (),
            message_interval,
        )

    def decide(self, perceived: StationPerception, action: StationAction = OWN_DECISIONS) -> AgentStep:
        """Return the step of the station from what it perceives in this tick.

        action  decisions from outside, which replace those of planner, controller and message generator
        """
        ego, now, detections = perceived.ego, perceived.time, perceived.detections
        plan = None
        if self.planner is not None:
            if self.settings.obey_signals:
                self.planner.observe_signals(perceived.signals)
            if self._regions is not None:
                self.planner.observe_regions(self._regions.newest(now))
            plan = self.planner.plan(ego, perceived.fused, action.requested_goal(perceived.goal), now)
            if self._planner_checked:
                check_plan(self.planner, plan)
        return AgentStep(
            detections=detections,
            inbox=perceived.inbox,
            fused=perceived.fused,
            plan=plan,
            control=self._control(ego, plan) if action.control is None else action.control,
            outbox=self._message_generator.generate(
                perceived.state,
                action.shared(detections),
                now,
                self.points.own if self.points is not None else None,
                interval=perceived.message_interval,
            )
            if action.send
            else (),
            estimate=None if self.perception.has_exact_pose else ego,
        )

    def _add_own_region(self, time: float) -> None:
        """Store the region that the own sensors perceived at `time` [s]."""
        if self._regions is not None:
            self._regions.add(self.name, time, self._own_body.reference_pose(time), self._view)

    def _process_inbox(self, inbox: Sequence[ReceivedMessage], now: float, own_perception: bool, ego: EgoState) -> None:
        """Store the newest report of each sender, and delete reports that exceed their lifetime."""
        for received in inbox:
            message = self._clock.with_local_timestamps(received.message, now)
            sender = message.sender
            if sender == self.name and (not own_perception or message.kind == "cam"):
                continue
            if self._regions is not None:
                self._regions.add_message(message)
            if self.points is not None and message.points is not None and sender != self.name:
                self.points.add_points(sender, message.points, self._own_body.box(message.points.time))
                continue
            detections = _numbered(message)
            if sender != self.name:
                detections = self._without_own_body(message, detections)
            station = sender if message.kind == "cpm" else sender + SENDER_REPORT_SUFFIX
            report = Report(
                station,
                detections,
                received.arrived,
                self._state_relative_to(ego, message),
                complete=message.objects is None,
            )
            self._lifetimes[station] = self.settings.lifetime(complete=report.complete and message.kind == "cpm")
            self._accept_report(report, None if report.complete else self._assembled_detections(message))
        for station, held in list(self._reports.items()):
            if held.detections.time < now - self._lifetimes.get(station, self._usual_lifetime) - TIME_TOLERANCE:
                del self._reports[station]

    def _assembled_detections(self, message: Message) -> Detections:
        """Return all known objects of the sender of a message that lists a part of them."""
        memory = self._partial.get(message.sender)
        if memory is None:
            memory = self._partial[message.sender] = PartialReportAssembler(self.settings.lifetime(complete=False))
        return self._without_own_body(message, memory.update(message))

    def _accept_report(self, report: Report, completed: Detections | None = None) -> None:
        """Pass a report to the fusion method, and store it unless a newer one of its station is stored.

        An incomplete report is stored with all known objects of its station, `completed`.
        """
        self.fusion.add_report(report)
        if completed is not None:
            report = replace(report, detections=completed, complete=True)
        held = self._reports.get(report.station)
        if held is None or report.detections.time >= held.detections.time:
            self._reports[report.station] = report

    def _without_own_body(self, message: Message, detections: Detections) -> Detections:
        """Return detections of a message without the ego body."""
        if message.kind != "cpm" or message.sender == self.name:
            return self._own_body.without(detections)
        own = self._reports.get(self.name)
        return self._own_body.without_perceived(
            detections,
            message.sender,
            message.state,
            None if own is None else own.detections,
            self.perception.pose_covariance,
        )

    def _control(self, ego: EgoState, plan: Plan | None) -> Control | None:
        if self.controller is None:
            return None
        if plan is None or self.planner is None:
            control = self.controller.hold_standstill()
            check_control(self.controller, "hold_standstill", control)
            return control
        try:
            control = self.controller.control(ego, plan)
        except (ArithmeticError, ValueError, LookupError):
            check_followed(self.planner, plan)
            raise
        if not is_valid_control(control):
            check_followed(self.planner, plan)
            check_control(self.controller, "control", control)
        return control

    def _state_relative_to(self, ego: EgoState, message: Message) -> StationState | None:
        """Return the reported state of a sender with the covariance of its pose relative to the assumed pose."""
        if message.sender == self.name:
            return message.state and replace(message.state, pose_covariance=None)
        return relative_state(message.state, ego, self.perception.pose_covariance)

    def _state(self, ego: EgoState) -> StationState:
        x, y, z = ego.position.tolist()
        return StationState(ego.time, x, y, z, ego.yaw, ego.speed, self.perception.pose_covariance)


def _numbered(message: Message) -> Detections:
    """Return the detections of a message, with the object ids of the sender as track numbers if it has none."""
    if message.objects is None or message.detections.tracks:
        return message.detections
    return replace(message.detections, tracks=message.objects)
