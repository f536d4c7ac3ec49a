"""Leaders and followers of cars per lane and along planned lanes."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np

from eidrive_scenario.base.arrays import Array, Integers
from eidrive_scenario.traffic.lanes import TrafficLanes

BIG = 1e5
"""Offset between lanes on a common axis, more than the length of any lane [m]."""
LOOK_AHEAD = 120.0
"""Maximum distance of a leader [m]."""
LOOK_BACK = 3
"""Maximum number of preceding lanes in which a follower is searched."""
FOREIGN, FIXED = -1, -2
"""Owners of occupants outside the fleet: other actors, and the ends of lanes."""


@dataclass(frozen=True)
class Occupants:
    """Occupants of lanes.

    lane         (M,) running number
    key          (M,) progress that determines the order [m]
    rear, front  (M,) progress of the ends [m]
    speed        (M,) along the lane [m/s]
    owner        (M,) index of the car in the fleet, negative for others
    """

    lane: Integers
    key: Array
    rear: Array
    front: Array
    speed: Array
    owner: Integers

    @cached_property
    def order(self) -> tuple[Integers, Array]:
        """Indices in the order along the axis of all lanes, and the positions on this axis."""
        position = self.lane * BIG + self.key
        order = np.argsort(position, kind="stable")
        return order, position[order]

    def without(self, owner: int) -> Occupants:
        """Return the occupants of other owners."""
        kept = self.owner != owner
        return Occupants(*(getattr(self, field.name)[kept] for field in fields(self)))


@dataclass(frozen=True)
class Leaders:
    """Leaders of cars (N,).

    gap    from the front bumper to the rear of the leader [m], inf without a leader
    speed  of the leader [m/s]
    owner  index of the leader in the fleet, negative for others
    """

    gap: Array
    speed: Array
    owner: Integers

    @classmethod
    def none(cls, count: int) -> Leaders:
        """Return leaders of cars without a leader."""
        return cls(np.full(count, np.inf), np.zeros(count), np.full(count, FIXED))

    def or_nearer(self, other: Leaders) -> Leaders:
        """Return the nearer leader of two for each car."""
        nearer = other.gap < self.gap
        columns = ((getattr(other, field.name), getattr(self, field.name)) for field in fields(self))
        return Leaders(*(np.where(nearer, theirs, own) for theirs, own in columns))


@dataclass(frozen=True)
class Followers:
    """Gap from the rear of a car to the front of its follower (N,) [m], inf without a follower.

    The followers are indices (N,) of the occupants, -1 without a follower.
    """

    gap: Array
    number: Integers


def find_leaders(
    lanes: TrafficLanes,
    plans: Integers,
    progress: Array,
    front: Array,
    occupants: Occupants,
    own: Integers | None = None,
) -> Leaders:
    """Return the next occupant ahead of each car on its plan.

    plans     (N, D) planned lanes, the current one first, -1 beyond the end
    progress  (N,) of the reference points
    front     (N,) distance from the reference point to the front bumper [m]
    own       (N,) indices of the cars in the fleet, by default 0, 1, 2, …
    """
    count, depth = plans.shape
    leaders = Leaders.none(count)
    if not len(occupants.lane) or not count:
        return leaders
    order, positions = occupants.order
    me = np.arange(count) if own is None else own
    open_, offset = np.arange(count), -progress
    for d in range(depth):
        lane = plans[open_, d]
        going = (lane >= 0) & (offset < LOOK_AHEAD)
        open_, offset, lane = open_[going], offset[going], lane[going]
        if not open_.size:
            break
        if d == 0:
            at = positions.searchsorted(lane * BIG + progress[open_], side="right")
        else:
            at = positions.searchsorted(lane * BIG - 1.0, side="left")
        occupant = order[np.minimum(at, len(order) - 1)]
        hit = (at < len(order)) & (occupants.lane[occupant] == lane) & (occupants.owner[occupant] != me[open_])
        hits = occupant[hit]
        leaders.gap[open_[hit]] = offset[hit] + occupants.rear[hits] - front[open_[hit]]
        leaders.speed[open_[hit]], leaders.owner[open_[hit]] = occupants.speed[hits], occupants.owner[hits]
        offset = offset + lanes.length[lane]
        open_, offset = open_[~hit], offset[~hit]
    return leaders


def find_followers(
    lanes: TrafficLanes, lane: Integers, progress: Array, rear: Array, occupants: Occupants, own: Integers
) -> Followers:
    """Return the next occupant behind positions on lanes, on the lane itself and its predecessors.

    occupants      without the ends of lanes, which would hide followers before them
    lane, progress  (N,) of the reference points
    rear           (N,) distance from the reference point to the rear bumper, negative [m]
    own            (N,) indices of the requesting cars in the fleet
    """
    count = len(lane)
    gap, number = np.full(count, np.inf), np.full(count, -1)
    if not len(occupants.lane) or not count:
        return Followers(gap, number)
    order, positions = occupants.order
    open_, offset, at_lane = np.arange(count), progress.copy(), lane
    for d in range(LOOK_BACK + 1):
        limit = at_lane * BIG + (progress[open_] if d == 0 else lanes.length[at_lane] + 1.0)
        at = positions.searchsorted(limit, side="left" if d == 0 else "right") - 1
        occupant = order[np.maximum(at, 0)]
        hit = (at >= 0) & (occupants.lane[occupant] == at_lane) & (occupants.owner[occupant] != own[open_])
        hits = occupant[hit]
        gap[open_[hit]] = offset[hit] + rear[open_[hit]] - occupants.front[hits]
        number[open_[hit]] = hits
        at_lane = lanes.backward[at_lane]
        going = ~hit & (at_lane >= 0) & (offset < LOOK_AHEAD)
        open_, at_lane = open_[going], at_lane[going]
        offset = offset[going] + lanes.length[at_lane]
        if not open_.size:
            break
    return Followers(gap, number)


def no_occupants() -> Occupants:
    """Return empty occupants."""
    none = np.empty(0)
    return Occupants(np.empty(0, dtype=np.int64), none, none, none, none, np.empty(0, dtype=np.int64))


def concatenate_occupants(*parts: Occupants) -> Occupants:
    """Return the union of occupants."""
    return Occupants(*(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(Occupants)))
