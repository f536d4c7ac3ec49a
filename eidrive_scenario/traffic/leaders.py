"""Who drives or stands ahead of whom: per lane, over the lanes that each car will take."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.traffic.lanes import TrafficLanes
from eidrive_scenario.world.view import WorldView

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

BIG = 1e5
"""Longer than any lane [m]: rows times BIG plus progress puts all lanes on one axis."""
LOOK_AHEAD = 120.0
"""How far ahead a leader counts [m]."""
STANDING = 0.5
"""Slower than this counts as standing [m/s]."""
OUTLINE = np.array(
    [(0.5, 0.5), (0.5, 0.0), (0.5, -0.5), (0.0, 0.5), (0.0, -0.5), (-0.5, 0.5), (-0.5, 0.0), (-0.5, -0.5)]
)


@dataclass(frozen=True)
class Occupants:
    """What stands or drives on lanes: row, progress of what places it in the queue, progress of its rear, speed [m/s].

    owner  the car's index in the fleet, -1 for what does not belong to it
    """

    row: Integers
    key: Array
    rear: Array
    speed: Array
    owner: Integers


@dataclass(frozen=True)
class Leaders:
    """Gap from the front bumper to the leader's rear (N,) [m], inf for none, and the leaders' speeds (N,) [m/s]."""

    gap: Array
    speed: Array


def find_leaders(lanes: TrafficLanes, plans: Integers, progress: Array, front: Array, occupants: Occupants) -> Leaders:
    """The next occupant ahead of each car on its plan.

    plans     (N, D) rows of the lanes that each car takes, its own first, -1 where the plan ends
    progress  (N,) of the cars' reference points; front  (N,) distance from there to the front bumper [m]
    """
    count, depth = plans.shape
    gap, speed = np.full(count, np.inf), np.zeros(count)
    if not len(occupants.row):
        return Leaders(gap, speed)
    composite = occupants.row * BIG + occupants.key
    order = np.argsort(composite, kind="stable")
    composite = composite[order]
    me = np.arange(count)
    offset = -progress
    open_ = np.ones(count, dtype=bool)
    for d in range(depth):
        row = plans[:, d]
        open_ &= (row >= 0) & (offset < LOOK_AHEAD)
        if not open_.any():
            break
        start = row * BIG + progress if d == 0 else row * BIG - 1.0
        at = np.searchsorted(composite, start, side="right" if d == 0 else "left")
        inside = open_ & (at < len(order))
        found = order[np.minimum(at, len(order) - 1)]
        hit = inside & (occupants.row[found] == row) & (occupants.owner[found] != me)
        gap[hit] = offset[hit] + occupants.rear[found[hit]] - front[hit]
        speed[hit] = occupants.speed[found[hit]]
        open_ &= ~hit
        offset = offset + np.where(row >= 0, lanes.length[row], 0.0)
    return Leaders(gap, speed)


def obstacles(lanes: TrafficLanes, view: WorldView, own: frozenset[str]) -> tuple[Occupants, set[int]]:
    """The outlines of all actors not in `own`, on every lane that they touch, and the lanes of those that move.

    In a junction, where roads lie over each other, an actor stands on all the lanes that pass beneath it.
    """
    rows = [row for row, name in enumerate(view.names) if name not in own]
    if not rows:
        return Occupants(*(np.empty(0, dtype=kind) for kind in (np.int64, float, float, float, np.int64))), set()
    boxes = view.boxes[rows]
    corners = OUTLINE[None] * boxes[:, None, 3:5]
    cos, sin = np.cos(boxes[:, 6, None]), np.sin(boxes[:, 6, None])
    x = (boxes[:, 0, None] + cos * corners[..., 0] - sin * corners[..., 1]).ravel()
    y = (boxes[:, 1, None] + sin * corners[..., 0] + cos * corners[..., 1]).ravel()
    z = np.repeat(view.position[rows, 2], len(OUTLINE))
    velocity = np.repeat(view.velocity[rows, :2], len(OUTLINE), axis=0)
    row, s, point = lanes.roads.touched(x, y, z)
    progress = lanes.progress(row, s)
    heading = lanes.tables.curves.at(lanes.road[row], s)[2]
    along = velocity[point, 0] * np.cos(heading) + velocity[point, 1] * np.sin(heading)
    speed = np.maximum(along * lanes.direction[row], 0.0)
    moving = np.hypot(*velocity[point].T) > STANDING
    return Occupants(row, progress, progress, speed, np.full(len(row), -1)), set(row[moving].tolist())


def together(one: Occupants, other: Occupants) -> Occupants:
    """Both, as one."""
    return Occupants(
        np.concatenate([one.row, other.row]),
        np.concatenate([one.key, other.key]),
        np.concatenate([one.rear, other.rear]),
        np.concatenate([one.speed, other.speed]),
        np.concatenate([one.owner, other.owner]),
    )
