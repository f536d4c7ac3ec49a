"""One instant as one station knows it, with the truth beside: what a top view draws."""

from __future__ import annotations

from dataclasses import dataclass

from eidrive_scenario.detections import Detections
from eidrive_scenario.driving.step import AgentStep
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.v2x.message import LinkEvent, Received
from eidrive_scenario.world.view import WorldView

MEMORY = 0.15
"""How long a received message stays in the picture [s]; stations that speak at 10 Hz then do not flicker."""


@dataclass(frozen=True)
class Snapshot:
    """What `station` saw (`own`), heard lately (`heard`) and concluded (`fused`), and the links towards it.

    `heard` and `links` hold at most one entry per sender, the newest.
    """

    station: str
    view: WorldView
    own: Detections
    heard: tuple[Received, ...]
    fused: Detections
    links: tuple[LinkEvent, ...]
    step: AgentStep | None

    @property
    def time(self) -> float:
        """[s]"""
        return self.view.time


class Knowledge:
    """Folds the frames of a run into snapshots of one station."""

    def __init__(self, station: str) -> None:
        self.station = station
        self._heard: dict[str, Received] = {}
        self._links: dict[str, LinkEvent] = {}

    def observe(self, frame: Frame) -> Snapshot:
        """Take the next frame; the snapshot at its time."""
        now = frame.view.time
        step = frame.steps.get(self.station)
        for received in step.inbox if step else ():
            self._heard[received.message.sender] = received
        for event in frame.links:
            if event.receiver == self.station and event.sender != self.station:
                self._links[event.sender] = event
        self._heard = {name: heard for name, heard in self._heard.items() if now - heard.arrived <= MEMORY + 1e-9}
        self._links = {name: event for name, event in self._links.items() if now - event.sent <= MEMORY + 1e-9}
        return Snapshot(
            station=self.station,
            view=frame.view,
            own=step.detections if step else Detections(now),
            heard=tuple(self._heard.values()),
            fused=step.fused if step else Detections(now),
            links=tuple(self._links.values()),
            step=step,
        )
