"""Information of one station at one time, with the ground truth, for top views."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from msgspec.structs import replace

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.base.tolerances import TIME_TOLERANCE
from eidrive_scenario.driving.communication.report_store import PartialReportAssembler
from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.driving.step import AgentStep
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.v2x.messages.message import LinkEvent, ReceivedMessage
from eidrive_scenario.world.view import WorldView

DEFAULT_SETTINGS = AgentSettings()
"""Default settings of a station, which determine the lifetime of reports."""
LINK_LIFETIME = 0.15
"""Display time of the last message of a link [s]. It exceeds the period of 10 Hz messages to avoid flicker."""


@dataclass(frozen=True)
class StationSnapshot:
    """Own detections (`own`), received messages (`received`), fused detections and incoming links of a station.

    own       detections that the station uses; if they pass the channel, those that have been delivered
    received  newest message per sender and kind, completed by earlier reports on objects that it omits
    links     newest message outcome per sender
    speeds    speed of each actor [m/s]; that before the contact where one begins, as the view has that of the bounce
    """

    station: str
    view: WorldView
    own: Detections
    received: tuple[ReceivedMessage, ...]
    fused: Detections
    links: tuple[LinkEvent, ...]
    step: AgentStep | None
    speeds: Mapping[str, float]

    @property
    def time(self) -> float:
        """Simulation time [s]."""
        return self.view.time


class SnapshotBuilder:
    """Builder of snapshots of one station from the frames of a run. The settings define the lifetime of reports."""

    def __init__(self, station: str, settings: AgentSettings = DEFAULT_SETTINGS) -> None:
        self.station = station
        self._settings = settings
        self._newest: dict[tuple[str, str], ReceivedMessage] = {}
        self._partial: dict[str, PartialReportAssembler] = {}
        self._links: dict[str, LinkEvent] = {}
        self._speeds: Mapping[str, float] = {}
        self._own_travels = False

    def observe(self, frame: Frame) -> StationSnapshot:
        """Process the next frame and return the snapshot at its time."""
        now = frame.view.time
        step = frame.steps.get(self.station)
        inbox, expired = (step.inbox, step.expired) if step else ((), ())
        for row, received in enumerate(inbox):
            if row not in expired:
                self._receive(received)
        for event in frame.links:
            if event.receiver == self.station:
                self._links[event.sender] = event
                self._own_travels |= event.sender == self.station
        self._newest = {
            key: held
            for key, held in self._newest.items()
            if now - held.message.detections.time <= self._settings.report_lifetime + TIME_TOLERANCE
        }
        oldest = now - LINK_LIFETIME - TIME_TOLERANCE
        self._links = {name: event for name, event in self._links.items() if event.sent >= oldest}
        speeds = dict(zip(frame.view.names, frame.view.speed.tolist(), strict=True))
        touching = {name for contact in frame.view.contacts for name in (contact.first, contact.second)}
        before, self._speeds = self._speeds, speeds
        return StationSnapshot(
            station=self.station,
            view=frame.view,
            own=self._own(step, now),
            received=tuple(held for (name, _), held in self._newest.items() if name != self.station),
            fused=step.fused if step else Detections(now),
            links=tuple(event for name, event in self._links.items() if name != self.station),
            step=step,
            speeds={name: before.get(name, speed) if name in touching else speed for name, speed in speeds.items()},
        )

    def _receive(self, received: ReceivedMessage) -> None:
        message = received.message
        if message.objects is not None:
            assembler = PartialReportAssembler(self._settings.report_lifetime)
            assembler = self._partial.setdefault(message.sender, assembler)
            complete = assembler.update(message.objects, message.identified)
            received = replace(received, message=replace(message, detections=complete))
        key = message.sender, message.kind
        held = self._newest.get(key)
        if held is None or received.message.detections.time >= held.message.detections.time:
            self._newest[key] = received

    def _own(self, step: AgentStep | None, now: float) -> Detections:
        if step is None:
            return Detections(now)
        if not self._own_travels:
            return step.detections
        held = self._newest.get((self.station, "cpm"))
        return held.message.detections if held is not None else Detections(now)
