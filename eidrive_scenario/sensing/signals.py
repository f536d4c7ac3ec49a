"""The lookout for traffic lights and stop signs: what the map knows and nothing hides."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping

import numpy as np

from eidrive_scenario.arrays import Array
from eidrive_scenario.roads import RoadNetwork, Signal
from eidrive_scenario.sensing.mounting import mounting
from eidrive_scenario.sensing.readings import SignalReading
from eidrive_scenario.sensing.scene import NOTHING, Scene
from eidrive_scenario.sensing.settings import TruthSettings
from eidrive_scenario.world.actor import ActorSpec
from eidrive_scenario.world.road_objects import signal_heads
from eidrive_scenario.world.view import WorldView

SIGNAL_KINDS = frozenset({"light", "stop sign"})

RANGE = 100.0
"""How far lights and signs are made out [m]."""
ASIDE = math.radians(80.0)
"""From farther beside its front a face does not show what is on it [rad]."""
BEFORE = 0.4
"""Rays end this much before the face, as it has a housing [m]."""


class SignalSensor:
    """Reads signals of some kinds, out of SIGNAL_KINDS, that face the station, within range and in the line of sight.

    It looks ahead and aside from the roof, so that a vehicle at its stop line still sees a light beside it. A stop sign
    is a reading without a state, and so is a light that shows nothing.
    """

    def __init__(self, spec: ActorSpec, roads: RoadNetwork | None, kinds: Collection[str] = SIGNAL_KINDS) -> None:
        self._mounting = mounting(TruthSettings(), spec, "roof")
        heads = [] if roads is None else signal_heads(roads)
        heads = [head for head in heads if signal_kind(head.signal) in kinds]
        self._ids = [head.signal.id for head in heads]
        self._facing: Array = np.array([(math.cos(head.pose.h), math.sin(head.pose.h), 0.0) for head in heads]).reshape(
            -1, 3
        )
        middles = [(head.pose.x, head.pose.y, head.pose.z + head.height / 2.0) for head in heads]
        self._faces: Array = np.array(middles).reshape(-1, 3) + BEFORE * self._facing

    def read(self, scene: Scene, view: WorldView, row: int, states: Mapping[str, str]) -> tuple[SignalReading, ...]:
        """What the actor in this row sees; `states` by the ids of the signals."""
        if not self._ids:
            return ()
        eye = np.array(self._mounting.position(view, row))
        way = eye - self._faces
        distance = np.linalg.norm(way, axis=1)
        before = np.einsum("ni,ni->n", way, self._facing) >= math.cos(ASIDE) * distance
        heading = float(view.yaw[row])
        ahead = way[:, 0] * math.cos(heading) + way[:, 1] * math.sin(heading) < 0.0
        near = np.flatnonzero((distance <= RANGE) & before & ahead)
        if not near.size:
            return ()
        hits = scene.raycast(np.broadcast_to(eye, (near.size, 3)).copy(), self._faces[near])
        seen = near[np.asarray(hits.rows) == NOTHING]
        return tuple(SignalReading(self._ids[index], states.get(self._ids[index], "")) for index in seen.tolist())


def signal_kind(signal: Signal) -> str | None:
    """One of SIGNAL_KINDS, None for what is none of them."""
    return "light" if signal.dynamic else "stop sign" if is_stop_sign(signal) else None


def is_stop_sign(signal: Signal) -> bool:
    """Whether a sign tells to stop: 206 of the German catalog, which OpenDRIVE files use, or R1-1 of the American."""
    kind = signal.type.upper()
    return not signal.dynamic and (kind in ("206", "R1-1") or (kind == "R1" and signal.subtype == "1"))
