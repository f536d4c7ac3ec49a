"""Signal sensor: traffic lights and stop signs of the map in the line of sight."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from typing import Literal

import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.roads import RoadNetwork, Signal
from eidrive_scenario.sensing.crossing import starts_behind_bodies
from eidrive_scenario.sensing.readings import SignalReading
from eidrive_scenario.sensing.sensor import Scene, mounting
from eidrive_scenario.sensing.settings import TruthSettings
from eidrive_scenario.world.actor import ActorSpec
from eidrive_scenario.world.road_objects import signal_heads
from eidrive_scenario.world.view import NOTHING, WorldView

Kind = Literal["light", "stop sign", "give way sign"]
SIGNAL_KINDS = frozenset({"light", "stop sign"})
"""Kinds of signals that require a stop, which stations read."""

RANGE = 100.0
"""Maximum distance of readable lights and signs [m]."""
ASIDE = math.radians(80.0)
"""Maximum angle between the normal of a face and the direction to the sensor [rad]."""
BEFORE = 0.4
"""Distance of the end of rays in front of the face, because of its housing [m]."""


class SignalSensor:
    """Sensor of signals of some kinds, out of SIGNAL_KINDS, that face the station, within range and line of sight.

    Its field of view from the roof covers the front and the sides, so that a vehicle at its stop line has a light
    beside it in view. A stop sign is a reading without a state, and so is a dark light.
    """

    def __init__(self, spec: ActorSpec, roads: RoadNetwork | None, kinds: Collection[str] = SIGNAL_KINDS) -> None:
        self._mounting = mounting(TruthSettings(), spec, "roof")
        heads = [] if roads is None else signal_heads(roads)
        heads = [head for head in heads if signal_kind(head.signal) in kinds]
        self._ids = [head.signal.id for head in heads]
        self._facing: Array = np.array([(math.cos(head.pose.h), math.sin(head.pose.h), 0.0) for head in heads]).reshape(
            -1, 3
        )
        centers = [(head.pose.x, head.pose.y, head.pose.z + head.height / 2.0) for head in heads]
        self._faces: Array = np.array(centers).reshape(-1, 3) + BEFORE * self._facing

    def read(self, scene: Scene, view: WorldView, row: int, states: Mapping[str, str]) -> tuple[SignalReading, ...]:
        """Return the signals in sight of the actor in this row; `states` by signal id."""
        if not self._ids:
            return ()
        origin = np.array(self._mounting.position(view, row))
        offset = origin - self._faces
        distance = np.linalg.norm(offset, axis=1)
        is_facing = np.einsum("ni,ni->n", offset, self._facing) >= math.cos(ASIDE) * distance
        heading = float(view.yaw[row])
        is_ahead = offset[:, 0] * math.cos(heading) + offset[:, 1] * math.sin(heading) < 0.0
        near = np.flatnonzero((distance <= RANGE) & is_facing & is_ahead)
        if not near.size:
            return ()
        faces = self._faces[near]
        # A light beside a truck is lower than its roof.
        starts = starts_behind_bodies(np.broadcast_to(origin, (1, *faces.shape)), faces[None], view, np.array([row]))[0]
        hits = scene.raycast(starts, faces)
        visible = near[hits.rows == NOTHING]
        return tuple(SignalReading(self._ids[index], states.get(self._ids[index], "")) for index in visible.tolist())


_SIGNS: Mapping[str, Kind] = {
    "206": "stop sign", "R1-1": "stop sign", "205": "give way sign", "R1-2": "give way sign",
}  # fmt: skip
"""Kinds of signs by their numbers in the German catalog, which OpenDRIVE files use, and in the American one."""


def signal_kind(signal: Signal) -> Kind | None:
    """Return the kind of a signal; None for those without right-of-way, and lights for pedestrians and cyclists."""
    if signal.stops_vehicles:
        return "light"
    number = signal.type.upper()
    return _SIGNS.get(f"R1-{signal.subtype}" if number == "R1" else number)
