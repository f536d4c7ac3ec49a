"""Agent of one station: detection, fusion, planning, control and message generation."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from msgspec.structs import replace

from eidrive_scenario.base.coverage import ViewSector
from eidrive_scenario.base.detections import Detections
from eidrive_scenario.base.requests import Goal
from eidrive_scenario.driving.communication.message_generator import MessageGenerator
from eidrive_scenario.driving.communication.own_body import OwnBody
from eidrive_scenario.driving.communication.report_store import PerceptionRegionStore, ReportStore, SensorDataSharing
from eidrive_scenario.driving.control.vehicle_controller import VehicleController
from eidrive_scenario.driving.planning.route_planner import Planner
from eidrive_scenario.driving.result_checks import check_control, check_followed, check_plan, is_valid_control
from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.driving.step import OWN_DECISIONS, AgentStep, Plan, StationAction, StationPerception
from eidrive_scenario.fusion.method import FusionMethod, Report
from eidrive_scenario.perception.pipeline import Perception
from eidrive_scenario.perception.result_checks import checked_detections, is_checked
from eidrive_scenario.sensing.readings import EgoState, Readings
from eidrive_scenario.sensing.settings import MIN_ROTATION
from eidrive_scenario.v2x.messages.message import ReceivedMessage, StationState
from eidrive_scenario.world.actor import ActorSpec, Control


class NextNumbers(NamedTuple):
    """Numbers of the next message, object without a track, and track of a station, which continues them if it returns.

    Receivers would take its new messages and objects for the earlier ones with the same numbers.
    """

    message: int = 0
    object: int = 0
    track: int = 0


FIRST_NUMBERS = NextNumbers()
"""Numbers of a station that was not present before."""

NOTHING_FUSED = Detections(0.0)
"""Objects before fusion."""


class Agent:
    """Agent of one station. Its only inputs are sensor readings, received messages and the goal.

    It keeps the newest report of each sender for its lifetime. It transmits its own detections, not fused ones, which
    avoids data incest.
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
        sharing: SensorDataSharing | None = None,
    ) -> None:
        self.name = spec.name
        self.spec = spec
        self.settings = settings
        self.perception = perception
        self.fusion = fusion
        self._fusion_checked = is_checked(fusion)
        self.planner = planner
        self.controller = controller
        self.receives_messages = receives_messages
        """Whether the station receives messages; a station that does not drive may only transmit."""
        self.sharing = sharing
        self.message_generator = message_generator
        self._detections: Detections | None = None
        self._regions: PerceptionRegionStore | None = None
        if planner is not None and planner.observes_regions:
            self._regions = PerceptionRegionStore()
            everywhere = ViewSector(*spec.offset, 0.0, math.pi, math.inf)
            self._view = (everywhere,) if planner.view is None else planner.view
        # Received points may be older than a report, and show the body during a revolution before
        oldest = fusion.max_payload_age + (1.0 / MIN_ROTATION if fusion.shares == "points" else 0.0)
        self._own_body = OwnBody(spec, duration=max(settings.report_lifetime, oldest), dt=dt)
        self._reports = ReportStore(
            self.name, settings, fusion=fusion, own_body=self._own_body, regions=self._regions, sharing=sharing
        )

    @property
    def error_subject(self) -> str:
        """Station that errors of its extensions name."""
        return f"station {self.name!r}"

    @property
    def next_numbers(self) -> NextNumbers:
        """Numbers that follow those of all messages and objects."""
        generator = self.message_generator
        return NextNumbers(generator.number, generator.numbering.next_id, self.perception.next_track)

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
        """Return the step of the station at `now` [s]; the arguments are those of `sense`."""
        sensed = self.sense(
            readings, inbox, now, goal, message_interval=message_interval, own_perception=own_perception
        )
        return self.decide(self.fuse(sensed))

    def sense(
        self,
        readings: Readings,
        inbox: Sequence[ReceivedMessage],
        now: float,
        goal: Goal | None,
        *,
        message_interval: float = 0.0,
        own_perception: bool = False,
    ) -> StationPerception:
        """Process sensor readings and received messages; return what the station perceives before `fuse`.

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
        if fresh is not None or self._detections is None:  # nothing is measured before the first detections
            self._detections = Detections(now) if fresh is None else fresh
        detections = self._detections
        covariance = self.perception.pose_covariance
        expired = self._reports.process(inbox, now, ego, pose_covariance=covariance, own_perception=own_perception)
        x, y, z = ego.position.tolist()
        state = StationState(ego.time, x, y, z, ego.yaw, ego.speed, covariance)
        own = fresh
        if self.sharing is not None:
            own = self.sharing.perceive(readings, fresh, self.perception.pose)
            own = None if own is None else self._own_body.without(own)
        if own is not None and not own_perception:
            own_state = replace(state, pose_covariance=None)
            change = self.perception.pose_change(own.time)
            self._reports.add(Report(self.name, own, now, own_state, pose_change=change))
            if self._regions is not None:
                measured = self.perception.measured
                self._regions.add(self.name, measured, self._own_body.at(measured).reference, self._view)
        elif own is not None and self.sharing is not None:
            self._reports.keep_joint(own, now)
        obeys = self.planner is not None and self.settings.obey_signals
        return StationPerception(
            now,
            ego,
            state,
            detections,
            tuple(inbox),
            NOTHING_FUSED,
            goal,
            self.perception.signals(readings) if obeys else (),
            message_interval,
            expired,
        )

    @property
    def reports(self) -> Sequence[Report]:
        """Newest report of each station."""
        return self._reports.newest

    def fuse(self, sensed: StationPerception) -> StationPerception:
        """Return what the station perceives with the objects that its method fuses."""
        return self.with_fused(sensed, self.fusion.fuse(self.reports, sensed.time))

    def with_fused(self, sensed: StationPerception, fused: Detections) -> StationPerception:
        """Return what the station perceives with the objects after fusion. Raise InvalidResult if they are invalid."""
        if self._fusion_checked:
            fused = checked_detections(self.fusion, "fuse", fused)
        return replace(sensed, fused=fused.freeze())

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
            check_plan(self.planner, plan, len(perceived.fused))
        return AgentStep(
            detections=detections,
            inbox=perceived.inbox,
            expired=perceived.expired,
            fused=perceived.fused,
            plan=plan,
            control=self._control(ego, plan) if action.control is None else action.control,
            outbox=self.message_generator.generate(
                perceived.state,
                action.shared(detections),
                now,
                () if self.sharing is None else self.sharing.own,
                interval=perceived.message_interval,
                measured=self.perception.measured,
            )
            if action.send
            else (),
            estimate=None if self.perception.has_exact_pose else ego,
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
