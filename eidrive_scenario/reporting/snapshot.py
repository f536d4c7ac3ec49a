"""One instant as one station knows it, with the truth beside: what a top view draws."""

from __future__ import annotations

from dataclasses import dataclass, replace

from eidrive_scenario.detections import Detections
from eidrive_scenario.driving.communication.partial_reports import PartialReportAssembler
from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.driving.step import AgentStep
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.v2x.messages.message import LinkEvent, Message, ReceivedMessage
from eidrive_scenario.world.view import WorldView

USUAL = AgentSettings()
"""Settings of a station of which no other settings are known: how long it uses an old report."""
LINK_LIFETIME = 0.15
"""How long the last message on a link stays in the picture [s]; links of 10 Hz then do not flicker."""


@dataclass(frozen=True)
class StationSnapshot:
    """What `station` saw (`own`), holds from others (`heard`) and concluded (`fused`), and the links towards it.

    `own` is what the station goes by: where its own detections travel the channel too, those that have come back.
    `heard` holds one entry per sender and kind of message: the newest, with what the sender said before of objects that
    the newest leaves out. `links` hold one per sender, the newest.
    """

    station: str
    view: WorldView
    own: Detections
    heard: tuple[ReceivedMessage, ...]
    fused: Detections
    links: tuple[LinkEvent, ...]
    step: AgentStep | None

    @property
    def time(self) -> float:
        """[s]"""
        return self.view.time


class SnapshotBuilder:
    """Folds the frames of a run into snapshots of one station, which uses reports as long as its settings state."""

    def __init__(self, station: str, settings: AgentSettings = USUAL) -> None:
        self.station = station
        self._settings = settings
        self._heard: dict[tuple[str, str], ReceivedMessage] = {}
        self._partial: dict[str, PartialReportAssembler] = {}
        self._links: dict[str, LinkEvent] = {}
        self._own_travels = False

    def observe(self, frame: Frame) -> StationSnapshot:
        """Take the next frame; the snapshot at its time."""
        now = frame.view.time
        step = frame.steps.get(self.station)
        for received in step.inbox if step else ():
            self._hear(received)
        for event in frame.links:
            if event.receiver == self.station:
                self._links[event.sender] = event
                self._own_travels |= event.sender == self.station
        self._heard = {
            key: held
            for key, held in self._heard.items()
            if now - held.message.detections.time <= self._lifetime(held.message) + 1e-9
        }
        self._links = {name: event for name, event in self._links.items() if now - event.sent <= LINK_LIFETIME + 1e-9}
        return StationSnapshot(
            station=self.station,
            view=frame.view,
            own=self._own(step, now),
            heard=tuple(held for (name, _), held in self._heard.items() if name != self.station),
            fused=step.fused if step else Detections(now),
            links=tuple(event for name, event in self._links.items() if name != self.station),
            step=step,
        )

    def _hear(self, received: ReceivedMessage) -> None:
        message = received.message
        if message.objects is not None:
            lifetime = self._settings.lifetime(complete=False)
            said = self._partial.setdefault(message.sender, PartialReportAssembler(lifetime)).update(message)
            received = replace(received, message=replace(message, detections=said))
        key = message.sender, message.kind
        held = self._heard.get(key)
        if held is None or received.message.detections.time >= held.message.detections.time:
            self._heard[key] = received

    def _own(self, step: AgentStep | None, now: float) -> Detections:
        if step is None:
            return Detections(now)
        if not self._own_travels:
            return step.detections
        held = self._heard.get((self.station, "cpm"))
        return held.message.detections if held is not None else Detections(now)

    def _lifetime(self, message: Message) -> float:
        """How long the station uses a message [s]."""
        return self._settings.lifetime(complete=message.objects is None and message.kind == "cpm")
