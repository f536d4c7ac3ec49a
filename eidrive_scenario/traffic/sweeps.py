"""Lanes that long vehicles sweep over in junctions: their ends swing out where the rear axle follows a bend."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from eidrive_scenario.base.arrays import Array, number_in_groups
from eidrive_scenario.traffic.cars import VAN_FRONT
from eidrive_scenario.traffic.lanes import TrafficLanes
from eidrive_scenario.world.actor import ActorSpec

SPARE = 0.35
"""Distance between the side of a lane of 3.25 m and that of the widest vehicle (2.55 m) in it [m]."""
STEP = 1.0
"""Distance between the positions of a vehicle on its passage [m]."""
Sweep = Mapping[int, tuple[float, float]]
"""Ranges of progress [m] on the swept lanes."""


class Sweeps:
    """Sweeps of long vehicles, one per passage and body."""

    def __init__(self, lanes: TrafficLanes) -> None:
        self._lanes = lanes
        self._sweeps: dict[tuple[tuple[int, ...], tuple[float, ...]], Sweep] = {}

    def of(self, spec: ActorSpec, passage: list[int]) -> Sweep:
        """Return the lanes beside a passage through a junction that a vehicle overlaps; none for a short vehicle."""
        if spec.offset[0] + 0.5 * spec.size[0] <= VAN_FRONT:
            return {}
        key = tuple(passage), (*spec.offset, *spec.size)
        if key not in self._sweeps:
            self._sweeps[key] = self._sweep(spec, passage)
        return self._sweeps[key]

    def _sweep(self, spec: ActorSpec, passage: list[int]) -> Sweep:
        lanes = self._lanes
        own = {*passage, *lanes.following[passage[-1]], int(lanes.backward[passage[0]])}
        some = np.array(passage)
        which, number = number_in_groups(np.ceil(lanes.length[some] / STEP).astype(np.int64) + 1)
        lane = some[which]
        progress = np.minimum(number * STEP, lanes.length[lane])
        poses = lanes.tables.lane_poses(lane, lanes.s(lane, progress), np.zeros(len(lane)))
        yaw = poses.h + np.where(lanes.direction[lane] > 0, 0.0, np.pi)
        ahead, left = _outline(spec)
        cos, sin = np.cos(yaw)[:, None], np.sin(yaw)[:, None]
        x, y = poses.x[:, None] + cos * ahead - sin * left, poses.y[:, None] + sin * ahead + cos * left
        swept, s, _ = lanes.roads.overlapped_lanes(x.ravel(), y.ravel(), poses.z.repeat(len(ahead)))
        at = lanes.progress(swept, s)
        return {
            other: (float(at[swept == other].min()), float(at[swept == other].max()))
            for other in np.unique(swept[lanes.tables.lane_drivable[swept]]).tolist()
            if other not in own
        }


def _outline(spec: ActorSpec) -> tuple[Array, Array]:
    """Return points on both sides of a body without `SPARE`: distances ahead and to the left of the reference [m]."""
    half = max(0.5 * spec.size[1] - SPARE, 0.0)
    along = spec.offset[0] + np.linspace(-0.5, 0.5, 9) * spec.size[0]
    return np.concatenate([along, along]), np.repeat([half, -half], len(along))
