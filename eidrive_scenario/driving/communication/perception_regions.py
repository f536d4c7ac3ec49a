"""Perception regions of the own sensors and of the senders of CPMs."""

from __future__ import annotations

import math

from eidrive_scenario.coverage import PerceptionRegion, ViewSector
from eidrive_scenario.tolerances import TIME_TOLERANCE
from eidrive_scenario.v2x.messages.message import Message


class PerceptionRegionStore:
    """Newest perception region of each station, kept for a lifetime [s].

    CPMs list the sensors of the sender once per second only (ETSI TS 103 324); the others apply them at a new pose.
    """

    def __init__(self, lifetime: float) -> None:
        self._lifetime = lifetime
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
            self._regions[station] = PerceptionRegion(station, time, tuple([one.placed(*pose) for one in sectors]))

    def add_message(self, message: Message) -> None:
        """Store the region of a CPM. Without information about the sensors of its sender it has none.

        The message has the pose of the sender at its generation; since the measurement it drove straight on.
        """
        if message.kind != "cpm":
            return
        if message.sensors is not None:
            self._sensors[message.sender] = message.sensors
        sectors = self._sensors.get(message.sender, ())
        if sectors:
            state, time = message.state, message.detections.time
            driven = state.speed * (state.time - time)
            x, y = state.x - driven * math.cos(state.yaw), state.y - driven * math.sin(state.yaw)
            self.add(message.sender, time, (x, y, state.z, state.yaw), sectors)

    def newest(self, now: float) -> tuple[PerceptionRegion, ...]:
        """Return the regions that do not exceed the lifetime at `now` [s], one for each station."""
        for station, region in list(self._regions.items()):
            if region.time < now - self._lifetime - TIME_TOLERANCE:
                del self._regions[station]
        return tuple(self._regions.values())
